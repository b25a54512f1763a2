"""The program's commands, each of which returns what the program prints with ``--json``."""

from __future__ import annotations

import json
import os
import tempfile
from typing import TYPE_CHECKING, Any

from ._foxhunt import run_json

if TYPE_CHECKING:
    import pandas as pd

Path = str | os.PathLike[str]
Result = dict[str, Any]


def run(*arguments: Path | float, **options: Any) -> Any:
    """Runs a command of the program ``foxhunt`` and returns its result.

    Keywords are flags: ``start_on_grid=6`` is ``--start-on-grid 6``, ``all=True`` is ``--all``, and
    a list gives the flag again for each of its values; None and False leave it out. Raises
    ValueError for wrong use or input and RuntimeError for a failure, with the program's own text.

    >>> [each["name"] for each in run("list", "scenarios")][:1]
    ['pritzl-6.1']
    >>> run("hunt", "pritzl-6.2")
    Traceback (most recent call last):
        ...
    ValueError: "pritzl-6.2" is neither a file nor a built-in scenario...
    """
    result = run_json([os.fspath(_text(each)) for each in arguments] + _flags(options))
    return json.loads(result) if result else None


def locate(*files: Path, **options: Any) -> Result:
    """Locates a transmitter from recorded flights: ``foxhunt locate``.

    ``locate("flight.csv", estimator="shadowing-grid", beacon="collar 1")``; ``run("locate",
    "--help")`` names all options.
    """
    result: Result = run("locate", *files, **options)
    return result


def bearing(file: Path, **options: Any) -> Result:
    """Finds the bearing of each turn of an antenna in a recording: ``foxhunt bearing``."""
    result: Result = run("bearing", file, **options)
    return result


def hunt(scenario: Path = "pritzl-6.1", *, out: Path | None = None, **options: Any) -> Result:
    """Flies one simulated hunt: ``foxhunt hunt``.

    The log and the pictures are left in the folder ``out``, and nowhere without one.

    >>> found = hunt(seed=1)["beacons"]
    >>> [beacon["error_m"] < 3 for beacon in found]
    [True, True]
    """
    with tempfile.TemporaryDirectory() as folder:
        result: Result = run("hunt", scenario, out=out or folder, **options)
        return result


def replay(log: Path, **options: Any) -> Result:
    """Runs the estimator of a log, or another one, over what was received: ``foxhunt replay``."""
    result: Result = run("replay", log, **options)
    return result


def campaign(
    scenario: Path = "pritzl-6.1", *, runs: int = 100, seed: int = 1, **options: Any
) -> pd.DataFrame:
    """Flies a hunt many times: ``foxhunt campaign``, as a data frame.

    One row for each run, estimator and beacon, with seed, error in metres, NEES, steps and how the
    search ended; a run that could not go on is one row without a beacon whose outcome is ``failed``.
    ``run("campaign", ...)`` gives the summary instead. Run i has the seed ``seed`` + i.

    >>> frame = campaign("pritzl-6.1", runs=2, estimator=["ekf", "ukf"])
    >>> frame.groupby("estimator").size().to_dict()
    {'ekf': 4, 'ukf': 4}
    """
    import pandas as pd

    with tempfile.TemporaryDirectory() as folder:
        rows = os.path.join(folder, "hunts.jsonl")
        flags = {"runs": runs, "seed": seed, "hunts_to": rows, "quiet": True, **options}
        summary = run("campaign", scenario, **flags)
        with open(rows, encoding="utf-8") as lines:
            hunts = [json.loads(line) for line in lines]
    table = [_row(hunt, beacon) for hunt in hunts for beacon in hunt["beacons"]]
    flown = {(hunt["estimator"], hunt["seed"]) for hunt in hunts}
    for estimator in (each["estimator"] for each in summary["estimators"]):
        for each in range(seed, seed + runs):
            if (estimator, each) not in flown:
                table.append({"seed": each, "estimator": estimator, "outcome": "failed"})
    frame = pd.DataFrame(table, columns=list(_COLUMNS))
    return frame.sort_values(["estimator", "seed"], kind="stable").reset_index(drop=True)


def results(file: Path, **options: Any) -> pd.DataFrame:
    """Reads the runs of a store as a data frame: ``foxhunt results --csv``.

    One row for each run, contender and beacon, sorted by them; ``estimator``, ``planner``,
    ``scenario``, ``beacon`` and ``seeds="1..1000"`` choose some. ``run("results", file)`` gives the
    summary instead, and ``run("results", file, "--compare", "ekf", "ukf")`` a comparison.

    >>> import os, tempfile
    >>> store = os.path.join(tempfile.mkdtemp(), "runs.sqlite")
    >>> summary = run("campaign", "one-drone", runs=3, estimator=["ekf", "ukf"], store=store)
    >>> results(store, estimator="ekf").seed.to_list()
    [1, 2, 3]
    """
    import pandas as pd

    with tempfile.TemporaryDirectory() as folder:
        rows = os.path.join(folder, "runs.csv")
        run("results", file, csv=rows, **options)
        # To the last digit, which pandas does by itself from 3.1 on.
        version = tuple(int(part) for part in pd.__version__.split(".")[:2])
        exact: dict[str, Any] = {} if version >= (3, 1) else {"float_precision": "round_trip"}
        frame: pd.DataFrame = pd.read_csv(rows, **exact)
    return frame


_COLUMNS = (
    "seed",
    "estimator",
    "planner",
    "beacon",
    "truth_east_m",
    "truth_north_m",
    "east_m",
    "north_m",
    "error_m",
    "nees",
    "steps",
    "steps_to_3m",
    "time_to_3m_s",
    "path_m",
    "duration_s",
    "outcome",
)


def _row(hunt: dict[str, Any], beacon: dict[str, Any]) -> dict[str, Any]:
    same = {name: hunt[name] for name in ("seed", "estimator", "planner", "duration_s")}
    names = ("error_m", "nees", "steps", "steps_to_3m", "time_to_3m_s", "path_m", "outcome")
    return {
        **same,
        **{name: beacon[name] for name in names},
        "beacon": beacon["name"],
        "truth_east_m": beacon["truth"]["east_m"],
        "truth_north_m": beacon["truth"]["north_m"],
        "east_m": beacon["estimate"]["east_m"],
        "north_m": beacon["estimate"]["north_m"],
    }


def _text(value: Any) -> str:
    return os.fspath(value) if isinstance(value, os.PathLike) else str(value)


def _flags(options: dict[str, Any]) -> list[str]:
    flags = []
    for name, value in options.items():
        flag = "--" + name.rstrip("_").replace("_", "-")
        if value is True:
            flags.append(flag)
        elif value is not None and value is not False:
            several = value if isinstance(value, (list, tuple)) else [value]
            # With an equals sign a negative number is no flag.
            flags += [f"{flag}={_text(each)}" for each in several]
    return flags
