"""Figures of results, by matplotlib. Each function draws on ``ax`` and returns it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

    from ._foxhunt import Estimator
    from .logs import Log


def track(log: Log, beacon: int | str = 0, ax: Axes | None = None) -> Axes:
    """Where the drones received, where the beacon was thought to be, its last 95 % ellipse, and
    where it was, if the log has the truth: its way, if it moved, and its last place."""
    beacon = log.index(beacon)
    ax = ax or _axes()
    receptions = [each["reception"] for each in log.events if each["event"] == "received"]
    places = [each["receiver"]["position"][:2] for each in receptions if each["beacon"] == beacon]
    if places:
        ax.plot(*np.transpose(places), ".", color="0.6", label="receptions")
    frame = log.track(beacon)
    if len(frame):
        ax.plot(frame["east_m"], frame["north_m"], "-", color="#0072B2", label="estimate")
        last = frame.iloc[-1]
        ax.plot(*_ellipse(last[["east_m", "north_m"]].to_numpy(float), last["covariance_m2"]),
                color="#0072B2", linewidth=1, label="95 % ellipse")
    times = [each["time"] for each in log.events if "time" in each]
    truth = log.truth(beacon, np.linspace(0.0, max(times, default=0.0), 500))
    if truth is not None:
        if np.ptp(truth, axis=0).any():
            ax.plot(*truth.T, "-", color="#D55E00", linewidth=0.5)
        ax.plot(*truth[-1], "x", color="#D55E00", label="truth")
    ax.set(xlabel="East / m", ylabel="North / m", aspect="equal")
    ax.legend()
    return ax


def errors(frame: pd.DataFrame, ax: Axes | None = None) -> Axes:
    """The distribution of a campaign's errors, estimator by estimator."""
    missing = {"estimator", "error_m"} - set(frame.columns)
    if missing:
        raise ValueError(
            f"the frame has no {' and no '.join(sorted(missing))}; errors() takes the runs of a "
            "campaign, as foxhunt.campaign() returns them"
        )
    ax = ax or _axes()
    for name, part in frame.dropna(subset="error_m").groupby("estimator"):
        error = np.sort(part["error_m"].to_numpy())
        ax.step(error, np.arange(1, len(error) + 1) / len(error), where="post", label=name)
    ax.set(xlabel="error / m", ylabel="share of runs", ylim=(0, 1))
    ax.legend()
    return ax


def belief(estimator: Estimator, ax: Axes | None = None) -> Axes:
    """The samples of an estimator's belief, and its 95 % ellipse."""
    ax = ax or _axes()
    states, weights = estimator.samples()
    size = 400 * weights / weights.max() / max(1.0, np.sqrt(len(weights)))
    ax.scatter(states[:, 0], states[:, 1], s=size, color="#56B4E9")
    estimate = estimator.estimate()
    ax.plot(*_ellipse(estimate.mean[:2], estimate.covariance[:2, :2]), color="#0072B2")
    ax.set(xlabel="East / m", ylabel="North / m", aspect="equal")
    return ax


def _axes() -> Any:
    import matplotlib.pyplot as plt

    return plt.subplots()[1]


def _ellipse(mean: np.ndarray, covariance: np.ndarray) -> np.ndarray:
    """The border of the 95 % ellipse: chi-squared with 2 degrees has that quantile at 5.99."""
    angle = np.linspace(0, 2 * np.pi, 90)
    circle = np.sqrt(5.991464547107979) * np.array([np.cos(angle), np.sin(angle)])
    border: np.ndarray = mean[:, None] + np.linalg.cholesky(covariance) @ circle
    return border
