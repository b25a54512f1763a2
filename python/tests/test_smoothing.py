"""The smoother, held against the recursion of Rauch, Tung & Striebel in numpy."""

import copy
import pickle

import numpy as np
import pytest

import foxhunt

Q = np.kron(0.09 * np.array([[1 / 3, 1 / 2], [1 / 2, 1]]), np.eye(2))
F = np.eye(4) + np.eye(4, k=2)
PRIOR = np.diag([100.0, 100.0, 4.0, 4.0])


class Place:
    quantities = [("east_m", "linear"), ("north_m", "linear")]

    def expected(self, state, receiver):
        return state[:2]

    def jacobian(self, state, receiver):
        return np.eye(2, 4)


def run(seed, steps=15):
    """A seeded run: the true states, the filtered beliefs and the run."""
    rng = np.random.default_rng(seed)
    state = rng.multivariate_normal(np.zeros(4), PRIOR)
    motion = foxhunt.Motion.constant_velocity(0.09)
    remembering = foxhunt.Remembering(foxhunt.Ekf(motion, Place(), np.zeros(4), PRIOR), time=5.0)
    truth, filtered = [], []
    for _ in range(steps):
        state = rng.multivariate_normal(F @ state, Q)
        remembering.predict(1.0)
        remembering.update(state[:2] + rng.normal(0, 2, 2), [2.0, 2.0])
        truth.append(state)
        filtered.append(remembering.estimate())
    return truth, filtered, remembering


def test_an_ekf_is_smoothed_as_by_rauch_tung_and_striebel():
    _, filtered, remembering = run(1)
    times, smoothed = remembering.smoothed()
    np.testing.assert_array_equal(times, 6.0 + np.arange(15))
    mean, covariance = filtered[-1].mean, filtered[-1].covariance
    for k in range(13, -1, -1):
        before = filtered[k]
        predicted = F @ before.covariance @ F.T + Q
        gain = before.covariance @ F.T @ np.linalg.inv(predicted)
        mean = before.mean + gain @ (mean - F @ before.mean)
        covariance = before.covariance + gain @ (covariance - predicted) @ gain.T
        np.testing.assert_allclose(smoothed[k].estimate().mean, mean, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(smoothed[k].estimate().covariance, covariance, atol=1e-9)


def test_a_smoothed_belief_is_consistent_and_better():
    nees, before, after = [], [], []
    for seed in range(200):
        truth, filtered, remembering = run(seed)
        smoothed = remembering.smoothed()[1][4]
        nees.append(smoothed.nees(truth[4]))
        before.append(np.linalg.norm(filtered[4].mean[:2] - truth[4][:2]))
        after.append(np.linalg.norm(smoothed.estimate().mean[:2] - truth[4][:2]))
    judged = foxhunt.consistency(nees, 4, probability=0.99)
    assert judged.verdict == "consistent", judged
    assert np.mean(after) < 0.9 * np.mean(before)


@pytest.mark.parametrize(
    ("kind", "size"), [(foxhunt.ParticleFilter, {"particles": 300}), (foxhunt.GridFilter, {})]
)
def test_clouds_and_cells_are_smoothed_too(kind, size):
    model = foxhunt.Model.bearing()
    other = kind(foxhunt.Motion.random_walk(0.5), model, [20, 10], 100 * np.eye(2), **size)
    remembering = foxhunt.Remembering(other)
    for east in range(0, 60, 6):
        remembering.predict(1.0)
        remembering.update(np.arctan2(15, 25 - east), 0.05, receiver=(east, 0))
    first = remembering.smoothed()[1][0]
    assert first.nees([25, 15]) < 13.8
    assert first.samples()[1].sum() == pytest.approx(1.0)


def test_a_smoother_refuses_what_did_not_go_on_from_it():
    ekf = run(1)[2].estimator
    before = ekf.estimate().mean
    ukf = foxhunt.Ukf(foxhunt.Motion.random_walk(0.1), Place(), np.zeros(4), PRIOR)
    small = foxhunt.Ekf(foxhunt.Motion.random_walk(0.1), Place(), np.zeros(2), np.eye(2))
    for later, dt, text in [
        (ukf, 1.0, "another kind or size"),
        (small, 1.0, "another kind or size"),
        (ekf, 1.0, "by itself"),
        (copy.copy(ekf), -1.0, "time step"),
    ]:
        with pytest.raises(ValueError, match=text):
            ekf.smooth(later, dt)
    np.testing.assert_array_equal(ekf.estimate().mean, before)
    later = copy.copy(ekf)
    later.predict(1.0)
    ekf.smooth(later, 1.0)
    np.testing.assert_allclose(ekf.estimate().mean, before, atol=1e-9)
    with pytest.raises(ValueError, match="was smoothed"):
        pickle.dumps(ekf)
    grid = foxhunt.GridFilter(foxhunt.Motion.random_walk(0.1), Place(), np.zeros(3), np.eye(3))
    with pytest.raises(ValueError, match="smoothing cells"):
        grid.smooth(copy.copy(grid), 1.0)


def test_a_motion_s_own_jacobian_is_used():
    class Moving:
        slope = F

        def propagate(self, state, dt):
            return F @ state

        def noise_factor(self, state, dt):
            return np.linalg.cholesky(Q)

        def jacobian(self, state, dt):
            return self.slope

    ours, own = (
        foxhunt.Ekf(motion, Place(), np.zeros(4), PRIOR)
        for motion in (foxhunt.Motion.constant_velocity(0.09), Moving())
    )
    ours.predict(1.0)
    own.predict(1.0)
    np.testing.assert_allclose(own.estimate().covariance, ours.estimate().covariance, atol=1e-9)
    Moving.slope = np.eye(4)
    own.predict(1.0)
    expected = ours.estimate().covariance + Q
    np.testing.assert_allclose(own.estimate().covariance, expected, atol=1e-9)
