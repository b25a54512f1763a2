import datetime

import numpy as np
from problem import COVARIANCE, DT, FIXES, MEAN, Q, SIGMA

# ANCHOR: ten
from stonesoup.models.measurement.linear import LinearGaussian
from stonesoup.models.transition.linear import CombinedLinearGaussianTransitionModel as Both
from stonesoup.models.transition.linear import ConstantVelocity
from stonesoup.predictor.kalman import KalmanPredictor
from stonesoup.types.detection import Detection
from stonesoup.types.hypothesis import SingleHypothesis
from stonesoup.types.state import GaussianState
from stonesoup.updater.kalman import KalmanUpdater

order = [0, 2, 1, 3]  # its states are E, its speed, N, its speed
predictor = KalmanPredictor(Both([ConstantVelocity(Q), ConstantVelocity(Q)]))
updater = KalmanUpdater(LinearGaussian(4, mapping=(0, 2), noise_covar=SIGMA**2 * np.eye(2)))
time = datetime.datetime(2026, 1, 1)
state = GaussianState(MEAN[order][:, None], COVARIANCE[np.ix_(order, order)], timestamp=time)
for fix in FIXES:
    time += datetime.timedelta(seconds=DT)
    prior = predictor.predict(state, timestamp=time)
    state = updater.update(SingleHypothesis(prior, Detection(fix[:, None], timestamp=time)))
mean, covariance = state.state_vector[order], state.covar[np.ix_(order, order)]
# ANCHOR_END: ten
