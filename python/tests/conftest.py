"""What the tests of clusters share."""

import shutil
from pathlib import Path

import pytest

SCENARIOS = Path(__file__).parents[2] / "hunt" / "scenarios"


@pytest.fixture
def own_scenario(tmp_path):
    """A file of the user's own, which goes along to workers that do not have it."""
    path = tmp_path / "own.toml"
    shutil.copy(SCENARIOS / "pritzl-6.1.toml", path)
    return path
