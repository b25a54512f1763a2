"""A campaign on a cluster, one of whose workers is killed."""

import os
import shutil
import signal
from pathlib import Path

import pytest

import foxhunt
import foxhunt.dask

distributed = pytest.importorskip("distributed")

SCENARIOS = Path(__file__).parents[2] / "hunt" / "scenarios"


def test_a_killed_worker_changes_nothing(tmp_path):
    # A file, which goes along to workers that do not have it.
    scenario = tmp_path / "own.toml"
    shutil.copy(SCENARIOS / "pritzl-6.1.toml", scenario)
    options = {"runs": 24, "seed": 3, "estimator": ["ekf"]}
    alone = foxhunt.campaign(scenario, **options)
    with (
        distributed.LocalCluster(
            n_workers=3, threads_per_worker=1, processes=True, dashboard_address=None
        ) as cluster,
        distributed.Client(cluster) as client,
    ):
        futures = foxhunt.dask.submit(client, scenario, chunk=3, **options)
        # As soon as something is done, the others are at work.
        next(iter(distributed.as_completed(futures)))
        victim = next(iter(client.run(os.getpid).values()))
        os.kill(victim, signal.SIGKILL)
        frame = foxhunt.dask.campaign(client, scenario, chunk=3, **options)
        assert victim not in client.run(os.getpid).values()
    assert frame.equals(alone)


def test_no_runs_are_refused():
    with pytest.raises(ValueError, match="runs is 0"):
        foxhunt.dask.submit(None, runs=0)
