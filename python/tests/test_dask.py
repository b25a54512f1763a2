"""A campaign on a cluster, one of whose workers is killed."""

import os
import signal

import pytest

import foxhunt
import foxhunt.dask

distributed = pytest.importorskip("distributed")


def test_a_killed_worker_changes_nothing(own_scenario):
    options = {"runs": 24, "seed": 3, "estimator": ["ekf"]}
    alone = foxhunt.campaign(own_scenario, **options)
    with (
        distributed.LocalCluster(
            n_workers=3, threads_per_worker=1, processes=True, dashboard_address=None
        ) as cluster,
        distributed.Client(cluster) as client,
    ):
        futures = foxhunt.dask.submit(client, own_scenario, chunk=3, **options)
        # As soon as something is done, the others are at work.
        next(iter(distributed.as_completed(futures)))
        victim = next(iter(client.run(os.getpid).values()))
        os.kill(victim, signal.SIGKILL)
        frame = foxhunt.dask.campaign(client, own_scenario, chunk=3, **options)
        assert victim not in client.run(os.getpid).values()
        # What is still there of another size is not taken for a chunk of this one.
        less = foxhunt.dask.campaign(client, own_scenario, chunk=4, **{**options, "runs": 5})
    assert frame.equals(alone)
    assert less.equals(alone[alone.seed < 8].reset_index(drop=True))


def test_no_runs_are_refused():
    with pytest.raises(ValueError, match="runs is 0"):
        foxhunt.dask.submit(None, runs=0)
