"""The volume swept by an arm, its hand and its object along a path."""

from __future__ import annotations

from collections.abc import Mapping

import coal
import numpy as np
from numpy.typing import NDArray

from bestman_bt.manipulation.kinematics.link_hulls import ArmBodies
from bestman_bt.world_model.world_model import HeldObject

_STEP = 0.02
"""Largest motion of a joint between two samples, radians or metres."""
_PER_PIECE = 5
"""Steps in each piece."""


class SweptVolume:
    """Pieces of a path, each with the convex hulls of the arm's bodies, in the base frame.

    ``path``: (N, n) positions of ``joint_names``. ``others``: positions of all joints, by name; the path overrides its
    own. ``held``: the held object, as a box.
    """

    def __init__(
        self,
        bodies: ArmBodies,
        joint_names: tuple[str, ...],
        path: NDArray[np.float64],
        others: Mapping[str, float],
        held: HeldObject | None,
    ) -> None:
        self.positions = _resampled(path)
        at = [bodies.at({**others, **dict(zip(joint_names, q, strict=True))}, held) for q in self.positions]
        pieces = [at[start : start + _PER_PIECE + 1] for start in range(0, max(len(at) - 1, 1), _PER_PIECE)]
        self._points = [[np.vstack(corners) for corners in zip(*piece, strict=True)] for piece in pieces]
        self._low = np.array([[points.min(axis=0) for points in piece] for piece in self._points])
        self._high = np.array([[points.max(axis=0) for points in piece] for piece in self._points])
        self._hulls: dict[tuple[int, int], coal.CollisionObject] = {}

    def reached(self, positions: NDArray[np.float64], since: int = 0) -> int:
        """Return the index of the path sample that the arm has reached at ``positions`` (n,), at least ``since``."""
        away = np.abs(self.positions - positions).max(axis=1)
        while since + 1 < len(away) and away[since + 1] <= away[since]:
            since += 1
        return since

    def is_near(self, other: SweptVolume, margin: float, since: int = 0) -> bool:
        """Return whether the rest of the path, from sample ``since``, comes within ``margin`` metres of another arm's
        path.
        """
        first = min(since // _PER_PIECE, len(self._low) - 1)
        low, high = self._low[first:, :, None, None] - margin, self._high[first:, :, None, None] + margin
        close = ((low <= other._high) & (high >= other._low)).all(axis=-1)
        request = coal.CollisionRequest()
        request.security_margin = max(margin, 1e-5)  # as of collision worlds: at exactly 0 overlaps were missed
        return any(
            coal.collide(self._hull(first + piece, body), other._hull(*there), request, coal.CollisionResult())
            for piece, body, *there in np.argwhere(close).tolist()
        )

    def _hull(self, piece: int, body: int) -> coal.CollisionObject:
        if (piece, body) not in self._hulls:
            points = coal.StdVec_Vec3s()
            points.extend(self._points[piece][body])
            self._hulls[piece, body] = coal.CollisionObject(coal.ConvexBase.convexHull(points, True, "Qt"))
        return self._hulls[piece, body]


def _resampled(path: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return (M, n) positions along the path, at most ``_STEP`` apart, from its first to its last."""
    way = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(path, axis=0)).max(axis=1))])
    at = np.linspace(0.0, way[-1], int(np.ceil(way[-1] / _STEP)) + 1)
    return np.column_stack([np.interp(at, way, joint) for joint in path.T])
