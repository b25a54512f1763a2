"""Stone Soup: its extended and its unscented filter."""

import datetime
import pathlib
import sys

sys.path.insert(0, str(pathlib.Path(__file__).parents[1]))

import numpy
from stonesoup.base import Property
from stonesoup.models.measurement.nonlinear import NonLinearGaussianMeasurement
from stonesoup.models.transition.linear import CombinedLinearGaussianTransitionModel, RandomWalk
from stonesoup.predictor.kalman import ExtendedKalmanPredictor, UnscentedKalmanPredictor
from stonesoup.types.array import StateVector, StateVectors
from stonesoup.types.detection import Detection
from stonesoup.types.hypothesis import SingleHypothesis
from stonesoup.types.state import GaussianState
from stonesoup.updater.kalman import ExtendedKalmanUpdater, UnscentedKalmanUpdater

import common

BEGINNING = datetime.datetime(2020, 1, 1)


class LevelBearing(NonLinearGaussianMeasurement):
    beacon: object = Property()
    receiver: numpy.ndarray = Property()

    @property
    def ndim_meas(self):
        return 2

    def function(self, state, noise=False, **_):
        vectors = numpy.asarray(state.state_vector, float)
        columns = [self.beacon.expected(*column, self.receiver) for column in vectors.T]
        kind = StateVector if len(columns) == 1 else StateVectors
        return kind(numpy.array(columns).T)

    def jacobian(self, state, **_):
        x, y = numpy.asarray(state.state_vector, float).ravel()
        return self.beacon.jacobian(x, y, self.receiver)


class Filter:
    def __init__(self, beacon, predictor, updater):
        self.beacon, self.updater = beacon, updater
        walk = RandomWalk(beacon.drift**2)
        self.predictor = predictor(CombinedLinearGaussianTransitionModel([walk, walk]))
        self.state = GaussianState(StateVector([0.0, 0.0]), beacon.p, BEGINNING)

    def step(self, receiver, z):
        time = self.state.timestamp + datetime.timedelta(seconds=1)
        model = LevelBearing(ndim_state=2, mapping=(0, 1), noise_covar=self.beacon.r,
                             beacon=self.beacon, receiver=receiver)
        detection = Detection(StateVector(z), time, measurement_model=model)
        prediction = self.predictor.predict(self.state, timestamp=time)
        self.state = self.updater.update(SingleHypothesis(prediction, detection))

    def belief(self):
        return self.state.state_vector, self.state.covar


def ekf(beacon):
    return Filter(beacon, ExtendedKalmanPredictor, ExtendedKalmanUpdater(None))


def ukf(beacon):
    scaling = dict(alpha=beacon.alpha, beta=2, kappa=1)
    return Filter(beacon, lambda motion: UnscentedKalmanPredictor(motion, **scaling),
                  UnscentedKalmanUpdater(None, **scaling))


common.kalman({"ekf": ekf, "ukf": ukf})
