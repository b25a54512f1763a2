"""Writes ``foxhunt/commands.py``: a function with typed keywords for each command of the program.

The program describes its commands itself. ``python tools/commands.py`` writes the file anew after a
change of flags; a test compares the two.
"""

from __future__ import annotations

import json
import keyword
import sys
import textwrap
from pathlib import Path
from typing import Any

from foxhunt._foxhunt import commands_json
from foxhunt._program import PLACES

TARGET = Path(__file__).parents[1] / "python" / "foxhunt" / "commands.py"

#: Commands whose files may be tables in memory.
OF_TABLES = {"locate", "judge", "bearing"}

#: Commands that return a dictionary.
OF_RESULT = {"locate", "bearing", "judge", "hunt", "replay"}

#: What campaigns and stores set themselves for their frames.
OWN = {"campaign": {"hunts-to", "runs", "seed"}, "results": {"csv"}}

#: Commands that are no use in Python.
LEFT_OUT = {"completions", "man"}

HEADER = '''\
"""The program's commands as functions; each returns what the program prints with ``--json``.

Written by ``tools/commands.py`` from the program's own description. Keywords are flags, and those
that are left out have the program's defaults. A table is the path of a file, or columns in memory:
a frame of pandas or polars, or a dictionary of arrays.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Literal, TypedDict

from . import _program
from ._program import Path, Place, Result, Table, run

if TYPE_CHECKING:
    import pandas as pd

'''


def text() -> str:
    """What stands in the file."""
    described = json.loads(commands_json())
    # A build without drivers has commands that only say so.
    described = [
        each for each in described if each["arguments"] and name_of(each) not in LEFT_OUT
    ]
    names = [name_of(each) for each in described]
    exported = ["CampaignOptions", "Path", "Place", "Result", "Table", "run", *sorted(names)]
    listed = "".join(f'    "{name}",\n' for name in exported)
    aliases: dict[str, str] = {}
    parts = [function(each, aliases) for each in described]
    parts.append(options(next(each for each in described if each["words"] == ["campaign"]), aliases))
    named = "".join(f"{name} = {choices}\n" for choices, name in aliases.items())
    head = HEADER + named + f"\n__all__ = [\n{listed}]\n"
    return "\n\n".join([head, *parts])


def name_of(command: dict[str, Any]) -> str:
    return safe("_".join(command["words"]))


def safe(name: str) -> str:
    name = name.lower().replace("-", "_")
    return name + "_" if keyword.iskeyword(name) or name in {"list", "type"} else name


def choice_of(argument: dict[str, Any], aliases: dict[str, str]) -> str:
    """The type of a value that is one of some, named where it is long."""
    chosen = ", ".join(f'"{choice}"' for choice in argument["choices"])
    if len(chosen) <= 60:
        return f"Literal[{chosen}]"
    lines = "".join(f'    "{choice}",\n' for choice in argument["choices"])
    choices = f"Literal[\n{lines}]"
    if choices not in aliases:
        name = "".join(part.capitalize() for part in argument["name"].split("-")) + "Name"
        used = sum(other.rstrip("0123456789") == name for other in aliases.values())
        aliases[choices] = name + (str(used + 1) if used else "")
    return aliases[choices]


def type_of(argument: dict[str, Any], of_tables: bool, aliases: dict[str, str]) -> str:
    if argument["kind"] == "switch":
        return "bool"
    if argument["choices"]:
        return choice_of(argument, aliases)
    if argument["name"] in PLACES:
        return "Place"
    if argument["positional"] and of_tables:
        return "Table"
    if argument["positional"] and argument["kind"] == "text":
        return "Path"
    return {"integer": "int", "number": "float", "path": "Path", "text": "Path | float"}[
        argument["kind"]
    ]


def keywords(command: dict[str, Any]) -> list[dict[str, Any]]:
    left_out = OWN.get(name_of(command), set())
    return [
        each
        for each in command["arguments"]
        if not each["positional"] and each["name"] not in left_out
    ]


def annotated(argument: dict[str, Any], of_tables: bool, aliases: dict[str, str]) -> str:
    """The type of a keyword."""
    kind = type_of(argument, of_tables, aliases)
    if kind == "bool":
        return kind
    return f"{kind} | Sequence[{kind}]" if argument["many"] else kind


def function(command: dict[str, Any], aliases: dict[str, str]) -> str:
    name = name_of(command)
    of_tables = name in OF_TABLES
    positional = [each for each in command["arguments"] if each["positional"]]
    parameters, given = [], []
    starred = False
    for each in positional:
        own = safe(each["name"])
        kind = type_of(each, of_tables, aliases)
        if each["many"] and each is positional[-1]:
            parameters.append(f"*{own}: {kind}")
            given.append(f"*{own}")
            starred = True
        elif each["many"]:
            parameters.append(f"{own}: {kind} | Sequence[{kind}]")
            given.append(f"*_program.several({own})")
        elif each["required"]:
            parameters.append(f"{own}: {kind}")
            given.append(own)
        else:
            parameters.append(f"{own}: {kind} | None = None")
            given.append(own)
    flags = keywords(command)
    own_keywords = []
    if name == "campaign":
        own_keywords = ["runs: int = 100", "seed: int = 1"]
    if (flags or own_keywords) and not starred:
        parameters.append("*")
    parameters += own_keywords
    # A flag that must be given has no default.
    for each in sorted(flags, key=lambda each: not each["required"]):
        kind = annotated(each, of_tables, aliases)
        if each["required"]:
            parameters.append(f"{safe(each['name'])}: {kind}")
        else:
            default = "False" if kind == "bool" else "None"
            kind = kind if kind == "bool" else f"{kind} | None"
            parameters.append(f"{safe(each['name'])}: {kind} = {default}")
    result = "Result" if name in OF_RESULT else "Any"
    result = "pd.DataFrame" if name in {"campaign", "results"} else result
    signature = "".join(f"    {each},\n" for each in parameters)
    head = f"def {name}(\n{signature}) -> {result}:" if parameters else f"def {name}() -> {result}:"
    passed = "".join(f'        "{each["name"]}": {safe(each["name"])},\n' for each in flags)
    passed = f"{{\n{passed}    }}" if flags else "{}"
    body = f"    flags: dict[str, Any] = {passed}\n"
    if name in {"hunt", "campaign", "results"}:
        first = ", ".join(given)
        more = ", runs, seed" if name == "campaign" else ""
        call = f"    return _program.{name}({first}{more}, flags)\n"
    else:
        words = ", ".join(f'"{word}"' for word in command["words"])
        first = "".join(f", {each}" for each in given)
        returned = f"result: {result} = " if result == "Result" else "return "
        call = f"    {returned}_program.command([{words}{first}], flags)\n"
        if result == "Result":
            call += "    return result\n"
    return head + "\n" + docstring(command, positional, flags) + body + call


def docstring(
    command: dict[str, Any], positional: list[dict[str, Any]], flags: list[dict[str, Any]]
) -> str:
    name = name_of(command)
    words = " ".join(command["words"])
    about = escaped(command["about"]).rstrip(".")
    lines = wrapped(f"{about}: ``foxhunt {words}``.", 4)
    more = escaped(command["details"]).removeprefix(escaped(command["about"])).strip()
    for paragraph in more.split("\n\n"):
        if paragraph.strip():
            lines += ["", *wrapped(paragraph, 4)]
    if name in EXTRA:
        lines += ["", *textwrap.indent(EXTRA[name], "    ").splitlines()]
    if positional or flags or name == "campaign":
        lines += ["", "    Args:"]
    if name == "campaign":
        lines += wrapped("runs: Number of hunts.", 8, 12)
        lines += wrapped("seed: Seed of the first run; run i has the seed ``seed`` + i.", 8, 12)
    for each in [*positional, *flags]:
        help_text = " ".join(escaped(each["help"]).split())
        if each["default"] and not each["kind"] == "switch" and "[default" not in help_text:
            help_text += f" [default: {', '.join(each['default'])}]"
        lines += wrapped(f"{safe(each['name'])}: {help_text}", 8, 12)
    lines[0] = '    """' + lines[0].strip()
    return "\n".join([*lines, '    """', ""])


def escaped(help_text: str) -> str:
    return help_text.replace("\\", "\\\\").replace('"""', "'''")


def wrapped(paragraph: str, indent: int, further: int | None = None) -> list[str]:
    further = indent if further is None else further
    return textwrap.wrap(
        " ".join(paragraph.split()),
        97,
        initial_indent=" " * indent,
        subsequent_indent=" " * further,
        break_long_words=False,
        break_on_hyphens=False,
    )


def options(campaign: dict[str, Any], aliases: dict[str, str]) -> str:
    """The keywords of campaigns on clusters."""
    lines = [
        "class CampaignOptions(TypedDict, total=False):",
        '    """The keywords of :func:`campaign` beside its runs and seed."""',
        "",
    ]
    for each in keywords(campaign):
        if each["name"] != "jobs":
            kind = annotated(each, False, aliases)
            kind = kind if kind == "bool" else f"{kind} | None"
            lines.append(f"    {safe(each['name'])}: {kind}")
    return "\n".join([*lines, ""])


#: What the functions do beside the program, with examples.
EXTRA = {
    "hunt": """\
The log and the pictures are left in the folder ``out``. Without it nothing is left; a folder of
that name is the program's own default.

>>> found = hunt(seed=1)["beacons"]
>>> [beacon["error_m"] < 3 for beacon in found]
[True, True]""",
    "campaign": """\
Returns a data frame with one row for each run, estimator and beacon: seed, error in metres,
NEES, steps and how the search ended; a run that could not go on is one row without a beacon
whose outcome is ``failed``. ``run("campaign", ...)`` gives the summary instead.

>>> frame = campaign("pritzl-6.1", runs=2, estimator=["ekf", "ukf"])
>>> frame.groupby("estimator").size().to_dict()
{'ekf': 4, 'ukf': 4}""",
    "results": """\
Returns the runs of a store as a data frame with one row for each run, contender and beacon,
sorted by them. ``run("results", file)`` gives the summary instead, and ``run("results", file,
"--compare", "ekf", "ukf")`` a comparison.

>>> import os, tempfile
>>> store = os.path.join(tempfile.mkdtemp(), "runs.sqlite")
>>> summary = run("campaign", "one-drone", runs=3, estimator=["ekf", "ukf"], store=store)
>>> results(store, estimator="ekf").seed.to_list()
[1, 2, 3]""",
    "locate": """\
Files may be tables in memory.

>>> import numpy as np
>>> time = np.arange(20.0)
>>> east, north = 60 * np.cos(time / 3), 60 * np.sin(time / 3)
>>> compass = np.degrees(np.arctan2(20 - east, 15 - north)) % 360
>>> walk = {"time_s": time, "east_m": east, "north_m": north, "bearing_deg_compass": compass}
>>> found = locate(walk)["estimate"]
>>> round(found["east_m"]), round(found["north_m"])
(20, 15)""",
}


if __name__ == "__main__":
    TARGET.write_text(text(), encoding="utf-8")
    sys.stdout.write(f"{TARGET}\n")
