"""Estimators, held against filterpy and against numpy's own linear algebra."""

import copy
import pickle

import numpy as np
import pytest
from filterpy.kalman import KalmanFilter, MerweScaledSigmaPoints, UnscentedKalmanFilter

import foxhunt


class Linear:
    """A linear measurement of the place, for states of any size."""

    quantities = [("east_m", "linear"), ("north_m", "linear")]

    def expected(self, state, receiver):
        return state[:2] - receiver[:2]


class ConstantVelocity:
    """Motion.constant_velocity, written in Python."""

    def __init__(self, spectral_density):
        self.spectral_density = spectral_density

    def propagate(self, state, dt):
        return np.concatenate([state[:2] + dt * state[2:], state[2:]])

    def noise_factor(self, state, dt):
        axis = self.spectral_density * np.array([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]])
        return np.linalg.cholesky(np.kron(axis, np.eye(2)) + 1e-12 * np.eye(4))


def measurements(steps=20, seed=3):
    rng = np.random.default_rng(seed)
    state = np.array([0.0, 5.0, 1.0, -0.5])
    for _ in range(steps):
        state = np.concatenate([state[:2] + state[2:], state[2:]])
        yield state[:2] + rng.normal(0, 2, 2)


@pytest.mark.parametrize("kind", [foxhunt.Ekf, foxhunt.Ukf, foxhunt.Ckf])
@pytest.mark.parametrize("motion", [foxhunt.Motion.constant_velocity(0.09), ConstantVelocity(0.09)])
def test_kalman_filters_equal_filterpy_on_a_linear_problem(kind, motion):
    ours = kind(motion, Linear(), np.zeros(4), np.diag([100, 100, 4, 4]))
    peer = KalmanFilter(dim_x=4, dim_z=2)
    peer.P = np.diag([100.0, 100.0, 4.0, 4.0])
    peer.F = np.eye(4) + np.eye(4, k=2)
    peer.H, peer.R = np.eye(2, 4), 4.0 * np.eye(2)
    peer.Q = np.kron(0.09 * np.array([[1 / 3, 1 / 2], [1 / 2, 1]]), np.eye(2))
    for value in measurements():
        ours.predict(1.0)
        peer.predict()
        innovation = ours.innovation(value, [2.0, 2.0])
        correction = ours.update(value, [2.0, 2.0])
        peer.update(value)
        nis = peer.y.T @ peer.SI @ peer.y
        np.testing.assert_allclose(innovation.residual, peer.y.ravel(), atol=1e-6)
        np.testing.assert_allclose(innovation.covariance, peer.S, atol=1e-6)
        assert innovation.nis == correction.nis
        assert innovation.normalised @ innovation.normalised == pytest.approx(innovation.nis)
        assert correction.nis == pytest.approx(nis.item(), rel=1e-6)
        assert correction.log_evidence == pytest.approx(peer.log_likelihood, rel=1e-6)
    estimate = ours.estimate()
    np.testing.assert_allclose(estimate.mean, peer.x.ravel(), atol=1e-6)
    np.testing.assert_allclose(estimate.covariance, peer.P, atol=1e-6)


def test_sigma_points_equal_filterpy():
    place = np.array([20.0, 30.0])
    receivers = np.random.default_rng(5).uniform(-50, 50, (15, 2))

    def level(state, receiver=None):
        return np.array([-29.06 - 27.65 * np.log10(np.linalg.norm([*(state - receiver), 4.0]))])

    points = MerweScaledSigmaPoints(2, alpha=0.5, beta=2.0, kappa=1.0)
    peer = UnscentedKalmanFilter(2, 1, 1.0, level, lambda x, dt: x, points)
    peer.x, peer.P, peer.R, peer.Q = np.zeros(2), 400 * np.eye(2), 36 * np.eye(1), 0 * np.eye(2)
    ours = foxhunt.Ukf(
        foxhunt.Motion.random_walk(0.0),
        foxhunt.Model.rss(-29.06, 2.765),
        [0, 0],
        400 * np.eye(2),
        alpha=0.5,
        kappa=1.0,
    )
    for receiver in receivers:
        value = level(place, receiver)
        # The peer draws its points in predict alone.
        peer.predict()
        peer.update(value, receiver=receiver)
        ours.update(value, [6.0], receiver=(*receiver, 4.0))
        np.testing.assert_allclose(ours.estimate().mean, peer.x, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(ours.estimate().covariance, peer.P, rtol=1e-8, atol=1e-9)


@pytest.mark.parametrize("kind", [foxhunt.GridFilter, foxhunt.ParticleFilter])
def test_wide_beliefs_find_the_place(kind):
    model = foxhunt.Model.rss_bearing(-29.06, 2.765)
    estimator = kind(foxhunt.Motion.random_walk(0.02), model, [0, 0], 2500 * np.eye(2))
    rng = np.random.default_rng(8)
    for east, north in rng.uniform(-40, 40, (40, 2)):
        way = np.array([12.0 - east, -7.0 - north])
        level = -29.06 - 27.65 * np.log10(np.linalg.norm([*way, 4.0])) + rng.normal(0, 4)
        bearing = np.arctan2(way[1], way[0]) + rng.normal(0, 0.2)
        estimator.predict(1.0)
        estimator.update([level, bearing], [4.0, 0.2], receiver=(east, north, 4.0))
    # The 99.9 % quantile of chi-squared with 2 degrees, of a seeded run.
    assert estimator.nees([12.0, -7.0]) < 13.8
    states, weights = estimator.samples()
    assert weights.sum() == pytest.approx(1.0)
    np.testing.assert_allclose(weights @ states, estimator.estimate().mean, atol=1e-6)
    major, minor, _ = estimator.ellipse()
    assert 0 < minor <= major < 10


def test_a_model_of_python_is_the_library_s_to_rounding():
    class Bearing:
        quantities = [("bearing_rad", "angle")]

        def expected(self, state, receiver):
            return [np.arctan2(state[1] - receiver[1], state[0] - receiver[0])]

    def run(model):
        filter = foxhunt.Ukf(foxhunt.Motion.random_walk(0.1), model, [-30, 1], 25 * np.eye(2))
        for step in range(12):
            filter.predict(1.0)
            # Across the direction where angles wrap.
            filter.update([np.pi - 0.05 + 0.1 * (step % 2)], [0.1], receiver=(5 * step, 0, 0))
        return filter.estimate()

    ours, own = run(foxhunt.Model.bearing()), run(Bearing())
    np.testing.assert_allclose(own.mean, ours.mean, atol=1e-9)
    np.testing.assert_allclose(own.covariance, ours.covariance, atol=1e-9)


def test_missing_components_change_nothing_of_theirs():
    model = foxhunt.Model.rss_bearing(-29.06, 2.765)
    prior = ([10, 3], [[30, 2], [2, 20]])
    both = foxhunt.Ckf(foxhunt.Motion.random_walk(0.0), model, *prior)
    alone = foxhunt.Ckf(foxhunt.Motion.random_walk(0.0), foxhunt.Model.bearing(), *prior)
    both.update([None, 0.4], [6.0, 0.3])
    alone.update([0.4], [0.3])
    np.testing.assert_allclose(both.estimate().mean, alone.estimate().mean, atol=1e-12)


def test_power_is_estimated_where_it_is_not_known():
    model = foxhunt.Model.free_power(2.765)
    grid = foxhunt.Ckf(
        foxhunt.Motion.random_walk([0.0, 0.0, 0.0]), model, [5, 5, -40], np.diag([400, 400, 100])
    )
    for east, north in np.random.default_rng(2).uniform(-40, 40, (60, 2)):
        way = np.array([12.0 - east, -7.0 - north])
        level = -32.0 - 27.65 * np.log10(np.hypot(*way))
        bearing = np.arctan2(way[1], way[0])
        grid.update([level, bearing], [2.0, 0.1], receiver=(east, north, 0.0))
    assert grid.estimate().mean[2] == pytest.approx(-32.0, abs=1.0)


@pytest.mark.parametrize(
    ("wrong", "text"),
    [
        (lambda m: foxhunt.Ekf(m, foxhunt.Model.bearing(), [0, 0], np.eye(3)), "covariance"),
        (lambda m: foxhunt.Ekf(m, foxhunt.Model.bearing(), [0, 0], -np.eye(2)), "prior"),
        (lambda m: foxhunt.Ekf(m, foxhunt.Model.bearing(), [0], np.eye(1)), "2 or more"),
        (lambda m: foxhunt.Ekf(m, foxhunt.Model.bearing(), [0, 0], np.eye(2), gate=1.5), "1.5"),
        (lambda m: foxhunt.Model.rss(-30.0, -1.0), "exponent"),
        (lambda m: foxhunt.Ukf(m, foxhunt.Model.free_power(2.0), [0, 0], np.eye(2)), "2"),
        (lambda m: foxhunt.Motion.random_walk(-1.0), "drift"),
    ],
)
def test_wrong_use_is_named(wrong, text):
    motion = foxhunt.Motion.random_walk(0.02)
    with pytest.raises(ValueError, match=text):
        wrong(motion)


@pytest.mark.parametrize("name", ["x", "P", "F", "Q", "H", "R"])
def test_attributes_of_filterpy_are_refused(name):
    arguments = (foxhunt.Motion.random_walk(0.1), foxhunt.Model.bearing(), [9, 1], np.eye(2))
    with pytest.raises(AttributeError, match=f"Ukf has no {name}: .* is given"):
        setattr(foxhunt.Ukf(*arguments), name, np.eye(2))
    mine = type("Mine", (foxhunt.Ukf,), {})(*arguments)
    setattr(mine, name, 1)
    assert getattr(mine, name) == 1


@pytest.mark.parametrize(
    ("value", "noise"),
    [
        ([np.nan], [0.1]),
        ([0.1], [0.0]),
        ([0.1], [-0.1]),
        ([0.1, 0.2], [0.1]),
        ([0.1], [-1.0, 2]),
    ],
)
def test_a_refused_step_leaves_the_belief(value, noise):
    ekf = foxhunt.Ekf(foxhunt.Motion.random_walk(0.1), foxhunt.Model.bearing(), [9, 1], np.eye(2))
    before = ekf.estimate()
    with pytest.raises(ValueError):
        ekf.update(value, noise)
    with pytest.raises(ValueError, match="time step"):
        ekf.predict(-1.0)
    np.testing.assert_array_equal(ekf.estimate().mean, before.mean)
    np.testing.assert_array_equal(ekf.estimate().covariance, before.covariance)


@pytest.mark.parametrize(
    "kind", [foxhunt.Ekf, foxhunt.Ukf, foxhunt.ParticleFilter, foxhunt.GridFilter]
)
def test_exceptions_of_a_model_come_through(kind):
    class Broken:
        quantities = [("range_m", "linear")]
        broken = False

        def expected(self, state, receiver):
            if self.broken:
                raise KeyError("a table without this place")
            return [np.hypot(*state[:2])]

    model = Broken()
    estimator = kind(foxhunt.Motion.random_walk(0.1), model, [9, 1], np.eye(2))
    estimator.update([9.0], [1.0])
    before = estimator.estimate()
    model.broken = True
    with pytest.raises(KeyError, match="a table"):
        estimator.update([9.0], [1.0])
    np.testing.assert_array_equal(estimator.estimate().mean, before.mean)
    model.broken = False
    estimator.update([9.0], [1.0])


class Mixed:
    """Five linear measurements of twelve components."""

    quantities = [(f"sum_{row}", "linear") for row in range(5)]
    matrix = np.random.default_rng(7).normal(size=(5, 12))

    def expected(self, state, receiver):
        return self.matrix @ state


class OfOne:
    """The distance between two of many components."""

    quantities = [("apart_m", "linear")]

    def __init__(self, first, second, whole):
        self.first, self.second = (first, second) if whole else (0, 1)
        if not whole:
            self.components = [first, second]

    def expected(self, state, receiver):
        return state[self.first] - state[self.second]


@pytest.mark.parametrize("kind", [foxhunt.Ekf, foxhunt.Ukf, foxhunt.Ckf])
def test_states_of_any_size_equal_the_kalman_filter_of_numpy(kind):
    rng = np.random.default_rng(11)
    drift = rng.uniform(0.1, 1.0, 12)
    mean, covariance = rng.normal(size=12), np.diag(rng.uniform(1.0, 4.0, 12))
    ours = kind(foxhunt.Motion.random_walk(drift), Mixed(), mean, covariance)
    truth = mean + np.linalg.cholesky(covariance) @ rng.normal(size=12)
    h, r = Mixed.matrix, np.diag([0.25] * 5)
    for step in range(6):
        ours.predict(2.0)
        covariance = covariance + np.diag(drift**2 * 2.0)
        value = h @ truth + 0.5 * rng.normal(size=5)
        missing = [None if step == 3 and row == 1 else z for row, z in enumerate(value)]
        innovation = ours.innovation(missing, [0.5] * 5)
        correction = ours.update(missing, [0.5] * 5)
        seen = [row for row in range(5) if missing[row] is not None]
        hs, rs = h[seen], r[np.ix_(seen, seen)]
        s = hs @ covariance @ hs.T + rs
        gain = np.linalg.solve(s, hs @ covariance).T
        residual = value[seen] - hs @ mean
        assert correction.nis == pytest.approx(residual @ np.linalg.solve(s, residual), rel=1e-6)
        np.testing.assert_allclose(innovation.residual[seen], residual, atol=1e-7)
        np.testing.assert_allclose(innovation.covariance[np.ix_(seen, seen)], s, atol=1e-7)
        assert np.isnan(innovation.normalised).sum() == 5 - len(seen)
        mean = mean + gain @ residual
        covariance = covariance - gain @ s @ gain.T
    estimate = ours.estimate()
    np.testing.assert_allclose(estimate.mean, mean, atol=1e-7)
    np.testing.assert_allclose(estimate.covariance, covariance, atol=1e-7)
    difference = truth - mean
    assert ours.nees(truth) == pytest.approx(
        difference @ np.linalg.solve(covariance, difference), rel=1e-6
    )
    states, weights = ours.samples()
    np.testing.assert_allclose(weights @ states, mean, atol=1e-7)
    spread = (states - mean).T @ np.diag(weights) @ (states - mean)
    np.testing.assert_allclose(spread, covariance, atol=1e-7)
    again = pickle.loads(pickle.dumps(ours))
    np.testing.assert_array_equal(again.estimate().mean, estimate.mean)
    np.testing.assert_array_equal(copy.deepcopy(ours).estimate().covariance, estimate.covariance)


def test_a_model_over_few_of_many_components_gives_the_same():
    walk = foxhunt.Motion.random_walk(0.2)
    covariance = np.eye(20) + 0.5
    beliefs = []
    for whole in [True, False]:
        ours = foxhunt.Ekf(walk, OfOne(3, 17, whole), np.zeros(20), covariance)
        ours.predict(1.0)
        ours.update(4.0, 0.3)
        beliefs.append(ours.estimate())
    np.testing.assert_allclose(beliefs[0].mean, beliefs[1].mean, atol=1e-7)
    np.testing.assert_allclose(beliefs[0].covariance, beliefs[1].covariance, atol=1e-7)
    assert beliefs[1].mean[3] > 1.0


def test_what_a_large_state_cannot_do_is_refused():
    walk, model, prior = foxhunt.Motion.random_walk(0.2), Mixed(), (np.zeros(12), np.eye(12))
    for kind in [foxhunt.ParticleFilter, foxhunt.GridFilter]:
        with pytest.raises(ValueError, match="there must be 2 to 8"):
            kind(walk, model, *prior)
    with pytest.raises(ValueError, match="iterations is 3"):
        foxhunt.Ekf(walk, model, *prior, iterations=3)
    with pytest.raises(ValueError, match="motion is of 4, 5, 6 or 7"):
        foxhunt.Ekf(foxhunt.Motion.constant_velocity(0.1), model, *prior)
    with pytest.raises(ValueError, match="it must be 12 rows of 12 numbers"):
        foxhunt.Ekf(walk, model, np.zeros(12), np.eye(11))
    ours = foxhunt.Ekf(walk, model, *prior)
    before = ours.estimate()
    with pytest.raises(ValueError, match="value has 2 components"):
        ours.update([1.0, 2.0], np.eye(5))
    with pytest.raises(ValueError, match="5 rows of 5"):
        ours.update([1.0] * 5, np.eye(4))
    with pytest.raises(ValueError, match="smoothing a state of more than 8"):
        ours.smooth(copy.deepcopy(ours), 1.0)
    np.testing.assert_array_equal(ours.estimate().mean, before.mean)
    bearing = foxhunt.Ekf(walk, foxhunt.Model.bearing(), np.arange(12.0), np.eye(12))
    bearing.update(0.5, 0.1, receiver=(10.0, 0.0))
    assert bearing.ellipse() is not None


@pytest.mark.parametrize("kind", [foxhunt.ParticleFilter, foxhunt.GridFilter])
def test_innovations_of_clouds_and_grids_are_those_of_their_beliefs(kind):
    walk, model = foxhunt.Motion.random_walk(0.1), foxhunt.Model.bearing()
    filter = kind(walk, model, [90, 10], 100 * np.eye(2))
    before = filter.estimate()
    innovation = filter.innovation(0.5, 0.02, receiver=(0, 0))
    np.testing.assert_array_equal(filter.estimate().mean, before.mean)
    states, weights = filter.samples()
    expected = np.arctan2(states[:, 1], states[:, 0])
    spread = weights @ (expected - weights @ expected) ** 2
    assert innovation.residual[0] == pytest.approx(0.5 - weights @ expected, abs=1e-9)
    assert innovation.covariance[0, 0] == pytest.approx(spread + 0.02**2, rel=1e-9)
    assert filter.innovation([None], 0.02) is None
    again = pickle.loads(pickle.dumps(innovation))
    assert again.nis == innovation.nis
    assert repr(again).startswith("Innovation(residual=array([")


def test_normalised_innovations_of_a_consistent_filter_are_white():
    filter = foxhunt.Ekf(ConstantVelocity(0.09), Linear(), np.zeros(4), np.diag([100, 100, 4, 4]))
    whites = []
    for value in measurements(steps=60):
        filter.predict(1.0)
        whites.append(filter.innovation(value, [2.0, 2.0]).normalised)
        filter.update(value, [2.0, 2.0])
    assert foxhunt.whiteness(np.array(whites)).p_value > 0.01
