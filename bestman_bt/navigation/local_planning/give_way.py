"""Giving way to people who walk: slower, or at rest, where the base would come into the way of one of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import Pose2D, Twist2D
from bestman_bt.navigation.global_planning.footprint import Footprint
from bestman_bt.navigation.local_planning.footprint_motion import FootprintMotion, arc
from bestman_bt.navigation.local_planning.moving_obstacles import MovingObstacle


@dataclass(eq=False)
class GiveWay:
    """Who walks is taken to go on straight at the velocity that was measured.

    ``margin``: metres kept between the outline and who walks. ``horizon``: seconds that are looked ahead.

    ``step``: seconds between two looks. ``shares``: of the velocity, largest first; the last one that is tried is rest.
    ``nearer``: metres that count as coming nearer.
    """

    footprint: Footprint
    margin: float = 0.2
    horizon: float = 2.0
    step: float = 0.1
    shares: tuple[float, ...] = (1.0, 0.7, 0.4, 0.2)
    nearer: float = 0.02

    def __post_init__(self) -> None:
        self._motion = FootprintMotion(self.footprint, self.margin)
        self._times = np.arange(0.0, self.horizon + 1e-9, self.step)

    def share(self, pose: Pose2D, twist: Twist2D, moving: Sequence[MovingObstacle]) -> float:
        """How much of ``twist``, 0 to 1, a base at ``pose`` may drive.

        Where somebody comes who would walk into it even if it stood, it may drive out of the way, and else stands.
        """
        if not moving or (twist.vx == twist.vy == twist.wz == 0.0):
            return 1.0
        tracks = np.array([[m.x, m.y, m.vx, m.vy, m.radius] for m in moving])
        standing = self._distances(pose, Twist2D(), tracks)
        for share in self.shares:
            driving = self._distances(pose, Twist2D(share * twist.vx, share * twist.vy, share * twist.wz), tracks)
            into = (driving < 0.0) & (driving < driving[0] - self.nearer)
            into &= driving.min(axis=0) < standing.min(axis=0) + self.nearer
            if not into.any():
                return share
        return 0.0

    def _distances(self, pose: Pose2D, twist: Twist2D, tracks: NDArray[np.float64]) -> NDArray[np.float64]:
        """(T, M) metres between the outline with its margin and each of ``tracks`` (M, 5) at each time."""
        x, y, theta = arc(twist, self._times)
        places = tracks[None, :, :2] + self._times[:, None, None] * tracks[None, :, 2:4]
        own = pose.inverse().apply(places.reshape(-1, 2)).reshape(places.shape) - np.stack([x, y], axis=-1)[:, None]
        cos, sin = np.cos(theta)[:, None], np.sin(theta)[:, None]
        turned = np.stack([cos * own[..., 0] + sin * own[..., 1], cos * own[..., 1] - sin * own[..., 0]], axis=-1)
        distances: NDArray[np.float64] = self._motion.distance(turned) - tracks[:, 4]
        return distances
