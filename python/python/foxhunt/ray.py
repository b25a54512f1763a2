"""Campaigns on a cluster of Ray.

As :mod:`foxhunt.dask`, on the cluster that ``ray.init`` has connected to: a campaign is cut into
chunks of seeds, and a chunk whose worker died is flown again by another one.
"""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

from ._chunks import Chunk, chunks, merged

if TYPE_CHECKING:
    import pandas as pd
    from ray import ObjectRef
    from typing_extensions import Unpack

    from .commands import CampaignOptions


def submit(
    scenario: str | os.PathLike[str] = "pritzl-6.1",
    *,
    runs: int = 100,
    seed: int = 1,
    chunk: int = 50,
    retries: int = 3,
    **options: Unpack[CampaignOptions],
) -> list[ObjectRef[pd.DataFrame]]:
    """Submits a campaign and returns the references of its chunks, in the order of their seeds.

    ``options`` are those of :func:`foxhunt.campaign`, and files are sent along as
    :func:`foxhunt.dask.submit` does. The dashboard shows each chunk as a task named
    ``foxhunt-campaign``, which takes one processor.
    """
    import ray

    fly = ray.remote(Chunk.fly).options(
        name="foxhunt-campaign", num_cpus=1, max_retries=retries
    )
    return [fly.remote(each) for each in chunks(scenario, runs, seed, chunk, dict(options))]


def campaign(
    scenario: str | os.PathLike[str] = "pritzl-6.1",
    *,
    runs: int = 100,
    seed: int = 1,
    chunk: int = 50,
    retries: int = 3,
    **options: Unpack[CampaignOptions],
) -> pd.DataFrame:
    """Flies a campaign on a cluster and returns the frame of :func:`foxhunt.campaign`.

    Keywords are those of :func:`submit`.
    """
    import ray

    references = submit(
        scenario, runs=runs, seed=seed, chunk=chunk, retries=retries, **options
    )
    return merged(ray.get(references))
