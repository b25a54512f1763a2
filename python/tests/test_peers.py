"""The ten lines of docs/coming-from.md: the same answer from four libraries."""

import runpy
from pathlib import Path

import numpy as np
import pytest

EXAMPLES = Path(__file__).parents[1] / "examples"


@pytest.mark.parametrize("library", ["filterpy", "stonesoup", "gtsam"])
def test_ten_lines_give_the_same_answer(library, monkeypatch):
    pytest.importorskip(library)
    monkeypatch.syspath_prepend(str(EXAMPLES))
    ours = runpy.run_path(str(EXAMPLES / "by_foxhunt.py"))
    theirs = runpy.run_path(str(EXAMPLES / f"by_{library}.py"))
    for name in ("mean", "covariance"):
        other = np.asarray(theirs[name], float).reshape(ours[name].shape)
        np.testing.assert_allclose(ours[name], other, rtol=1e-8, atol=1e-8)
