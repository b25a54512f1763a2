"""The examples in the documentation of the package give what they promise."""

import doctest
import re
from pathlib import Path

import foxhunt
import foxhunt.commands
import foxhunt.estimators
import foxhunt.judging
import foxhunt.laws
import foxhunt.logs
import foxhunt.poses
import pytest

MODULES = [
    foxhunt,
    foxhunt._program,
    foxhunt.commands,
    foxhunt.estimators,
    foxhunt.judging,
    foxhunt.laws,
    foxhunt.logs,
    foxhunt.poses,
]


@pytest.mark.parametrize("module", MODULES, ids=lambda module: module.__name__)
def test_examples(module):
    found = doctest.testmod(module, optionflags=doctest.ELLIPSIS)
    assert found.attempted > 0
    assert found.failed == 0


def test_the_examples_of_the_book():
    text = (Path(__file__).parents[2] / "docs" / "python.md").read_text(encoding="utf-8")
    examples = [each for each in re.findall(r"```python\n(.*?)```", text, re.S) if "assert" in each]
    assert len(examples) >= 2
    for example in examples:
        exec(example, {"__name__": "example"})
