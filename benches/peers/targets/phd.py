"""The Gaussian-mixture PHD filter of Stone Soup over the scans of standard input, as in its tutorial
of multi-target tracking: Stone Soup has no labelled multi-Bernoulli filter."""

import datetime
import sys
import time

import numpy as np
from stonesoup.hypothesiser.distance import DistanceHypothesiser
from stonesoup.hypothesiser.gaussianmixture import GaussianMixtureHypothesiser
from stonesoup.measures import Mahalanobis
from stonesoup.mixturereducer.gaussianmixture import GaussianMixtureReducer
from stonesoup.models.measurement.linear import LinearGaussian
from stonesoup.models.transition.linear import (CombinedLinearGaussianTransitionModel,
                                                ConstantVelocity)
from stonesoup.predictor.kalman import KalmanPredictor
from stonesoup.types.detection import Detection
from stonesoup.types.state import TaggedWeightedGaussianState
from stonesoup.updater.kalman import KalmanUpdater
from stonesoup.updater.pointprocess import PHDUpdater

BEGIN = datetime.datetime(2026, 1, 1)
BIRTHS = [(0, 0), (400, -600), (-800, -200), (-200, 800)]

transition = CombinedLinearGaussianTransitionModel([ConstantVelocity(25), ConstantVelocity(25)])
measurement = LinearGaussian(ndim_state=4, mapping=(0, 2), noise_covar=np.diag([100.0, 100.0]))
kalman = KalmanUpdater(measurement)
updater = PHDUpdater(kalman, clutter_spatial_density=60 / 4e6, prob_detection=0.98,
                     prob_survival=0.99)
# Beyond 4 standard deviations an observation is not a component's, as in the tutorial.
base = DistanceHypothesiser(KalmanPredictor(transition), kalman, Mahalanobis(),
                            missed_distance=4)
hypothesiser = GaussianMixtureHypothesiser(base, order_by_detection=True)
reducer = GaussianMixtureReducer(prune_threshold=1e-5, pruning=True, merge_threshold=4,
                                 merging=True)


def births(at):
    """Components of births; their tag is that of Stone Soup's births."""
    return [TaggedWeightedGaussianState(
        np.array([[east], [0.0], [north], [0.0]]), np.diag([100.0] * 4), timestamp=at, weight=0.03,
        tag=TaggedWeightedGaussianState.BIRTH) for east, north in BIRTHS]


run = None
for line in sys.stdin:
    words = line.split()
    if words[0] != run:
        run = words[0]
        components = []
    step = int(words[1])
    at = BEGIN + datetime.timedelta(seconds=step)
    numbers = [float(word) for word in words[2:]]
    scan = {Detection(np.array([[east], [north]]), timestamp=at, measurement_model=measurement)
            for east, north in zip(numbers[::2], numbers[1::2])}
    begin = time.process_time_ns()
    hypotheses = hypothesiser.hypothesise(components + births(at), scan, at,
                                          order_by_detection=True)
    components = list(reducer.reduce(updater.update(hypotheses)))
    found = [c for c in components if c.weight > 0.5]
    nanoseconds = time.process_time_ns() - begin
    # A component of weight n stands for n targets.
    places = [(c.mean[0, 0], c.mean[2, 0]) for c in found for _ in range(round(float(c.weight)))]
    print(run, step, nanoseconds, *(f"{value:.6f}" for place in places for value in place),
          flush=True)
