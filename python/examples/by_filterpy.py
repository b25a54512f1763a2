import numpy as np
from problem import COVARIANCE, DT, FIXES, MEAN, Q, SIGMA

# ANCHOR: ten
from filterpy.common import Q_continuous_white_noise
from filterpy.kalman import KalmanFilter

kf = KalmanFilter(dim_x=4, dim_z=2)
kf.x, kf.P = MEAN, COVARIANCE
kf.F = np.eye(4) + DT * np.eye(4, k=2)
kf.H, kf.R = np.eye(2, 4), SIGMA**2 * np.eye(2)
kf.Q = Q_continuous_white_noise(2, DT, Q, block_size=2, order_by_dim=False)
for fix in FIXES:
    kf.predict()
    kf.update(fix)
mean, covariance = kf.x, kf.P
# ANCHOR_END: ten
