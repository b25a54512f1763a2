"""The laws hold for the library's estimators, and name what a wrong one breaks."""

import numpy as np
import pytest

import foxhunt
from foxhunt import laws

BELIEF = ([30.0, 10.0], [[1.0, 0.2], [0.2, 0.8]])


class Kalman:
    """A Kalman filter for bearings by numpy, with a mistake of each kind that a subclass makes."""

    quantities = [("bearing_rad", "angle")]

    def __init__(self):
        self.mean, self.covariance = (np.array(part) for part in BELIEF)

    def predict(self, dt):
        if not 0 <= dt < np.inf:
            raise ValueError(f"dt is {dt}")
        self.covariance = self.covariance + 0.01 * dt * np.eye(2)

    def wrapped(self, angle):
        return np.mod(angle + np.pi, 2 * np.pi) - np.pi

    def update(self, value, noise):
        if value[0] is None:
            return None
        east, north = self.mean
        slope = np.array([-north, east]) / (east**2 + north**2)
        spread = slope @ self.covariance @ slope + noise[0, 0]
        innovation = self.wrapped(value[0] - np.arctan2(north, east))
        nis = innovation**2 / spread
        gain = self.covariance @ slope / spread
        self.mean = self.mean + gain * innovation
        self.covariance = self.covariance - spread * np.outer(gain, gain)
        return foxhunt.Correction(False, nis, -0.5 * (nis + np.log(2 * np.pi * spread)))

    def estimate(self):
        return foxhunt.Estimate(self.mean, self.covariance)


class Evidence(Kalman):
    def update(self, value, noise):
        made = super().update(value, noise)
        return made and foxhunt.Correction(False, made.nis, made.log_evidence + 1)


class Nis(Kalman):
    def update(self, value, noise):
        made = super().update(value, noise)
        return made and foxhunt.Correction(False, made.nis / 2, made.log_evidence)


class Unwrapped(Kalman):
    def wrapped(self, angle):
        return angle


class Growing(Kalman):
    def update(self, value, noise):
        made = super().update(value, noise)
        self.covariance = self.covariance * (1.1 if made else 1.0)
        return made


class Backwards(Kalman):
    def predict(self, dt):
        self.covariance = self.covariance + 0.01 * abs(dt) * np.eye(2)


@pytest.mark.parametrize(
    "kind",
    [foxhunt.Ekf, foxhunt.Ukf, foxhunt.Ckf, foxhunt.ParticleFilter, foxhunt.GridFilter],
)
def test_the_library_s_estimators_keep_the_laws(kind):
    model = foxhunt.Model.bearing()
    laws.check(lambda: kind(foxhunt.Motion.random_walk(0.1), model, *BELIEF), 0.3, 0.1)


@pytest.mark.parametrize("kind", [foxhunt.Ekf, foxhunt.Ukf])
def test_two_components_and_a_receiver(kind):
    ekf = kind(foxhunt.Motion.random_walk(0.1), foxhunt.Model.rss_bearing(-29, 2.7), *BELIEF)
    laws.check(ekf, [-66.0, 0.4], [6.0, 0.3], receiver=(3, -2, 4))


def test_a_filter_of_python_keeps_the_laws():
    laws.check(Kalman, 0.3, 0.1)
    laws.check(Kalman(), 0.3, 0.1, quantities=[("bearing_rad", "angle")])


@pytest.mark.parametrize(
    ("wrong", "text"),
    [
        (Evidence, r"exp\(log_evidence\) integrates to 2.718"),
        (Nis, r"E\[NIS\] is 0.5"),
        (Unwrapped, "plus -1 turns gives another posterior"),
        (Growing, r"E\[P⁺\] \+ Var\[m⁺\] is off"),
        (Backwards, "a step of -1 s was accepted"),
    ],
)
def test_a_breach_is_named_and_not_printed(wrong, text, capfd):
    with pytest.raises(AssertionError, match=f"^{wrong.__name__}: .*{text}"):
        laws.check(wrong, 0.3, 0.1, worthless_tolerance=None)
    assert capfd.readouterr() == ("", "")


def test_mistakes_come_through():
    class Broken(Kalman):
        def estimate(self):
            raise KeyError("no belief")

    class Refusing(Kalman):
        def predict(self, dt):
            np.zeros(3) @ np.zeros(4)

    class Careless(Kalman):
        def update(self, value, noise):
            return super().update([value[0] or 0.3], noise)

    one = Kalman()
    with pytest.raises(AssertionError, match="Refusing: a step of 1 s was refused") as caught:
        laws.check(Refusing, 0.3, 0.1)
    assert "matmul" in str(caught.value.__cause__)
    with pytest.raises(AssertionError, match="Careless: an observation without components"):
        laws.check(Careless, 0.3, 0.1)
    with pytest.raises(KeyError, match="no belief"):
        laws.check(Broken, 0.3, 0.1)
    with pytest.raises(ValueError, match="same estimator again"):
        laws.check(lambda: one, 0.3, 0.1)
    with pytest.raises(ValueError, match="value is"):
        laws.check(Kalman, [0.3, 0.2], 0.1)


class Range:
    quantities = [("range_m", "linear")]
    vectorized = True
    slope = 1.0

    def expected(self, state, receiver):
        return np.hypot(state[..., 0] - receiver[0], state[..., 1] - receiver[1])

    def jacobian(self, state, receiver):
        way = state[:2] - receiver[:2]
        return self.slope * way[None] / np.hypot(*way)


def test_models_keep_the_laws_and_a_wrong_derivative_is_used_and_found():
    laws.check_model(foxhunt.Model.bearing(), [30, 10], 0.3, 0.1)
    model = Range()
    laws.check_model(model, [30, 10], 31.0, 1.0, receiver=(1, 2))
    model.slope = 1.001
    with pytest.raises(AssertionError, match="the jacobian is off"):
        laws.check_model(model, [30, 10], 31.0, 1.0, receiver=(1, 2))
    model.jacobian = lambda state, receiver: np.full((1, 2), "steep")
    with pytest.raises(ValueError, match="what jacobian returns"):
        laws.check_model(model, [30, 10], 31.0, 1.0)
    ekf = foxhunt.Ekf(foxhunt.Motion.random_walk(0.1), model, *BELIEF)
    with pytest.raises(ValueError, match="what jacobian returns"):
        ekf.update(31.0, 1.0)
