import numpy as np
from problem import COVARIANCE, DT, FIXES, MEAN, Q, SIGMA

# ANCHOR: ten
import gtsam

kf = gtsam.KalmanFilter(4)
state = kf.init(MEAN, COVARIANCE)
F = np.eye(4) + DT * np.eye(4, k=2)
noise = Q * np.kron([[DT**3 / 3, DT**2 / 2], [DT**2 / 2, DT]], np.eye(2))
sensor = gtsam.noiseModel.Isotropic.Sigma(2, SIGMA)
for fix in FIXES:
    state = kf.predictQ(state, F, np.zeros((4, 1)), np.zeros(1), noise)
    state = kf.update(state, np.eye(2, 4), fix, sensor)
mean, covariance = state.mean(), state.covariance()
# ANCHOR_END: ten
