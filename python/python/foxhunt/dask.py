"""Campaigns on a cluster of Dask.

A campaign is cut into chunks of seeds. A run depends on its scenario and its seed alone, so the
frame is the same as one computer makes, whatever the number of workers, and a chunk whose worker
died is flown again by another one.
"""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any

from ._chunks import Chunk, chunks, merged

if TYPE_CHECKING:
    import pandas as pd
    from distributed import Client, Future
    from typing_extensions import Unpack

    from .commands import CampaignOptions


def submit(
    client: Client,
    scenario: str | os.PathLike[str] = "pritzl-6.1",
    *,
    runs: int = 100,
    seed: int = 1,
    chunk: int = 50,
    retries: int = 3,
    **options: Unpack[CampaignOptions],
) -> list[Future[pd.DataFrame]]:
    """Submits a campaign and returns the futures of its chunks, in the order of their seeds.

    ``options`` are those of :func:`foxhunt.campaign`. A scenario that is a file is read here and
    sent along, so that workers need no shared folder; files that it names, and files among the
    options, they do need. The dashboard shows each chunk as a task named ``foxhunt-campaign``.
    """
    return [
        client.submit(
            Chunk.fly,
            each,
            key=(
                "foxhunt-campaign-" + _token(each.scenario, each.text, each.options),
                each.seed,
                each.runs,
            ),
            retries=retries,
            pure=True,
        )
        for each in chunks(scenario, runs, seed, chunk, dict(options))
    ]


def campaign(
    client: Client,
    scenario: str | os.PathLike[str] = "pritzl-6.1",
    *,
    runs: int = 100,
    seed: int = 1,
    chunk: int = 50,
    retries: int = 3,
    **options: Unpack[CampaignOptions],
) -> pd.DataFrame:
    """Flies a campaign on a cluster and returns the frame of :func:`foxhunt.campaign`.

    Keywords are those of :func:`submit`. ``distributed.progress`` on what :func:`submit` returns
    shows how far it is.
    """
    futures = submit(
        client, scenario, runs=runs, seed=seed, chunk=chunk, retries=retries, **options
    )
    return merged(future.result() for future in futures)


def _token(*what: Any) -> str:
    from dask.base import tokenize

    token: str = tokenize(*what)
    return token
