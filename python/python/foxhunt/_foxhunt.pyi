from os import PathLike
from typing import Callable, Protocol, Self, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .poses import Pose

__version__: str

class MotionLike(Protocol):
    """A motion of your own. With ``vectorized = True`` it is given many states, one a row, too.
    ``jacobian(state, dt)`` is used if there is one."""

    def propagate(self, state: NDArray[np.float64], dt: float) -> ArrayLike: ...
    def noise_factor(self, state: NDArray[np.float64], dt: float) -> ArrayLike: ...

class ModelLike(Protocol):
    """A measurement model of your own. With ``vectorized = True`` it is given many states, one a
    row, too, and returns a row for each. ``jacobian(state, receiver)`` is used if there is one."""

    @property
    def quantities(self) -> Sequence[tuple[str, str]]: ...
    def expected(self, state: NDArray[np.float64], receiver: Pose) -> ArrayLike: ...

class Motion:
    """A motion of the library."""

    @staticmethod
    def random_walk(drift: float | Sequence[float]) -> Motion: ...
    @staticmethod
    def constant_velocity(spectral_density: float) -> Motion: ...
    @staticmethod
    def coordinated_turn(spectral_density: float, turn_rate_drift: float) -> Motion: ...

class Model:
    """A measurement model of the library."""

    @staticmethod
    def rss(reference_dbm: float, exponent: float, *, target_up: float = 0.0) -> Model: ...
    @staticmethod
    def bearing() -> Model: ...
    @staticmethod
    def rss_bearing(reference_dbm: float, exponent: float, *, target_up: float = 0.0) -> Model: ...
    @staticmethod
    def free_power(exponent: float, *, target_up: float = 0.0) -> Model: ...
    @staticmethod
    def free_path_loss(*, target_up: float = 0.0) -> Model: ...
    @staticmethod
    def range_difference(reference: ArrayLike, *, target_up: float = 0.0) -> Model: ...
    @property
    def quantities(self) -> list[tuple[str, str]]: ...

AnyMotion = Motion | MotionLike
AnyModel = Model | ModelLike

class Estimate:
    def __init__(self, mean: NDArray[np.float64], covariance: NDArray[np.float64]) -> None: ...
    @property
    def mean(self) -> NDArray[np.float64]: ...
    @property
    def covariance(self) -> NDArray[np.float64]: ...

class Correction:
    def __init__(
        self,
        rejected: bool,
        nis: float | None = None,
        log_evidence: float | None = None,
        effective_sample_size: float | None = None,
    ) -> None: ...
    @property
    def rejected(self) -> bool: ...
    @property
    def nis(self) -> float | None: ...
    @property
    def log_evidence(self) -> float | None: ...
    @property
    def effective_sample_size(self) -> float | None: ...

class Innovation:
    def __init__(
        self,
        residual: NDArray[np.float64],
        expected: NDArray[np.float64],
        covariance: NDArray[np.float64],
        nis: float,
        normalised: NDArray[np.float64],
    ) -> None: ...
    @property
    def residual(self) -> NDArray[np.float64]: ...
    @property
    def expected(self) -> NDArray[np.float64]: ...
    @property
    def covariance(self) -> NDArray[np.float64]: ...
    @property
    def nis(self) -> float: ...
    @property
    def normalised(self) -> NDArray[np.float64]: ...

class Estimator:
    def __new__(
        cls,
        kind: str,
        motion: AnyMotion,
        model: AnyModel,
        mean: ArrayLike,
        covariance: ArrayLike,
        *,
        gate: float | None = None,
        iterations: int = 1,
        alpha: float = 1.0,
        beta: float = 2.0,
        kappa: float = 0.0,
        particles: int = 2000,
        side: int = 64,
        seed: int = 1,
    ) -> Self: ...
    def predict(self, dt: float) -> None: ...
    def update(
        self,
        value: float | Sequence[float | None] | NDArray[np.float64],
        noise: ArrayLike,
        *,
        receiver: ArrayLike | None = None,
        heading: float | None = None,
        velocity: ArrayLike | None = None,
        time: float = 0.0,
    ) -> Correction: ...
    def innovation(
        self,
        value: float | Sequence[float | None] | NDArray[np.float64],
        noise: ArrayLike,
        *,
        receiver: ArrayLike | None = None,
        heading: float | None = None,
        velocity: ArrayLike | None = None,
        time: float = 0.0,
    ) -> Innovation | None: ...
    def smooth(self, later: Estimator, dt: float) -> None: ...
    @property
    def quantities(self) -> Sequence[tuple[str, str]]: ...
    def estimate(self) -> Estimate: ...
    def samples(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]: ...
    def nees(self, truth: ArrayLike) -> float | None: ...
    def ellipse(self, probability: float = 0.95) -> tuple[float, float, float] | None: ...

    def __copy__(self) -> Self: ...
    def __deepcopy__(self, memo: object) -> Self: ...
    def _take(self, steps: list[object]) -> None: ...
    def _remembered(self) -> Self: ...
    def _take_over(self, other: Estimator) -> None: ...

def check_estimator(
    make: Callable[[], object],
    pairs: Sequence[tuple[str, str]],
    value: ArrayLike,
    noise: ArrayLike,
    receiver: ArrayLike | None,
    heading: float | None,
    velocity: ArrayLike | None,
    step: float,
    worthless_tolerance: float | None,
    predictive: tuple[float, float, bool] | None,
) -> None: ...
def check_event(kind: str) -> None: ...
def check_model(
    object: AnyModel,
    state: ArrayLike,
    value: ArrayLike,
    noise: ArrayLike,
    receiver: ArrayLike | None,
    heading: float | None,
    velocity: ArrayLike | None,
) -> None: ...
def commands_json() -> str: ...
def judge_squares(
    squares: list[float], degrees_of_freedom: list[int], probability: float
) -> tuple[float, float, tuple[float, float], str]: ...
def judge_whiteness(
    runs: list[NDArray[np.float64]], lags: int
) -> tuple[float, int, float, list[tuple[int, float, float]]]: ...
def places_at(beacon: str, times: list[float]) -> NDArray[np.float64] | None: ...
def run_json(
    arguments: Sequence[str | PathLike[str]], heard: list[str] | None = None
) -> str: ...
