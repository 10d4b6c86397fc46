"""Compliant following of a door or drawer whose joint is unknown, with a hand that holds its handle.

Position control shaped by the wrist's force (admittance: Hogan, "Impedance control", 1985); the direction is learned
from the path of the hand (Karayiannidis et al., "Model-free robot manipulation of doors and drawers by means of
fixed-grasps", ICRA 2013).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from bestman_bt.control.arm.guarded_move import StreamStep, ToolStream, check_positive
from bestman_bt.control.arm.joint_axis import AxisFitting, JointAxis, JointAxisEstimator
from bestman_bt.control.touch import WristWrench
from bestman_bt.messages import JointKind, MotionErrorCode, Pose
from hal.api import Motion

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class FollowGuide:
    """A planned path by arc length; ``ways`` (N,) metres, increasing.

    ``turns``: (N,) radians by which the hand has turned about the joint's axis since the grasp, positive along the
    path. ``postures``: (N, n) joint positions, tracked as far as the redundancy allows. ``held_at``: (3,) metres in the
    tool frame, the point of the hand that holds the handle, or touches the pushed part.
    """

    ways: Array
    turns: Array
    postures: Array
    held_at: Array = field(default_factory=lambda: np.zeros(3))

    def __post_init__(self) -> None:
        count = len(self.ways)
        if count < 2 or self.turns.shape != (count,) or len(self.postures) != count or np.any(np.diff(self.ways) <= 0):
            shapes = f"{self.ways.shape}, {self.turns.shape}, {self.postures.shape}"
            raise ValueError(f"a guide needs two or more increasing ways, each with a turn and a posture; got {shapes}")

    def turn(self, way: float) -> float:
        """Return the hand's rotation after ``way`` metres, radians."""
        return self._after(way, self.turns)

    def posture(self, way: float) -> Array:
        """Return the arm's posture (n,) after ``way`` metres."""
        return np.array([self._after(way, column) for column in self.postures.T])

    def _after(self, way: float, values: Array) -> float:
        """Interpolate; beyond the end, extrapolate, because the true way may be longer than planned."""
        beyond = max(0.0, way - self.ways[-1])
        slope = (values[-1] - values[-2]) / (self.ways[-1] - self.ways[-2])
        return float(np.interp(way, self.ways, values) + beyond * slope)


class FollowEnd(Enum):
    """The reason for the end of a constrained motion."""

    REACHED = "reached"
    LOCKED = "locked"  # the force limit was met before it moved
    JAMMED = "jammed"  # it moved, and then the force limit was met: jammed, or at its end
    GRIP_LOST = "grip lost"
    OBSTACLE = "obstacle"  # something pushes the hand aside
    ARM_LIMIT = "arm limit"  # a joint limit or a singularity is ahead
    TIMEOUT = "timeout"


@dataclass(frozen=True, eq=False)
class FollowedMotion:
    """The path of the hand, and the axis that it followed.

    ``axis``: in the base frame. ``distance``: metres along the line or arc. ``angle``: radians about the hinge, 0 for a
    line. ``peak_pull``, ``peak_side``: largest forces along and across the motion, N. ``tool``: base_from_tool at the
    end. ``turned``: radians by which the hand turned about the axis.
    """

    end: FollowEnd
    axis: JointAxis
    distance: float
    angle: float
    peak_pull: float
    peak_side: float
    tool: Pose
    turned: float


_CODES = {
    FollowEnd.LOCKED: MotionErrorCode.BLOCKED,
    FollowEnd.JAMMED: MotionErrorCode.BLOCKED,
    FollowEnd.GRIP_LOST: MotionErrorCode.GUARDED,
    FollowEnd.OBSTACLE: MotionErrorCode.COLLISION,
    FollowEnd.ARM_LIMIT: MotionErrorCode.UNREACHABLE,
    FollowEnd.TIMEOUT: MotionErrorCode.TIMEOUT,
}


_GAINED_TURN = (*(0.5**halved for halved in range(7)), 0.0)
"""Fractions of the requested change of the hand's turning speed to try in a period."""


@dataclass(frozen=True)
class Following:
    """Parameters of the compliant following. SI units.

    ``compliance``: m/s across the motion per newton, up to ``side_speed``. ``acceleration``: along it, m/s².
    ``force_filter``: time constant, seconds. ``stall_time``: without ``stall_distance`` of progress counts as stuck.
    ``moved``: distance beyond which a stuck joint is jammed, not locked. ``turn_speed``: rad/s of the hand.
    ``turn_lag``: radians by which the hand's turn may lag behind its guide at full speed; at twice as much the hand
    stops and turns. ``relax_time``: seconds of yielding to residual forces at the end. ``time_factor``: time limit as a
    multiple of the time at full speed. ``stop_speed``: m/s where an end stop is expected.
    """

    compliance: float = 2.5e-4
    side_speed: float = 0.03
    acceleration: float = 0.1
    force_filter: float = 0.06
    stall_time: float = 0.8
    stall_distance: float = 0.002
    moved: float = 0.015
    turn_speed: float = 0.6
    turn_lag: float = 0.1
    relax_time: float = 0.3
    time_factor: float = 4.0
    stop_speed: float = 0.01
    axis: AxisFitting = field(default_factory=AxisFitting)


@dataclass(frozen=True)
class FollowGoal:
    """Goal and limits of a constrained motion.

    It succeeds after ``distance`` metres along the path or ``angle`` radians about the estimated hinge, whichever is
    given and comes first. ``speed``: m/s. ``end_stop``: metres along the path from which on an end stop may be met, at
    ``Following.stop_speed``. ``max_pull``, ``max_side``: newtons along and across the motion. ``turn``: fraction of a
    door's rotation by which the hand rotates; at 0 the bar rotates between the fingers. ``guide``: a planned path of
    hand and arm, with priority over ``turn``. ``axis``: the believed joint axis, base frame, refined by the hand's path
    if ``learns`` is set (a pushing hand is not guided). Raises ValueError for invalid values.
    """

    speed: float = 0.06
    distance: float = math.inf
    angle: float = math.inf
    end_stop: float = math.inf
    max_pull: float = 45.0
    max_side: float = 40.0
    turn: float = 1.0
    guide: FollowGuide | None = None
    axis: JointAxis | None = None
    learns: bool = True

    def __post_init__(self) -> None:
        check_positive(
            speed=self.speed,
            distance=self.distance,
            angle=self.angle,
            max_pull=self.max_pull,
            max_side=self.max_side,
        )
        if math.isinf(self.distance) and math.isinf(self.angle):
            raise ValueError("a constrained motion needs a distance or an angle at which it ends")


class ConstraintFollowing:
    """A running constrained motion; ``tick`` is called every period of the stream until it returns False."""

    def __init__(
        self,
        stream: ToolStream,
        wrist: WristWrench,
        direction: Array,
        goal: FollowGoal,
        motion: Motion[FollowedMotion],
        grip: Callable[[], str | None] | None = None,
        hint: JointKind | None = None,
        following: Following = Following(),
    ) -> None:
        self._stream, self._wrist, self._goal, self._motion, self._grip = stream, wrist, goal, motion, grip
        self._following = following
        self._held_at = np.zeros(3) if goal.guide is None else goal.guide.held_at
        self._start = self._held(stream.measured())
        self._estimator = JointAxisEstimator(direction, self._start, hint, self._following.axis, goal.axis, goal.learns)
        self._force: Array = np.zeros(3)
        self._speed = self._turn = self._turned = self._time = 0.0
        self._peak = np.zeros(2)
        self._progress, self._progress_at = 0.0, 0.0
        self._ending: tuple[FollowEnd, str, float] | None = None

    def tick(self) -> bool:
        """Run one period; return False when the motion has ended and the arm should stop."""
        self._time += self._stream.step_time
        tool = self._stream.measured()
        self._feel(tool)
        if self._ending is not None:
            return self._relax(tool)
        held = self._held(tool)
        self._estimator.add(held)
        axis = self._estimator.axis
        tangent = axis.tangent(held)
        pull = -float(self._force @ tangent)
        side = self._force + pull * tangent
        self._peak = np.maximum(self._peak, [pull, float(np.linalg.norm(side))])
        travelled = axis.travelled(self._start, held)
        found = self._why_to_end(held, pull, float(np.linalg.norm(side)), travelled)
        if found is None:
            found = self._advance(held, tangent, side, pull)
        if found is not None:
            if found[0] is FollowEnd.GRIP_LOST:
                self._finish(*found, tool)
                return False
            self._ending = (*found, self._time)
        return True

    def _feel(self, tool: Pose) -> None:
        period = self._stream.streaming.period
        share = period / (period + self._following.force_filter)
        self._force = self._force + share * (self._wrist.contact_at(tool).force - self._force)

    def _why_to_end(self, held: Array, pull: float, side: float, travelled: float) -> tuple[FollowEnd, str] | None:
        goal, p = self._goal, self._following
        lost = None if self._grip is None else self._grip()
        if lost is not None:
            return FollowEnd.GRIP_LOST, f"{lost} after {travelled:.3f} m"
        if self._remaining(held) <= 0.0:
            return FollowEnd.REACHED, ""
        if side > goal.max_side:
            return FollowEnd.OBSTACLE, f"{side:.0f} N push the hand aside after {travelled:.3f} m"
        if travelled > self._progress + p.stall_distance:
            self._progress, self._progress_at = travelled, self._time
        if pull > goal.max_pull or self._time - self._progress_at > p.stall_time:
            force = f"{pull:.0f} N (at most {goal.max_pull:.0f} N are allowed)"
            if travelled < p.moved:
                return FollowEnd.LOCKED, f"it does not move at {force}: locked, or held shut"
            return FollowEnd.JAMMED, f"it moved {travelled:.3f} m and no further at {force}: jammed, or at its end"
        way = min(goal.distance, goal.angle * p.axis.longest_radius)
        if self._time > p.time_factor * way / goal.speed + 5.0:
            return FollowEnd.TIMEOUT, f"{travelled:.3f} m in {self._time:.0f} s"
        return None

    def _held(self, tool: Pose) -> Array:
        """Return the position (3,), base frame, of the point that is guided along the way."""
        held: Array = tool.apply(self._held_at[None])[0]
        return held

    def _remaining(self, held: Array) -> float:
        """Return the remaining length of the way, metres."""
        axis = self._estimator.axis
        left = self._goal.distance - axis.travelled(self._start, held)
        if axis.kind == "revolute":
            left = min(left, (self._goal.angle - axis.angle(self._start, held)) * axis.radius)
        return left

    def _advance(self, held: Array, tangent: Array, side: Array, pull: float) -> tuple[FollowEnd, str] | None:
        goal, p, time = self._goal, self._following, self._stream.step_time
        braking = math.sqrt(2.0 * p.acceleration * max(self._remaining(held), 1e-5))
        before_stop = goal.end_stop - self._estimator.axis.travelled(self._start, held)
        touching = math.sqrt(p.stop_speed**2 + 2.0 * p.acceleration * max(0.0, before_stop))
        # The closer to the force limit, the slower, so that nothing locked is pulled at harder.
        yielding = goal.speed * min(1.0, max(0.0, 2.0 * (1.0 - pull / goal.max_pull)))
        speed = min(goal.speed, braking, touching, yielding) * self._kept_up(held)
        self._speed = min(self._speed + p.acceleration * time, speed)
        posture = self._posture(held)
        for slower in (1.0, 0.5, 0.2):
            velocity = slower * self._speed * tangent + self._giving_way(side)
            for turn in self._turns(held, slower):
                step = self._stream.send(self._next_pose(velocity, turn), posture)
                if step is StreamStep.SENT:
                    self._turn = turn
                    self._turned += turn
                    return None
        return FollowEnd.ARM_LIMIT, "the arm can go no further: a joint limit or a singularity is ahead"

    def _giving_way(self, force: Array) -> Array:
        velocity = self._following.compliance * force
        return velocity * min(1.0, self._following.side_speed / max(float(np.linalg.norm(velocity)), 1e-9))

    def _wanted_turn(self, held: Array) -> float:
        """Return the rotation of the hand since the grasp that belongs to this place of the way, radians."""
        axis, guide = self._estimator.axis, self._goal.guide
        if guide is not None:
            return guide.turn(axis.travelled(self._start, held))
        return self._goal.turn * axis.angle(self._start, held)

    def _kept_up(self, held: Array) -> float:
        """Return the fraction of the speed along a guide that the hand may keep, 0 to 1, by how far its turn lags
        behind.

        The guide's postures were checked for collisions with the turns that belong to them.
        """
        if self._goal.guide is None or self._estimator.axis.kind != "revolute":
            return 1.0
        lag = abs(self._wanted_turn(held) - self._turned)
        return float(np.clip(2.0 - lag / self._following.turn_lag, 0.0, 1.0))

    def _turns(self, held: Array, slower: float) -> tuple[float, ...]:
        """Return the rotations of the hand to try in this period, radians.

        First the wanted one, then those between it and the last one, because the joints accelerate; at last none.
        """
        if self._estimator.axis.kind != "revolute":
            return (0.0,)
        most = slower * self._following.turn_speed * self._stream.step_time
        wanted = float(np.clip(self._wanted_turn(held) - self._turned, -most, most))
        towards = [self._turn + share * (wanted - self._turn) for share in _GAINED_TURN]
        return tuple(dict.fromkeys((*towards, 0.0)))

    def _posture(self, held: Array) -> Array | None:
        guide, axis = self._goal.guide, self._estimator.axis
        return None if guide is None else guide.posture(axis.travelled(self._start, held))

    def _next_pose(self, velocity: Array, turn: float) -> Pose:
        pose, axis = self._stream.pose, self._estimator.axis.direction
        rotation = Pose(np.zeros(3), np.append(math.sin(turn / 2) * axis, math.cos(turn / 2)))
        turned = rotation @ Pose(np.zeros(3), pose.quaternion)
        held = self._held(pose) + velocity * self._stream.step_time
        return Pose(held - turned.rotation @ self._held_at, turned.quaternion)

    def _relax(self, tool: Pose) -> bool:
        assert self._ending is not None
        end, text, since = self._ending
        if self._time - since < self._following.relax_time:
            self._stream.send(self._next_pose(self._giving_way(self._force), 0.0))
            return True
        self._finish(end, text, tool)
        return False

    def _finish(self, end: FollowEnd, text: str, tool: Pose) -> None:
        axis, start, held = self._estimator.axis, self._start, self._held(tool)
        distance, angle = axis.travelled(start, held), axis.angle(start, held)
        pull, side = (float(value) for value in self._peak)
        followed = FollowedMotion(end, axis, distance, angle, pull, side, tool, self._turned)
        if end is FollowEnd.REACHED:
            self._motion.succeed(followed)
        else:
            self._motion.fail(_CODES[end], text, followed)
