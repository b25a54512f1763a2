"""The examples in the documentation of the package give what they promise."""

import doctest

import foxhunt
import foxhunt.commands
import foxhunt.estimators
import foxhunt.judging
import foxhunt.logs
import foxhunt.poses
import pytest

MODULES = [
    foxhunt,
    foxhunt._program,
    foxhunt.commands,
    foxhunt.estimators,
    foxhunt.judging,
    foxhunt.logs,
    foxhunt.poses,
]


@pytest.mark.parametrize("module", MODULES, ids=lambda module: module.__name__)
def test_examples(module):
    found = doctest.testmod(module, optionflags=doctest.ELLIPSIS)
    assert found.attempted > 0
    assert found.failed == 0
