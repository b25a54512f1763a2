"""A campaign in chunks of seeds, which any cluster may fly.

A run depends on its scenario and its seed alone, so chunks may be flown anywhere, in any order and
again, and put together they are the frame that one computer makes.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from . import commands

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True)
class Chunk:
    """Some of the runs of a campaign, with all that a worker needs to fly them."""

    scenario: str
    text: str | None
    """What stands in the scenario's file; None for one that is built in."""
    seed: int
    runs: int
    options: dict[str, Any]

    def fly(self) -> pd.DataFrame:
        """Flies them: :func:`foxhunt.campaign`."""
        if self.text is None:
            return commands.campaign(self.scenario, seed=self.seed, runs=self.runs, **self.options)
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, os.path.basename(self.scenario))
            with open(path, "w", encoding="utf-8") as file:
                file.write(self.text)
            return commands.campaign(path, seed=self.seed, runs=self.runs, **self.options)


def chunks(
    scenario: str | os.PathLike[str], runs: int, seed: int, size: int, options: dict[str, Any]
) -> list[Chunk]:
    """The chunks of a campaign in the order of their seeds; a scenario's file is read here."""
    if runs < 1 or size < 1:
        raise ValueError(f"runs is {runs} and chunk {size}; both must be at least 1")
    text = None
    if os.path.isfile(scenario):
        with open(scenario, encoding="utf-8") as file:
            text = file.read()
    # One thread a task: the cluster decides how many run.
    options = {"jobs": 1, **options}
    end = seed + runs
    return [
        Chunk(os.fspath(scenario), text, start, min(size, end - start), options)
        for start in range(seed, end, size)
    ]


def merged(frames: Iterable[pd.DataFrame]) -> pd.DataFrame:
    """The frame of all chunks, as :func:`foxhunt.campaign` sorts it."""
    import pandas as pd

    frame: pd.DataFrame = pd.concat(frames, ignore_index=True)
    return frame.sort_values(["estimator", "seed"], kind="stable").reset_index(drop=True)
