"""The poses of a base along a path, and its first contact: nav2's IsPathValid."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import Path2D, wrap_angle
from bestman_bt.navigation.local_planning.footprint_check import FootprintMotion

SPACING = 0.05
TURN = 0.15
"""Spacing of the poses, metres and radians."""
WINDOW = 60
"""Largest number of poses by which the progress may increase at once, so that it never jumps to a later piece that
happens to be close.
"""
NEARER = 1e-3


class SweptPath:
    """A path with turns in place at its corners and goal, and the progress along it."""

    def __init__(self, path: Path2D) -> None:
        self._poses = _swept(path)
        steps = np.linalg.norm(np.diff(self._poses[:, :2], axis=0), axis=1)
        self._left = np.append(np.cumsum(steps[::-1])[::-1], 0.0)
        self._at = 0

    @property
    def ahead(self) -> NDArray[np.float64]:
        """The remaining poses (N, 3) of x, y, theta in the map frame."""
        return self._poses[self._at :]

    @property
    def remaining(self) -> float:
        """Metres to the end."""
        return float(self._left[self._at])

    def advance(self, position: NDArray[np.float64]) -> None:
        """Update the progress for a base at ``position`` (2,), metres."""
        window = self._poses[self._at : self._at + WINDOW, :2]
        self._at += int(np.argmin(np.linalg.norm(window - position, axis=1)))

    def contact(
        self, here: NDArray[np.float64], points: NDArray[np.float64], motion: FootprintMotion
    ) -> tuple[float, NDArray[np.float64]] | None:
        """Return the first of ``points`` (N, 2) that the base touches on its path: distance in metres, and point (2,);
        or None.

        A point that it already touches at ``here`` (3,) counts only if the base approaches it.
        """
        x, y = self.ahead[:, :1] - points[:, 0], self.ahead[:, 1:2] - points[:, 1]
        near = x * x + y * y < motion.reach**2
        poses, touching = np.flatnonzero(near.any(axis=1)), np.flatnonzero(near.any(axis=0))
        if not len(poses):
            return None
        distances = motion.distance(_seen_from(self.ahead[poses], points[touching]))
        now = motion.distance(_seen_from(here[None], points[touching]))[0]
        touched = (distances < 0.0) & (distances < now - NEARER)
        if not touched.any():
            return None
        first = int(np.argmax(touched.any(axis=1)))
        point = points[touching[int(np.argmin(np.where(touched[first], distances[first], np.inf)))]]
        return self.remaining - float(self._left[self._at + poses[first]]), point


def _seen_from(poses: NDArray[np.float64], points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return points (N, 2) of the map in the frames of poses (M, 3), (M, N, 2)."""
    cos, sin = np.cos(poses[:, 2, None]), np.sin(poses[:, 2, None])
    x, y = points[:, 0] - poses[:, 0, None], points[:, 1] - poses[:, 1, None]
    return np.stack([cos * x + sin * y, cos * y - sin * x], axis=-1)


def _swept(path: Path2D) -> NDArray[np.float64]:
    deltas = np.diff(path.points, axis=0)
    lengths = np.linalg.norm(deltas, axis=1)
    pieces: list[NDArray[np.float64]] = []
    heading: float | None = None
    for start, delta, length, reverse in zip(path.points[:-1], deltas, lengths, path.reverse, strict=True):
        if length < 1e-6:
            continue
        along = math.atan2(delta[1], delta[0]) + (math.pi if reverse else 0.0)
        if heading is not None:
            pieces.append(_turn(start, heading, along))
        share = np.arange(0.0, 1.0, SPACING / max(float(length), SPACING))[:, None]
        pieces.append(np.column_stack([start + share * delta, np.full(len(share), along)]))
        heading = along
    goal = path.goal
    if heading is not None:
        pieces.append(_turn(path.points[-1], heading, goal.theta))
    return np.vstack([*pieces, [[goal.x, goal.y, goal.theta]]])


def _turn(place: NDArray[np.float64], before: float, after: float) -> NDArray[np.float64]:
    """Return poses (N, 3), metres and radians, of a turn in place, the last one excluded."""
    turn = wrap_angle(after - before)
    headings = before + turn * np.arange(0.0, 1.0, min(1.0, TURN / max(abs(turn), 1e-9)))
    return np.column_stack([np.broadcast_to(place, (len(headings), 2)), headings])
