"""Recursive estimators of a transmitter's place.

All of them take a motion, a measurement model and a Gaussian prior, and have the methods of
:class:`Estimator`: ``predict(dt)``, ``update(value, noise, receiver=...)`` and ``estimate()``.

Motion and model are the library's (:class:`foxhunt.Motion`, :class:`foxhunt.Model`) or objects of
your own. A model has ``quantities``, pairs of a name and ``"linear"`` or ``"angle"``, and
``expected(state, receiver)``; a motion has ``propagate(state, dt)`` and ``noise_factor(state,
dt)``, whose product with its own transpose is the covariance of the noise. Either may have
``jacobian``, with the arguments of ``expected`` and ``propagate``; the :class:`Ekf` and smoothers
take differences without one. The receiver is a
:class:`foxhunt.Pose`: an array of East, North and Up that has a heading and, where known, a
velocity.

Those of your own are called for each sigma point or particle, unless the class has ``vectorized =
True``: clouds then call it once for hundreds of states, one a row. ``state[..., 0]`` serves both; a
noise factor may be one matrix for all states.

Estimators can be pickled and copied. A pickle holds the arguments and the steps, up to 100 000,
which are taken again when it is read; a copy has the belief, and shares motion and model. Motion
and model must therefore not change: reading such a pickle raises ValueError.

>>> class GroundRange:
...     quantities = [("range_m", "linear")]
...
...     def expected(self, state, receiver):
...         return [np.hypot(*(state[:2] - receiver[:2]))]
>>> import numpy as np
>>> ckf = Ckf(Motion.random_walk(0.0), GroundRange(), [50, 10], 400 * np.eye(2), iterations=10)
>>> for receiver in [(0, 0, 0), (60, 0, 0), (0, 60, 0), (60, 60, 0)] * 3:
...     truth = np.hypot(receiver[0] - 30, receiver[1] - 40)
...     _ = ckf.update([truth], [0.1], receiver=receiver)
>>> np.round(ckf.estimate().mean).tolist()
[30.0, 40.0]

>>> class Range:
...     quantities = [("range_m", "linear")]
...     vectorized = True
...
...     def expected(self, state, receiver):
...         return np.hypot(state[..., 0] - receiver[0], state[..., 1] - receiver[1])
>>> cloud = ParticleFilter(Motion.random_walk(0.1), Range(), [50, 10], 400 * np.eye(2), seed=2)
>>> for receiver in [(0, 0), (60, 0), (0, 60), (60, 60)] * 3:
...     _ = cloud.update(np.hypot(receiver[0] - 30, receiver[1] - 40), 1.0, receiver=receiver)
>>> bool(cloud.nees([30, 40]) < 13.8)
True
"""

from __future__ import annotations

import copy
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ._foxhunt import Correction, Estimate, Estimator, Model, Motion

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from ._foxhunt import AnyModel, AnyMotion

__all__ = [
    "Ckf",
    "Ekf",
    "Estimator",
    "GridFilter",
    "Model",
    "Motion",
    "ParticleFilter",
    "Remembering",
    "Ukf",
]

#: Where foxhunt takes what filterpy's attributes hold.
_OF_FILTERPY = {
    "x": "its belief is given when it is made, and changed by `predict` and `update`",
    "P": "its belief is given when it is made, and changed by `predict` and `update`",
    "F": "its motion is given when it is made",
    "Q": "its motion is given when it is made, with its noise",
    "H": "its model is given when it is made",
    "R": "the noise of a measurement is given to `update`",
}


def _made(cls: Any, method: str, keywords: dict[str, Any]) -> Any:
    """Makes a motion or a model of a pickle."""
    return getattr(cls, method)(**keywords)


def _made_again(
    cls: type[Estimator],
    positional: tuple[Any, ...],
    keywords: dict[str, Any],
    steps: list[Any],
    own: dict[str, Any] | None,
    stored: Estimate | None = None,
) -> Estimator:
    """Makes an estimator of a pickle: from its arguments, by the steps that it took."""
    estimator = Estimator.__new__(cls, *positional, **keywords)
    if own:
        estimator.__dict__.update(own)
    estimator._take(steps)
    if stored is not None:
        made = estimator.estimate()
        sigma = np.sqrt(np.diag(stored.covariance))
        mean = np.abs(made.mean - stored.mean) / sigma
        covariance = np.abs(made.covariance - stored.covariance) / np.outer(sigma, sigma)
        # Another machine may round otherwise.
        if not max(mean.max(), covariance.max()) < 1e-6:
            raise ValueError(
                f"the steps of the pickled {cls.__name__} do not lead to its belief: its motion or "
                "its model was changed between two steps; send estimate() instead"
            )
    return estimator


def _copied(
    original: Estimator,
    positional: tuple[Any, ...],
    keywords: dict[str, Any],
    own: dict[str, Any] | None,
) -> Estimator:
    """Makes an estimator with the belief of another one."""
    estimator = _made_again(type(original), positional, keywords, [], own)
    estimator._take_over(original)
    return estimator


class Remembering:
    """An estimator that keeps a copy of itself after the updates of each time, to be smoothed.

    ``time`` in seconds is that of the estimator's belief; :meth:`predict` counts from there.

    >>> ekf = Ekf(Motion.random_walk(0.1), Model.bearing(), [50, 10], 400 * np.eye(2))
    >>> run = Remembering(ekf)
    >>> for step in range(20):
    ...     run.predict(1.0)
    ...     _ = run.update(np.arctan2(40, 30 - 3 * step), 0.02, receiver=(3 * step, 0))
    >>> times, smoothed = run.smoothed()
    >>> len(times), bool(smoothed[0].nees([30, 40]) < 13.8)
    (20, True)
    """

    def __init__(self, estimator: Estimator, time: float = 0.0) -> None:
        self.estimator = estimator
        self.time = time
        self._run: list[tuple[float, Estimator]] = []

    def predict(self, dt: float) -> None:
        """Carries the belief ``dt`` seconds forward."""
        self.estimator.predict(dt)
        self.time += dt

    def update(
        self,
        value: float | Sequence[float | None] | NDArray[np.float64],
        noise: ArrayLike,
        **receiver: Any,
    ) -> Correction:
        """Conditions the belief on a measurement; arguments as those of ``Estimator.update``."""
        correction = self.estimator.update(value, noise, **receiver)
        # Measurements of one time are one step.
        if self._run and self._run[-1][0] >= self.time:
            self._run.pop()
        self._run.append((self.time, self.estimator._remembered()))
        return correction

    def estimate(self) -> Estimate:
        """The mean and the covariance of the belief now."""
        return self.estimator.estimate()

    def smoothed(self) -> tuple[NDArray[np.float64], list[Estimator]]:
        """The times in seconds, and for each time an estimator with the belief given all
        measurements.

        Raises ValueError where there is no smoother: for a :class:`GridFilter` whose state holds
        more than a place, or whose motion carries the place along.
        """
        run = [copy.copy(estimator) for _, estimator in self._run]
        times = np.array([time for time, _ in self._run])
        for k in range(len(run) - 1, 0, -1):
            run[k - 1].smooth(run[k], times[k] - times[k - 1])
        return times, run


class _Settled(Estimator):
    """An estimator that has no attributes of filterpy's names: to set one would change nothing.

    Classes of others that inherit from it may have them.
    """

    def __setattr__(self, name: str, value: object) -> None:
        if name in _OF_FILTERPY and type(self).__module__ == __name__:
            raise AttributeError(f"{type(self).__name__} has no {name}: {_OF_FILTERPY[name]}")
        super().__setattr__(name, value)


class Ekf(_Settled):
    """Extended Kalman filter: linear about its mean (Bar-Shalom, Li & Kirubarajan 2001, 10.3).

    ``gate`` is the probability that a good measurement passes; all pass without one. With
    ``iterations`` above 1 each update is linearised again about its posterior (Bell & Cathey 1993).
    """

    def __new__(
        cls,
        motion: AnyMotion,
        model: AnyModel,
        mean: ArrayLike,
        covariance: ArrayLike,
        *,
        gate: float | None = None,
        iterations: int = 1,
    ) -> Ekf:
        return super().__new__(
            cls, "ekf", motion, model, mean, covariance, gate=gate, iterations=iterations
        )


class Ukf(_Settled):
    """Unscented Kalman filter (Julier & Uhlmann 2004; Wan & van der Merwe 2000).

    Sigma points are redrawn for every update. ``gate`` and ``iterations`` as in :class:`Ekf`.
    """

    def __new__(
        cls,
        motion: AnyMotion,
        model: AnyModel,
        mean: ArrayLike,
        covariance: ArrayLike,
        *,
        alpha: float = 1.0,
        beta: float = 2.0,
        kappa: float = 0.0,
        gate: float | None = None,
        iterations: int = 1,
    ) -> Ukf:
        return super().__new__(
            cls,
            "ukf",
            motion,
            model,
            mean,
            covariance,
            alpha=alpha,
            beta=beta,
            kappa=kappa,
            gate=gate,
            iterations=iterations,
        )


class Ckf(_Settled):
    """Cubature Kalman filter (Arasaratnam & Haykin 2009).

    ``gate`` and ``iterations`` as in :class:`Ekf`; iterated, it is iterated posterior linearisation
    (García-Fernández, Svensson, Morelande & Särkkä 2015).
    """

    def __new__(
        cls,
        motion: AnyMotion,
        model: AnyModel,
        mean: ArrayLike,
        covariance: ArrayLike,
        *,
        gate: float | None = None,
        iterations: int = 1,
    ) -> Ckf:
        return super().__new__(
            cls, "ckf", motion, model, mean, covariance, gate=gate, iterations=iterations
        )


class ParticleFilter(_Settled):
    """Particle filter, regularised systematic resampling (Gordon, Salmond & Smith 1993; Liu & West
    2001). The same seed gives the same result, on any number of threads.
    """

    def __new__(
        cls,
        motion: AnyMotion,
        model: AnyModel,
        mean: ArrayLike,
        covariance: ArrayLike,
        *,
        particles: int = 2000,
        seed: int = 1,
    ) -> ParticleFilter:
        return super().__new__(
            cls, "particle", motion, model, mean, covariance, particles=particles, seed=seed
        )


class GridFilter(_Settled):
    """Recursive Bayes over cells that follow the belief, ``side`` to each side (Bucy & Senne 1971).

    What the state holds besides East and North is a Gaussian in each cell.
    """

    def __new__(
        cls,
        motion: AnyMotion,
        model: AnyModel,
        mean: ArrayLike,
        covariance: ArrayLike,
        *,
        side: int = 64,
    ) -> GridFilter:
        return super().__new__(cls, "grid", motion, model, mean, covariance, side=side)
