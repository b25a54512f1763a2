"""Finds radio transmitters with drones: estimators, direction finding, campaigns.

Places are East, North, Up in metres, angles radians counter-clockwise from East, times seconds and
levels dBm, unless a name ends otherwise.

>>> import numpy as np
>>> import foxhunt
>>> model = foxhunt.Model.rss_bearing(-29.06, 2.765)
>>> ukf = foxhunt.Ukf(foxhunt.Motion.random_walk(0.02), model, [0, 0], 100 * np.eye(2))
>>> ukf.predict(1.0)
>>> correction = ukf.update([-62.0, 0.52], [6.0, 0.3], receiver=(-8, 0, 4))
>>> correction.rejected
False
>>> bool(ukf.estimate().mean[1] > 0)
True
"""

from . import commands, laws, plots
from ._foxhunt import Correction, Estimate, Innovation, Motion, Model, __version__
from .commands import (
    bearing,
    calibrate,
    campaign,
    hunt,
    judge,
    locate,
    replay,
    results,
    run,
)
from .estimators import Ckf, Ekf, Estimator, GridFilter, ParticleFilter, Remembering, Ukf
from .judging import Consistency, Whiteness, consistency, whiteness
from .logs import Log, read_log
from .poses import Pose

__all__ = [
    "Ckf",
    "Consistency",
    "Correction",
    "Ekf",
    "Estimate",
    "Estimator",
    "GridFilter",
    "Innovation",
    "Log",
    "Model",
    "Motion",
    "ParticleFilter",
    "Pose",
    "Remembering",
    "Ukf",
    "Whiteness",
    "__version__",
    "bearing",
    "calibrate",
    "campaign",
    "commands",
    "consistency",
    "hunt",
    "judge",
    "laws",
    "locate",
    "plots",
    "read_log",
    "replay",
    "results",
    "run",
    "whiteness",
]
