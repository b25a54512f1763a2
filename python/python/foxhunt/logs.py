"""Logs of hunts as data frames."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True)
class Log:
    """A log: what was flown, and what happened."""

    header: dict[str, Any]
    """The first line: scenario, seed, estimator, model, beacons with their truth where known."""

    events: list[dict[str, Any]]
    """The other lines, each with ``event``, its kind, and ``time`` in seconds."""

    def frame(self, event: str | None = None) -> pd.DataFrame:
        """Events as a data frame; of one kind where given, and what they hold as columns.

        >>> from foxhunt import hunt, read_log
        >>> import tempfile
        >>> with tempfile.TemporaryDirectory() as out:
        ...     _ = hunt(seed=1, out=out)
        ...     log = read_log(out + "/hunt.jsonl")
        >>> corrections = log.frame("corrected")
        >>> bool((corrections["correction.nis"] >= 0).all())
        True
        >>> "reception.rss_dbm" in log.frame("received")
        True
        """
        import pandas as pd

        chosen = [each for each in self.events if event is None or each["event"] == event]
        return pd.json_normalize(chosen)

    def track(self, beacon: int = 0) -> pd.DataFrame:
        """The estimates of one beacon: time, East, North, covariance, NIS, and error where the log
        has the truth."""
        import numpy as np
        import pandas as pd

        truth = self.header["beacons"][beacon].get("truth")
        rows = []
        for each in self.events:
            if each["event"] != "corrected" or each["beacon"] != beacon:
                continue
            estimate = each["estimate"]
            east, north = estimate["mean"][:2]
            side = len(estimate["mean"])
            covariance = np.reshape(estimate["covariance"], (side, side))[:2, :2]
            row = {
                "time": each["time"],
                "east_m": east,
                "north_m": north,
                "covariance_m2": covariance,
                "nis": each["correction"].get("nis"),
            }
            if truth is not None:
                error = np.array([east - truth[0], north - truth[1]])
                row["error_m"] = float(np.hypot(*error))
                row["nees"] = float(error @ np.linalg.solve(covariance, error))
            rows.append(row)
        return pd.DataFrame(rows)


def read_log(path: str | os.PathLike[str]) -> Log:
    """Reads a log that ``hunt``, ``fly`` or ``node`` wrote.

    A last line that is not complete, as a computer that lost its power leaves it, is left out; any
    other line that is no JSON raises ValueError with file and line.
    """
    with open(path, encoding="utf-8") as file:
        lines = file.read().split("\n")
    complete = lines[:-1]
    values = []
    for number, line in enumerate(complete, start=1):
        try:
            values.append(json.loads(line))
        except json.JSONDecodeError as error:
            raise ValueError(f"{path}: line {number}: {error}") from None
    if not values or "foxhunt_log" not in values[0]:
        raise ValueError(f"{path}: line 1 is not the header of a log of foxhunt")
    return Log(values[0], values[1:])
