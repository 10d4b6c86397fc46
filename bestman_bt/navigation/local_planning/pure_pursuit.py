"""Regulated pure pursuit (Macenski et al. 2023, after Coulter 1992) for bases that turn in place.

The path is driven leg by leg: at a sharp corner, or a change of driving direction, the base stops and turns.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from typing_extensions import override

from bestman_bt.messages import Path2D, Pose2D, Twist2D, wrap_angle
from bestman_bt.messages.shapes import NonNegative, NotBelow, Positive, check_bounds
from bestman_bt.navigation.global_planning.costmap import Costmap
from bestman_bt.navigation.local_planning.base import FollowerCommand, PathFollower
from bestman_bt.navigation.local_planning.rotate_to_heading import (
    RotateToHeading,
    densified,
    first_nearest,
    metres_left,
)

_SPACING = 0.02


@dataclass(frozen=True, eq=False)
class _Leg:
    """A smooth piece of the path: dense ``points`` (N, 2), ``arc`` (N,) metres to its end, driving direction."""

    points: NDArray[np.float64]
    arc: NDArray[np.float64]
    reverse: bool

    @property
    def end_direction(self) -> NDArray[np.float64]:
        delta: NDArray[np.float64] = self.points[-1] - self.points[-2]
        return delta / float(np.linalg.norm(delta))

    @property
    def start_heading(self) -> float:
        dx, dy = self.points[1] - self.points[0]
        return math.atan2(dy, dx) + (math.pi if self.reverse else 0.0)


@dataclass(eq=False)
class PurePursuit(PathFollower):
    """Steers to a point ahead on the path; deterministic.

    Lengths in metres, speeds in m/s and rad/s, accelerations in m/s² and rad/s².

    ``max_speed``, ``max_turn_rate``, ``acceleration``, ``turn_acceleration``: maxima, also limited by the base.
    ``creep_speed``: minimum until the end is reached. ``still``: below it the base counts as at rest.
    ``lookahead_time``: seconds driven to the target point, between ``min_lookahead`` and ``max_lookahead``.
    ``lateral_acceleration``: limits the speed in curves. ``deceleration``: for the planned stop at the end; it brakes
    with at most twice that, before the end of a leg with twice the ``acceleration``. ``corner``: radians between two
    segments above which the base stops and turns. ``leg_heading_tolerance``: radians, at which such a turn ends.
    ``position_tolerance``: along the path, at the end of a leg.
    """

    max_speed: Annotated[Positive, "m/s"] = 0.6
    max_turn_rate: Annotated[Positive, "rad/s"] = 1.2
    acceleration: Annotated[Positive, "m/s²"] = 0.5
    deceleration: Annotated[Positive, "m/s²"] = 0.35
    lateral_acceleration: Annotated[Positive, "m/s²"] = 0.4
    turn_acceleration: Annotated[Positive, "rad/s²"] = 2.0
    creep_speed: Annotated[Positive, "m/s"] = 0.015
    lookahead_time: Annotated[Positive, "s"] = 0.6
    min_lookahead: Annotated[Positive, "m"] = 0.2
    max_lookahead: Annotated[Positive, NotBelow("min_lookahead"), "m"] = 0.4
    corner: Annotated[NonNegative, "rad"] = 0.6
    leg_heading_tolerance: Annotated[NonNegative, "rad"] = 0.03
    position_tolerance: Annotated[NonNegative, "m"] = 0.003
    still: Annotated[Positive, "m/s"] = 0.02
    turning: RotateToHeading = field(default_factory=RotateToHeading)

    def __post_init__(self) -> None:
        check_bounds(self)
        self._legs: list[_Leg] | None = None
        self._turning = self._fresh = False
        self._turn_heading = self._goal_heading = 0.0
        self._speed = self._turn_rate = 0.0
        self._rolling = Twist2D()
        self._at = 0

    @override
    def reset(self, path: Path2D, costmap: Costmap | None = None) -> None:
        if len(path.points) == 0:
            raise ValueError("PurePursuit path should have at least one point but has none")
        self._legs = _split(path, self.corner)
        self._goal_heading = path.goal.theta
        self._speed = self._turn_rate = 0.0
        self._rolling = Twist2D()
        self._fresh = True
        self._begin_leg()

    @override
    def compute(self, pose: Pose2D, velocity: Twist2D, dt: float) -> FollowerCommand:
        if self._legs is None:
            raise RuntimeError("PurePursuit.compute was called before reset")
        if self._fresh:
            self._fresh = False
            self._take_over(pose, velocity)
        if self._rolling != Twist2D():
            return FollowerCommand(self._brake(dt), False, self._remaining())
        if self._turning:
            turn_rate = self.turning.turn_rate
            command = self.turning.compute(pose, velocity, dt)
            left = abs(wrap_angle(self._turn_heading - pose.theta))
            if self._legs and left < self.leg_heading_tolerance and abs(command.twist.wz) < 0.15:
                self._turning, self._turn_rate = False, turn_rate
            elif not self._legs and command.done:
                return command
            else:
                return FollowerCommand(command.twist, False, self._remaining())
        twist, ended = self._drive(pose, velocity, dt)
        if ended:
            self._legs.pop(0)
            self._begin_leg()
        return FollowerCommand(twist, False, self._remaining())

    def _take_over(self, pose: Pose2D, velocity: Twist2D) -> None:
        """Continue if the base already drives about along the path; else it has to come to rest first."""
        leg = self._legs[0] if self._legs else None
        along = -velocity.vx if leg is not None and leg.reverse else velocity.vx
        ahead = leg is not None and abs(wrap_angle(leg.start_heading - pose.theta)) < self.corner
        if ahead and along > self.still and abs(velocity.vy) < self.still:
            self._turning = False
            self._speed, self._turn_rate = min(along, self.max_speed), velocity.wz
        elif math.hypot(velocity.vx, velocity.vy) > self.still:
            self._rolling, self._turn_rate = velocity, velocity.wz
        elif abs(velocity.wz) > self.turning.still:
            self.turning.turn_to(self._turn_heading, velocity.wz)

    def _brake(self, dt: float) -> Twist2D:
        """Return the next command on the way to rest."""
        speed = math.hypot(self._rolling.vx, self._rolling.vy)
        share = max(0.0, 1.0 - 2.0 * self.deceleration * dt / speed)
        self._steer(0.0, dt)
        twist = Twist2D(share * self._rolling.vx, share * self._rolling.vy, self._turn_rate)
        self._rolling = twist if share else Twist2D()
        if not share:
            self.turning.turn_to(self._turn_heading, self._turn_rate)
        return twist

    def _begin_leg(self) -> None:
        assert self._legs is not None
        self._at = 0
        self._turning = True
        self._turn_heading = self._legs[0].start_heading if self._legs else self._goal_heading
        self.turning.turn_to(self._turn_heading)

    def _remaining(self) -> float:
        assert self._legs is not None
        if not self._legs:
            return 0.0
        return float(self._legs[0].arc[self._at] + sum(leg.arc[0] for leg in self._legs[1:]))

    def _drive(self, pose: Pose2D, velocity: Twist2D, dt: float) -> tuple[Twist2D, bool]:
        """Return the command along the present leg, and whether its end is reached."""
        assert self._legs is not None
        leg = self._legs[0]
        position = pose.xy
        self._at += first_nearest(leg.points[self._at : self._at + 30], position, _SPACING)
        direction = leg.end_direction
        remaining = float(leg.arc[self._at])
        if remaining < 0.3:
            remaining = float((leg.points[-1] - position) @ direction)
        if remaining < self.position_tolerance:
            self._speed = max(0.0, self._speed - self.acceleration * dt * 2.0)
            self._steer(0.0, dt)
            stopped = self._speed == self._turn_rate == 0.0 and abs(velocity.vx) < self.still
            return self._twist(leg), stopped

        lookahead = min(max(self.lookahead_time * self._speed, self.min_lookahead), self.max_lookahead)
        ahead = int(np.searchsorted(-leg.arc, lookahead - leg.arc[self._at]))
        if ahead < len(leg.points):
            target = leg.points[ahead]
        else:
            # Beyond the end the last segment goes on, so that the base arrives along it.
            target = leg.points[-1] + direction * (lookahead - max(0.0, remaining))
        offset = target - position
        bearing = wrap_angle(math.atan2(offset[1], offset[0]) - pose.theta - (math.pi if leg.reverse else 0.0))
        curvature = 2.0 * math.sin(bearing) / max(float(np.linalg.norm(offset)), self.min_lookahead / 2)

        speed = min(self.max_speed, max(self.creep_speed, math.sqrt(2.0 * self.deceleration * remaining)))
        if curvature:
            speed = min(
                speed, self.max_turn_rate / abs(curvature), math.sqrt(self.lateral_acceleration / abs(curvature))
            )
        if abs(bearing) > math.pi / 3:
            speed = self.creep_speed
        self._speed += min(max(speed - self._speed, -2.0 * self.deceleration * dt), self.acceleration * dt)
        self._steer(min(max(self._speed * curvature, -self.max_turn_rate), self.max_turn_rate), dt)
        return self._twist(leg), False

    def _steer(self, turn_rate: float, dt: float) -> None:
        change = self.turn_acceleration * dt
        self._turn_rate += min(max(turn_rate - self._turn_rate, -change), change)

    def _twist(self, leg: _Leg) -> Twist2D:
        return Twist2D(vx=-self._speed if leg.reverse else self._speed, wz=self._turn_rate)


def _split(path: Path2D, corner: float) -> list[_Leg]:
    """Cut a path at sharp corners and at changes of the driving direction."""
    points, reverse = path.points, path.reverse
    if len(points) < 2:
        return []
    deltas = np.diff(points, axis=0)
    headings = np.arctan2(deltas[:, 1], deltas[:, 0])
    legs: list[_Leg] = []
    first = 0
    for i in range(1, len(points)):
        last = i == len(points) - 1
        if last or reverse[i] != reverse[i - 1] or abs(wrap_angle(headings[i] - headings[i - 1])) > corner:
            dense = densified(points[first : i + 1], _SPACING)
            arc = metres_left(dense)
            if arc[0] > 0.0:
                legs.append(_Leg(dense, arc, bool(reverse[i - 1])))
            first = i
    return legs
