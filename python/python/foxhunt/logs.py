"""Logs of hunts as data frames."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ._foxhunt import check_event, places_at

if TYPE_CHECKING:
    import pandas as pd
    from numpy.typing import ArrayLike, NDArray


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
        if event is not None and not chosen:
            # It may be one that did not happen.
            check_event(event)
        return pd.json_normalize(chosen)

    def index(self, beacon: int | str) -> int:
        """The number of a beacon that is given by its number or its name."""
        names = [each["name"] for each in self.header["beacons"]]
        if isinstance(beacon, str) and beacon in names:
            return names.index(beacon)
        if not isinstance(beacon, str) and 0 <= beacon < len(names):
            return int(beacon)
        known = ", ".join(f"{number} {name!r}" for number, name in enumerate(names))
        raise ValueError(f"no beacon {beacon!r}; there are {known}")

    def truth(self, beacon: int | str, times: ArrayLike) -> NDArray[np.float64] | None:
        """The true places of a beacon at some times in seconds, East and North, one a row; None if
        the log has no truth. A beacon that moves is followed on its course."""
        beacon = self.index(beacon)
        moments = np.atleast_1d(np.asarray(times, float)).tolist()
        return places_at(json.dumps(self.header["beacons"][beacon]), moments)

    def track(self, beacon: int | str = 0) -> pd.DataFrame:
        """The estimates of one beacon: time, East, North, covariance, NIS, and where the log has
        the truth the true place at that time, the error and the NEES."""
        import pandas as pd

        beacon = self.index(beacon)
        corrected = [
            each
            for each in self.events
            if each["event"] == "corrected" and each["beacon"] == beacon
        ]
        truth = self.truth(beacon, [each["time"] for each in corrected]) if corrected else None
        rows = []
        for index, each in enumerate(corrected):
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
                row["truth_east_m"], row["truth_north_m"] = truth[index]
                error = np.array([east, north]) - truth[index]
                row["error_m"] = float(np.hypot(*error))
                row["nees"] = float(error @ np.linalg.solve(covariance, error))
            rows.append(row)
        return pd.DataFrame(rows)


def read_log(path: str | os.PathLike[str]) -> Log:
    """Reads a log that ``hunt``, ``fly`` or ``node`` wrote, or the only one in a folder.

    A last line that is not complete, as a computer that lost its power leaves it, is left out; any
    other line that is no JSON raises ValueError with file and line.
    """
    if os.path.isdir(path):
        logs = sorted(Path(path).glob("*.jsonl"))
        if len(logs) != 1:
            names = ", ".join(log.name for log in logs) or "none"
            raise ValueError(f"{path} is a folder; give one of its logs: {names}")
        path = logs[0]
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
