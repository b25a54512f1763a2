"""A target at a nearly constant velocity whose place is measured each second."""

import numpy as np

DT, Q, SIGMA = 1.0, 0.04, 3.0  # s, m²/s³, m
MEAN, COVARIANCE = np.zeros(4), np.diag([100.0, 100.0, 4.0, 4.0])  # E, N in m, speeds in m/s


def fixes(seed: int = 1, steps: int = 30) -> np.ndarray:
    """East and North as measured, one row a second."""
    rng = np.random.default_rng(seed)
    state, rows = rng.multivariate_normal(MEAN, COVARIANCE), []
    noise = Q * np.kron([[DT**3 / 3, DT**2 / 2], [DT**2 / 2, DT]], np.eye(2))
    for _ in range(steps):
        state = (np.eye(4) + DT * np.eye(4, k=2)) @ state + rng.multivariate_normal(np.zeros(4), noise)
        rows.append(state[:2] + rng.normal(0, SIGMA, 2))
    return np.array(rows)


FIXES = fixes()
