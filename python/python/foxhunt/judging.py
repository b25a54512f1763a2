"""Tests of an estimator's consistency: are its errors as large as it states?"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ._foxhunt import judge_squares, judge_whiteness

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


@dataclass(frozen=True)
class Consistency:
    """The average of normalised squares beside what a consistent estimator has."""

    average: float
    """ANEES or ANIS."""

    expected: float
    """The mean of the degrees of freedom."""

    interval: tuple[float, float]
    """It holds a consistent estimator's average with the given probability."""

    verdict: str
    """``consistent``, ``over-confident``, ``under-confident``, or ``too few`` where a covariance
    wrong by a factor of 1.5 would not be noticed."""


@dataclass(frozen=True)
class Whiteness:
    """The test of Ljung & Box (1978) of all lags at once."""

    statistic: float
    lags: int
    p_value: float
    """The probability of a larger statistic if the innovations are white."""

    autocorrelations: list[tuple[int, float, float]]
    """For each lag its autocorrelation, and the standard deviation of that if they are white."""


def consistency(
    squares: ArrayLike, degrees_of_freedom: ArrayLike, *, probability: float = 0.95
) -> Consistency:
    """Judges normalised squares: the NEES of independent runs, or the NIS of the steps of one.

    ``degrees_of_freedom`` is the number of the state's components, or of those measured, one for
    all or one for each. Of one run only one time step gives a NEES, as its errors hang together
    (Bar-Shalom, Li & Kirubarajan 2001, 5.4.2).

    >>> rng = np.random.default_rng(1)
    >>> judged = consistency(rng.chisquare(2, 400), 2)
    >>> judged.verdict
    'consistent'
    >>> consistency(2.0 * rng.chisquare(2, 400), 2).verdict
    'over-confident'
    """
    values = np.atleast_1d(np.asarray(squares, float))
    for index in np.flatnonzero(~(np.isfinite(values) & (values >= 0.0))):
        wrong = np.atleast_1d(np.asarray(squares, object)).flat[index]
        raise ValueError(f"squares[{index}] is {wrong}; it must be a number of 0 or more")
    degrees = np.broadcast_to(np.asarray(degrees_of_freedom, int), values.shape)
    average, expected, interval, verdict = judge_squares(
        values.tolist(), degrees.tolist(), probability
    )
    return Consistency(average, expected, interval, verdict)


def whiteness(innovations: ArrayLike | Sequence[ArrayLike], *, lags: int = 10) -> Whiteness:
    """Judges whether normalised innovations hang together over time.

    ``innovations`` has one row a step, as an array or as a list of rows, or is a list of such
    arrays, one a run; a list of arrays of one axis is rows. NaN stands for a component that was not
    measured.

    >>> rng = np.random.default_rng(1)
    >>> whiteness(rng.normal(size=(500, 2))).p_value > 0.01
    True
    >>> whiteness(np.cumsum(rng.normal(size=500))).p_value < 0.01
    True
    """
    if len(innovations) == 0:  # type: ignore[arg-type]
        raise ValueError("innovations is empty; it must have a row for each step")
    several = isinstance(innovations, (list, tuple)) and np.ndim(innovations[0]) > 1
    runs = list(innovations) if several else [innovations]  # type: ignore[arg-type]
    columns = [np.asarray(run, float) for run in runs]
    columns = [run[:, None] if run.ndim == 1 else run for run in columns]
    return Whiteness(*judge_whiteness(columns, lags))
