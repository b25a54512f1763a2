"""filterpy: its extended and its unscented filter."""

import pathlib
import sys

sys.path.insert(0, str(pathlib.Path(__file__).parents[1]))

import numpy
from filterpy.kalman import ExtendedKalmanFilter, MerweScaledSigmaPoints, UnscentedKalmanFilter

import common


def begun(filter, beacon):
    filter.x, filter.P = numpy.zeros(2), beacon.p.copy()
    filter.Q, filter.R = beacon.q, beacon.r
    return filter


class Ekf:
    def __init__(self, beacon):
        self.filter = begun(ExtendedKalmanFilter(2, 2), beacon)
        self.jacobian = lambda x, receiver: beacon.jacobian(x[0], x[1], receiver)
        self.expected = lambda x, receiver: beacon.expected(x[0], x[1], receiver)

    def step(self, receiver, z):
        self.filter.predict()
        self.filter.update(z, self.jacobian, self.expected, args=(receiver,), hx_args=(receiver,))

    def belief(self):
        return self.filter.x, self.filter.P


class Ukf:
    def __init__(self, beacon):
        self.points = MerweScaledSigmaPoints(2, beacon.alpha, 2.0, 1.0)
        expected = lambda x, receiver: beacon.expected(x[0], x[1], receiver)
        still = lambda x, dt: x
        self.filter = begun(UnscentedKalmanFilter(2, 2, 1.0, expected, still, self.points), beacon)

    def step(self, receiver, z):
        self.filter.predict()
        # It does not draw its points anew after a prediction.
        self.filter.sigmas_f = self.points.sigma_points(self.filter.x, self.filter.P)
        self.filter.update(z, receiver=receiver)

    def belief(self):
        return self.filter.x, self.filter.P


common.kalman({"ekf": Ekf, "ukf": Ukf})
