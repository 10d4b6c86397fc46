"""Motions of parts as controllers return them: previewed, with a result; refused commands become failed motions."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from bestman_bt.control.joint_state import READING_ERRORS
from hal.api import CommandRefusedError, Motion, MotionErrorCode, MotionStatus

Result = TypeVar("Result")


class ControlledMotion(Motion[Result]):
    """A motion that ends with the part's ``motion``, or earlier if a controller fails it; ``read`` then returns its
    result.
    """

    def __init__(self, part: str, motion: Motion[Any], read: Callable[[], Result] | None = None) -> None:
        super().__init__(part, motion.cancel)
        self._motion, self._read = motion, read

    def _look(self) -> None:
        motion = self._motion
        if motion.done:
            succeeded = motion.status is MotionStatus.SUCCEEDED
            result = self._read() if succeeded and self._read is not None else None
            self.end(motion.status, motion.failure, result)


def start_motion(
    part: str, command: Callable[[], Motion[Any]], read: Callable[[], Result] | None = None
) -> Motion[Result]:
    """Return the motion that ``command`` starts; a refused command gives a failed motion."""
    try:
        return ControlledMotion(part, command(), read)
    except (CommandRefusedError, *READING_ERRORS) as error:
        failure = error.failure
    refused: Motion[Result] = Motion(part)
    refused.end(MotionStatus.FAILED, failure)
    return refused


Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class PlannedMotion:
    """The preview of a motion. ``words``: description of the motion of ``part``. ``duration``: seconds at full speed,
    or None if unknown.

    ``swept``: outlines (N, 2) of the swept area, metres in the map frame. ``heights``: lowest and highest point above
    the floor, metres, or None.
    """

    part: str
    words: str
    duration: float | None = None
    swept: tuple[Array, ...] = ()
    heights: tuple[float, float] | None = None

    def __str__(self) -> str:
        """Return one line such as ``arm: to panda_joint1 = 0.20; 2.1 s; x 0.10 to 0.80 m, y …``."""
        parts = [f"{self.part}: {self.words}"]
        if self.duration is not None:
            parts.append(f"{self.duration:.1f} s")
        if self.swept:
            corners = np.concatenate(self.swept)
            (x0, y0), (x1, y1) = corners.min(axis=0), corners.max(axis=0)
            box = f"passes through x {x0:.2f} to {x1:.2f} m, y {y0:.2f} to {y1:.2f} m"
            high = "" if self.heights is None else ", z {:.2f} to {:.2f} m".format(*self.heights)
            parts.append(f"{box}{high} of the map")
        return "; ".join(parts)


Confirm = Callable[[PlannedMotion], bool]
"""Shows a motion, waits, and returns whether it may start."""


def declined(confirm: Confirm | None, planned: Callable[[], PlannedMotion]) -> Motion[Any] | None:
    """Return a motion that failed as DECLINED if a person refuses it; else None."""
    if confirm is None or confirm(shown := planned()):
        return None
    refused: Motion[Any] = Motion(shown.part)
    refused.fail(MotionErrorCode.DECLINED, f"a person declined: {shown.words}")
    return refused


def outline(points: Array) -> Array:
    """Return the convex outline (M, 2) of points (N, 2)."""
    from scipy.spatial import ConvexHull, QhullError  # commands that only read trees do without SciPy

    try:
        hull: Array = points[ConvexHull(points).vertices]
    except (QhullError, ValueError):  # all in a line
        return points
    return hull


def turned(corners: Array, headings: Iterable[float]) -> Array:
    """Return corners (N, 2) rotated about the origin to all M ``headings``, radians: (N·M, 2)."""
    turns = [np.array([[math.cos(a), -math.sin(a)], [math.sin(a), math.cos(a)]]) for a in headings]
    return np.concatenate([corners @ turn.T for turn in turns])
