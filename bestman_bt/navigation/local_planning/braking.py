"""Speed limits near obstacles that always leave room to stop."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import Pose2D, Twist2D
from bestman_bt.navigation.global_planning.footprint import Footprint
from bestman_bt.navigation.local_planning.footprint_check import FootprintMotion, arc
from bestman_bt.navigation.local_planning.moving_obstacles import MovingObstacle
from bestman_bt.robot_model.part_config import MobilePart


@dataclass(eq=False)
class GiveWay:
    """Predicts walking people at constant velocity.

    ``margin``: metres between the outline and people. ``horizon``: seconds to predict. ``step``: seconds between two
    checks. ``shares``: fractions of the velocity to try, largest first; if none is safe, the base stops. ``nearer``:
    metres that count as an approach.
    """

    footprint: Footprint
    margin: float = 0.2
    horizon: float = 2.0
    step: float = 0.1
    shares: tuple[float, ...] = (1.0, 0.7, 0.4, 0.2)
    nearer: float = 0.02

    def __post_init__(self) -> None:
        self._motion = FootprintMotion(self.footprint.corners, self.margin)
        self._times = np.arange(0.0, self.horizon + 1e-9, self.step)

    def share(self, pose: Pose2D, twist: Twist2D, moving: Sequence[MovingObstacle]) -> float:
        """Return the fraction of ``twist``, 0 to 1, that a base at ``pose`` may drive.

        If a person would walk into the base even at rest, it may drive out of the way; otherwise it stops.
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
        """Return the distance (T, M), metres, between the outline with its margin and each of ``tracks`` (M, 5) at each
        time.
        """
        x, y, theta = arc(twist, self._times)
        places = tracks[None, :, :2] + self._times[:, None, None] * tracks[None, :, 2:4]
        own = pose.inverse().apply(places.reshape(-1, 2)).reshape(places.shape) - np.stack([x, y], axis=-1)[:, None]
        cos, sin = np.cos(theta)[:, None], np.sin(theta)[:, None]
        turned = np.stack([cos * own[..., 0] + sin * own[..., 1], cos * own[..., 1] - sin * own[..., 0]], axis=-1)
        distances: NDArray[np.float64] = self._motion.distance(turned) - tracks[:, 4]
        return distances


class JerkLimit:
    """Approaches a wanted velocity with limited jerk; keeps velocity and acceleration of each axis.

    The acceleration falls to zero before the wanted velocity is reached, so that there is no overshoot.
    """

    def __init__(self, limits: MobilePart) -> None:
        self._bounds = (
            (limits.max_acceleration, limits.max_jerk),
            (limits.max_acceleration, limits.max_jerk),
            (limits.max_angular_acceleration, limits.max_angular_jerk),
        )
        self._velocity = [0.0, 0.0, 0.0]
        self._acceleration = [0.0, 0.0, 0.0]

    @property
    def twist(self) -> Twist2D:
        """The last command."""
        return Twist2D(*self._velocity)

    def reset(self, twist: Twist2D) -> None:
        """Continue from ``twist`` with zero acceleration."""
        self._velocity = [twist.vx, twist.vy, twist.wz]
        self._acceleration = [0.0, 0.0, 0.0]

    def brake(self, wanted: Twist2D, dt: float) -> Twist2D:
        """Return the command for the next ``dt`` seconds if safety requires less speed, without a jerk limit."""
        for axis, (goal, (most, _)) in enumerate(zip((wanted.vx, wanted.vy, wanted.wz), self._bounds, strict=True)):
            change = min(max(goal - self._velocity[axis], -most * dt), most * dt)
            self._velocity[axis] += change
            self._acceleration[axis] = change / dt
        return self.twist

    def towards(self, wanted: Twist2D, dt: float) -> Twist2D:
        """Return the command for the next ``dt`` seconds."""
        for axis, (goal, (most, jerk)) in enumerate(zip((wanted.vx, wanted.vy, wanted.wz), self._bounds, strict=True)):
            before = self._acceleration[axis]
            left = goal - self._velocity[axis]
            # From an acceleration a, the velocity still changes by a² / (2 jerk) until a is zero; one step is gone
            # before that begins.
            after = max(0.0, abs(left) - abs(before) * dt)
            ideal = math.copysign(min(most, math.sqrt(2.0 * jerk * after), abs(left) / dt), left)
            acceleration = before + min(max(ideal - before, -jerk * dt), jerk * dt)
            acceleration = min(max(acceleration, -most), most)
            change = acceleration * dt
            lands = abs(left) <= abs(change) if change * left > 0.0 else abs(left) < 1e-3
            self._velocity[axis] = goal if lands else self._velocity[axis] + change
            self._acceleration[axis] = 0.0 if lands else acceleration
        return self.twist


def braking_time(twist: Twist2D, acceleration: float, angular_acceleration: float) -> float:
    """Return the seconds from ``twist`` to rest at a constant deceleration, m/s² and rad/s²."""
    return max(math.hypot(twist.vx, twist.vy) / acceleration, abs(twist.wz) / angular_acceleration)


def safe_share(time_to_contact: float, reaction: float, braking: float) -> float:
    """Return the largest fraction, 0 to 1, of a velocity at which the base stops before a contact.

    ``time_to_contact``: seconds at full velocity (infinite: no obstacle). ``reaction``: seconds before the brakes act,
    ``braking``: seconds of braking from full velocity. At a fraction s the base moves on for the equivalent of ``s
    reaction + s² braking / 2`` seconds at full velocity, which must not exceed ``time_to_contact``.
    """
    if time_to_contact >= reaction + braking / 2.0:
        return 1.0
    if time_to_contact <= 0.0:
        return 0.0
    if braking < 1e-6:
        return time_to_contact / reaction
    return (math.sqrt(reaction**2 + 2.0 * braking * time_to_contact) - reaction) / braking
