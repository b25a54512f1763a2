"""Poses of receivers."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


class Pose(np.ndarray):
    """The place of a receiver, with its attitude and, where known, its velocity.

    It is an array of East, North and Up in metres, so that ``pose[:2]`` and ``state[:3] - pose``
    are what they look like. ``heading``, ``pitch`` and ``roll`` are in radians, the heading
    counter-clockwise from East; ``velocity`` is East, North and Up in m/s, or None.

    Estimators take one as ``receiver``, and models of your own are given one.

    >>> pose = Pose([3, 4], velocity=[1, 0, 0])
    >>> pose
    Pose([3.0, 4.0, 0.0], velocity=[1.0, 0.0, 0.0])
    >>> float(np.hypot(*pose[:2]))
    5.0
    """

    heading: float
    pitch: float
    roll: float
    velocity: np.ndarray | None
    _plain: np.ndarray

    def __new__(
        cls,
        position: ArrayLike,
        heading: float = 0.0,
        pitch: float = 0.0,
        roll: float = 0.0,
        velocity: ArrayLike | None = None,
    ) -> Pose:
        pose = _of_three(position, "position").view(cls)
        pose.heading, pose.pitch, pose.roll = float(heading), float(pitch), float(roll)
        pose.velocity = None if velocity is None else _of_three(velocity, "velocity")
        return pose

    def __array_finalize__(self, source: Any) -> None:
        self._plain = self.view(np.ndarray)
        self.heading = getattr(source, "heading", 0.0)
        self.pitch = getattr(source, "pitch", 0.0)
        self.roll = getattr(source, "roll", 0.0)
        self.velocity = getattr(source, "velocity", None)

    def __getitem__(self, index: Any) -> Any:
        # A part of a place is no pose.
        return self._plain[index]

    def __array_ufunc__(self, ufunc: Any, method: str, *inputs: Any, **more: Any) -> Any:
        # Nor is a sum of places.
        plain = [each._plain if isinstance(each, Pose) else each for each in inputs]
        out = more.get("out", ())
        if out:
            more["out"] = tuple(each._plain if isinstance(each, Pose) else each for each in out)
        result = getattr(ufunc, method)(*plain, **more)
        # What is written into a pose stays that pose.
        return out[0] if len(out) == 1 else result

    def __reduce__(self) -> Any:
        return Pose, (self._plain.tolist(), self.heading, self.pitch, self.roll, self.velocity)

    def __repr__(self) -> str:
        parts = [str(self._plain.tolist())]
        angles = (("heading", self.heading), ("pitch", self.pitch), ("roll", self.roll))
        parts += [f"{name}={angle}" for name, angle in angles if angle]
        if self.velocity is not None:
            parts.append(f"velocity={self.velocity.tolist()}")
        return f"Pose({', '.join(parts)})"


def _of_three(values: ArrayLike, name: str) -> np.ndarray:
    """Three numbers, of which the last one may be left out."""
    array = np.array(values, dtype=float)
    if array.shape not in [(2,), (3,)]:
        raise ValueError(f"{name} is {values!r}; it must be 2 or 3 numbers: East, North, Up")
    return array if len(array) == 3 else np.append(array, 0.0)
