"""Calls of the program, and the frames that are made of what it writes."""

from __future__ import annotations

import json
import os
import re
import sys
import tempfile
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from typing import TYPE_CHECKING, Any, Protocol, TypeAlias

import numpy as np

from ._foxhunt import run_json
from ._tables import is_table, write_table

if TYPE_CHECKING:
    import pandas as pd
    from numpy.typing import ArrayLike, NDArray

    class Frame(Protocol):
        """A frame of pandas, polars or the like: columns by name."""

        @property
        def columns(self) -> Any: ...
        def __getitem__(self, name: Any, /) -> Any: ...


Path = str | os.PathLike[str]
Result = dict[str, Any]
Table: TypeAlias = "Path | Frame | Mapping[str, ArrayLike]"
Place: TypeAlias = "str | Sequence[float] | NDArray[np.float64]"
Option: TypeAlias = "Path | float | bool | Sequence[Path | float] | None"

PLACES = {"origin", "truth"}
"""Flags with a place: a text such as ``"50.1,14.4"``, or two numbers."""


def run(*arguments: Table | float, **options: Option) -> Any:
    """Runs a command of the program ``foxhunt`` and returns its result.

    Keywords are flags: ``start_on_grid=6`` is ``--start-on-grid 6``, ``all=True`` is ``--all``, and
    a list gives the flag again for each of its values; None and False leave it out. Files may be
    tables in memory. Raises ValueError for wrong use or input and RuntimeError for a failure, with
    the program's own text. :mod:`foxhunt.commands` has a function with typed keywords for each
    command.

    >>> [each["name"] for each in run("list", "scenarios")][:1]
    ['pritzl-6.1']
    >>> run("hunt", "pritzl-6.2")
    Traceback (most recent call last):
        ...
    ValueError: "pritzl-6.2" is neither a file nor a built-in scenario...
    """
    return command(list(arguments), options)


def command(arguments: Sequence[Any], flags: Mapping[str, Any]) -> Any:
    """Runs a command. Tables in memory go through a temporary folder, which no result names."""
    with ExitStack() as stack:
        words, folder = [], None
        for argument in arguments:
            if argument is None:
                continue
            if not is_table(argument):
                words.append(_word(argument))
                continue
            if folder is None:
                folder = stack.enter_context(tempfile.TemporaryDirectory()) + os.sep
            number = sum(word.startswith(folder) for word in words) + 1
            path = folder + ("table.csv" if number == 1 else f"table-{number}.csv")
            write_table(argument, path)
            words.append(path)
        if folder is None:
            result = run_json(words + _flags(flags))
            return json.loads(result) if result else None
        heard: list[str] = []
        try:
            result = run_json(words + _flags(flags), heard)
        except (RuntimeError, ValueError) as error:
            raise type(error)(str(error).replace(folder, "")) from None
        finally:
            for line in (each.replace(folder, "") for each in heard):
                # The caller knows how many rows a table in memory has.
                if not re.fullmatch(r"table\S*\.csv: format \S+, (\d+) of \1 rows", line):
                    print(line, file=sys.stderr)
        result = result.replace(json.dumps(folder)[1:-1], "")
    return json.loads(result) if result else None


def several(value: Any) -> list[Any]:
    """One value or several as a list."""
    return list(value) if isinstance(value, (list, tuple)) else [value]


def hunt(scenario: Path | None, flags: dict[str, Any]) -> Result:
    """A hunt whose folder goes away unless it was asked for."""
    with tempfile.TemporaryDirectory() as folder:
        words = ["hunt"] if scenario is None else ["hunt", scenario]
        result: Result = command(words, {**flags, "out": flags.get("out") or folder})
        return result


def campaign(scenario: Path | None, runs: int, seed: int, flags: dict[str, Any]) -> pd.DataFrame:
    """The runs of a campaign as a frame."""
    import pandas as pd

    with tempfile.TemporaryDirectory() as folder:
        rows = os.path.join(folder, "hunts.jsonl")
        own = {"runs": runs, "seed": seed, "hunts-to": rows, "quiet": True}
        summary = command(["campaign", scenario], {**flags, **own})
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


def results(file: Path, flags: dict[str, Any]) -> pd.DataFrame:
    """The runs of a store as a frame."""
    import pandas as pd

    with tempfile.TemporaryDirectory() as folder:
        rows = os.path.join(folder, "runs.csv")
        command(["results", file], {**flags, "csv": rows})
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


def _word(value: Any) -> str:
    """An argument of the command line; what is none would be taken for a path."""
    if isinstance(value, (str, os.PathLike, int, float)) or getattr(value, "ndim", 1) == 0:
        return _text(value)
    raise TypeError(
        f"an argument is of the type {type(value).__name__}; it must be a path or a table: a frame "
        "of pandas or polars, a table of Arrow, a structured array, or a dictionary of columns"
    )


def _text(value: Any) -> str:
    return os.fspath(value) if isinstance(value, os.PathLike) else str(value)


def _is_pair(name: str, value: Any) -> bool:
    """True for a place of two numbers, which is one value."""
    return name in PLACES and not isinstance(value, (str, os.PathLike)) and np.shape(value) == (2,)


def _flags(options: Mapping[str, Any]) -> list[str]:
    flags = []
    for name, value in options.items():
        flag = "--" + name.rstrip("_").replace("_", "-")
        if value is True:
            flags.append(flag)
        elif value is not None and value is not False:
            # With an equals sign a negative number is no flag.
            value = ",".join(map(_text, value)) if _is_pair(name, value) else value
            flags += [f"{flag}={_text(each)}" for each in several(value)]
    return flags
