"""A campaign on a cluster of Ray, one of whose workers is killed; where Ray is installed."""

import os
import signal

import pytest

import foxhunt
import foxhunt.ray

ray = pytest.importorskip("ray")


@pytest.fixture
def cluster():
    ray.init(num_cpus=3, include_dashboard=False, logging_level="error")
    yield
    ray.shutdown()


def test_a_killed_worker_changes_nothing(cluster, own_scenario):
    options = {"runs": 24, "seed": 3, "estimator": ["ekf"]}
    alone = foxhunt.campaign(own_scenario, **options)

    @ray.remote
    def process():
        return os.getpid()

    victim = ray.get(process.remote())
    references = foxhunt.ray.submit(own_scenario, chunk=3, **options)
    # As soon as something is done, the others are at work.
    ray.wait(references)
    os.kill(victim, signal.SIGKILL)
    parts = ray.get(references)
    assert victim not in ray.get([process.remote() for _ in range(12)])
    assert sum(len(part) for part in parts) == len(alone)
    assert foxhunt.ray.campaign(own_scenario, chunk=5, **options).equals(alone)
