from problem import COVARIANCE, DT, FIXES, MEAN, Q, SIGMA

# ANCHOR: ten
import foxhunt

class Fix:
    quantities = [("east_m", "linear"), ("north_m", "linear")]
    def expected(self, state, receiver):
        return state[:2]

kf = foxhunt.Ekf(foxhunt.Motion.constant_velocity(Q), Fix(), MEAN, COVARIANCE)
for fix in FIXES:
    kf.predict(DT)
    kf.update(fix, [SIGMA, SIGMA])
mean, covariance = kf.estimate().mean, kf.estimate().covariance
# ANCHOR_END: ten
