"""The laws of estimators and measurement models, checked on objects of your own.

They are those of Rust's ``foxhunt::core::laws``, run by the same code. An estimator of your own has
``predict(dt)``, ``update(value, noise)`` and ``estimate()``, as :class:`foxhunt.Estimator` has. Its
``update`` returns an object with ``log_evidence`` and, if it has them, ``nis``, ``rejected`` and
``effective_sample_size``, such as a :class:`foxhunt.Correction`. For a measurement without a
component ``log_evidence`` is None. ``samples()`` is checked if there is one.

The laws hold an estimator to its own model. A noise or a motion unlike the true one is found by
:func:`foxhunt.consistency` over runs.

>>> import foxhunt
>>> def make():
...     motion, model = foxhunt.Motion.random_walk(0.1), foxhunt.Model.bearing()
...     return foxhunt.Ukf(motion, model, [30, 10], np.eye(2))
>>> check(make, 0.3, 0.1)

>>> class Halved:
...     quantities = [("bearing_rad", "angle")]
...
...     def __init__(self):
...         self.inner = make()
...         self.predict, self.estimate = self.inner.predict, self.inner.estimate
...
...     def update(self, value, noise):
...         made = self.inner.update(value, noise)
...         return made and foxhunt.Correction(False, (made.nis or 0) / 2, made.log_evidence)
>>> check(Halved, 0.3, 0.1)
Traceback (most recent call last):
    ...
AssertionError: Halved: over 1 of the components; E[NIS] is 0.5...
"""

from __future__ import annotations

import copy
import functools
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from . import _foxhunt

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from ._foxhunt import AnyModel

__all__ = ["check", "check_model"]


class EstimatorLike(Protocol):
    """An estimator of your own; ``update`` is given ``receiver`` unless that is the origin."""

    def predict(self, dt: float) -> object: ...
    def estimate(self) -> Any: ...
    @property
    def update(self) -> Callable[..., object]: ...


def check(
    make: Callable[[], EstimatorLike] | EstimatorLike,
    value: ArrayLike,
    noise: ArrayLike,
    *,
    quantities: Sequence[tuple[str, str]] | None = None,
    receiver: ArrayLike | None = None,
    heading: float | None = None,
    velocity: ArrayLike | None = None,
    step: float = 1.0,
    worthless_tolerance: float | None = 1e-6,
    predictive: bool = True,
    tolerance: float = 0.01,
    standard_errors: float = 4.0,
    nis: bool = True,
) -> None:
    """Checks an estimator about one measurement; raises AssertionError that names the broken law.

    ``make`` makes a new estimator in the same state each time, or is an estimator, which is copied.
    It refuses a step that is invalid, such as a negative ``dt``, with ValueError, and then keeps
    its belief. Any other exception of it comes through.

    The measurement is near what the estimator expects after ``step`` seconds, with a noise that is
    not small beside the belief: an angle's is 0.4 rad or less. ``quantities`` are those of the
    estimator itself, unless given.

    - An empty measurement changes nothing, nor does what a missing component (None) holds.
    - A component of a variance of 1e15 is as a missing one, to ``worthless_tolerance``; None leaves
      this law out, which an estimator with a model of outliers breaks.
    - An angle and the same angle a turn on give one posterior.
    - The covariance is symmetric and positive definite.
    - With ``predictive``: over all measurements that may come, exp(log_evidence) integrates to 1,
      the mean of the posterior means is the prior's, their covariance and the posterior's add up to
      the prior's, and the NIS averages to the number of components (unless ``nis`` is False). All
      hold to ``tolerance``, and a cloud to ``standard_errors`` of its size besides.
    """
    fresh = make if callable(make) else functools.partial(copy.deepcopy, make)
    first = fresh()
    if fresh() is first:
        raise ValueError("make returns the same estimator again; it must make a new one each time")
    if quantities is None:
        quantities = first.quantities  # type: ignore[attr-defined]
    laws = (tolerance, standard_errors, nis) if predictive else None
    _foxhunt.check_estimator(
        fresh, quantities, value, noise, receiver, heading, velocity, step, worthless_tolerance, laws
    )


def check_model(
    model: AnyModel,
    state: ArrayLike,
    value: ArrayLike,
    noise: ArrayLike,
    *,
    receiver: ArrayLike | None = None,
    heading: float | None = None,
    velocity: ArrayLike | None = None,
) -> None:
    """Checks a measurement model at one state and one measurement.

    ``expected`` is finite and does not jump round the receiver (as an angle does that is marked
    ``"linear"``), ``jacobian`` is its derivative, many states at once give what each gives alone,
    and the likelihood integrates to 1. Raises AssertionError that names the broken law.

    >>> class Bearing:
    ...     quantities = [("bearing_rad", "linear")]
    ...
    ...     def expected(self, state, receiver):
    ...         return [np.arctan2(state[1] - receiver[1], state[0] - receiver[0])]
    >>> check_model(Bearing(), [30, 40], 0.9, 0.1)
    Traceback (most recent call last):
        ...
    AssertionError: expected jumps by 6.2... on a walk round the receiver
    """
    _foxhunt.check_model(model, state, value, noise, receiver, heading, velocity)
