"""Campaigns on a cluster of Dask.

A campaign is cut into chunks of seeds. A run depends on its scenario and its seed alone, so the
frame is the same as one computer makes, whatever the number of workers, and a chunk whose worker
died is flown again by another one.
"""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any

from . import commands

if TYPE_CHECKING:
    import pandas as pd
    from distributed import Client, Future


def submit(
    client: Client,
    scenario: str | os.PathLike[str] = "pritzl-6.1",
    *,
    runs: int = 100,
    seed: int = 1,
    chunk: int = 50,
    retries: int = 3,
    **options: Any,
) -> list[Future[pd.DataFrame]]:
    """Submits a campaign and returns the futures of its chunks, in the order of their seeds.

    ``options`` are those of :func:`foxhunt.campaign`. A scenario that is a file is read here and
    sent along, so that workers need no shared folder; files that it names, and files among the
    options, they do need. The dashboard shows each chunk as a task named ``foxhunt-campaign``.
    """
    if runs < 1 or chunk < 1:
        raise ValueError(f"runs is {runs} and chunk {chunk}; both must be at least 1")
    text = None
    if os.path.isfile(scenario):
        with open(scenario, encoding="utf-8") as file:
            text = file.read()
    # One thread a task: the cluster decides how many run.
    options = {"jobs": 1, **options}
    starts = range(seed, seed + runs, chunk)
    return [
        client.submit(
            _chunk,
            os.fspath(scenario),
            text,
            start,
            min(chunk, seed + runs - start),
            options,
            key=("foxhunt-campaign-" + _token(scenario, text, options), start),
            retries=retries,
            pure=True,
        )
        for start in starts
    ]


def campaign(
    client: Client, scenario: str | os.PathLike[str] = "pritzl-6.1", **options: Any
) -> pd.DataFrame:
    """Flies a campaign on a cluster and returns the frame of :func:`foxhunt.campaign`.

    ``options`` are those of :func:`submit`. ``distributed.progress`` on what :func:`submit` returns
    shows how far it is.
    """
    import pandas as pd

    frames = [future.result() for future in submit(client, scenario, **options)]
    frame: pd.DataFrame = pd.concat(frames, ignore_index=True)
    return frame.sort_values(["estimator", "seed"], kind="stable").reset_index(drop=True)


def _chunk(
    scenario: str, text: str | None, seed: int, runs: int, options: dict[str, Any]
) -> pd.DataFrame:
    import tempfile

    if text is None:
        return commands.campaign(scenario, seed=seed, runs=runs, **options)
    with tempfile.TemporaryDirectory() as folder:
        path = os.path.join(folder, os.path.basename(scenario))
        with open(path, "w", encoding="utf-8") as file:
            file.write(text)
        return commands.campaign(path, seed=seed, runs=runs, **options)


def _token(*what: Any) -> str:
    from dask.base import tokenize

    token: str = tokenize(*what)
    return token
