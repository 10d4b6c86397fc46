"""Executes action chunks as one continuous motion: each is blended into the previous one.

Where two chunks overlap in time, the weight of the older one falls from 1 to 0: the temporal ensembling of Zhao et al.
(ACT, RSS 2023), with weights along the chunk as in Black et al., "Real-time execution of action chunking flow
policies", NeurIPS 2025. Between waypoints the motion is ruckig's, within velocity, acceleration and jerk limits.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np
import ruckig
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from bestman_bt.manipulation.joint_values import JointLimits, joint_path, joint_vector
from bestman_bt.manipulation.kinematics.base import InverseKinematics
from bestman_bt.manipulation.policy.base import ActionChunk
from bestman_bt.manipulation.policy.errors import PolicyActionError, StaleChunkError
from bestman_bt.manipulation.policy.specification import ActionSpace
from bestman_bt.manipulation.trajectory.base import SpeedScale
from bestman_bt.messages import JointTrajectory, Pose
from bestman_bt.messages.shapes import Positive


def chunk_path(
    chunk: ActionChunk, start: NDArray[np.float64], kinematics: InverseKinematics, limits: JointLimits
) -> NDArray[np.float64]:
    """Return (H + 1, n) radians: ``start`` (n,), then the target after each action, within the joint limits.

    Raises PolicyActionError if the number of columns differs from the number of joints, or the arm cannot follow a
    twist.
    """
    count = len(limits.joint_names)
    start = joint_vector(start, count, "start")
    if chunk.space is ActionSpace.TOOL_TWIST:
        path = _along_twists(chunk, start, kinematics)
    elif chunk.actions.shape[1] != count:
        raise PolicyActionError(f"the arm has {count} joints but the actions have {chunk.actions.shape[1]} columns")
    elif chunk.space is ActionSpace.JOINT_DELTAS:
        path = start + np.concatenate([np.zeros((1, count)), np.cumsum(chunk.actions, axis=0)])
    else:
        path = np.concatenate([start[None], chunk.actions])
    path[1:] = np.clip(path[1:], limits.lower, limits.upper)
    return path


def _along_twists(chunk: ActionChunk, start: NDArray[np.float64], kinematics: InverseKinematics) -> NDArray[np.float64]:
    path = [start]
    tool = kinematics.tool_pose(start)
    for i, twist in enumerate(chunk.actions):
        turn = Rotation.from_rotvec(twist[3:] * chunk.dt) * Rotation.from_quat(tool.quaternion)
        tool = Pose(tool.position + twist[:3] * chunk.dt, turn.as_quat())
        positions = kinematics.track(tool, path[-1])
        if positions is None:
            raise PolicyActionError(f"the arm cannot follow the tool twist of action {i + 1} of {len(chunk.actions)}")
        path.append(positions)
    return np.array(path)


Array = NDArray[np.float64]
MAX_SLOWDOWN = 20.0
"""Largest slowdown of a chunk; beyond it, the chunk is a jump and not a motion."""
_INSIDE = 1.0 - 1e-6
_JERK_SHARE = 0.95
"""Fraction of the jerk limits used in planning, because samples of a motion give its jerk only to a few percent."""
_TARGET_SHARE = 0.9
"""Fraction of the limits that a waypoint may require: ruckig needs a margin to arrive in time."""
_MARGIN = 0.03
"""Distance of waypoints from the joint limits, rad: the motion may overshoot slightly between them."""
_SWING = 0.01
"""Largest overshoot of a joint beyond the end of the chunk, rad."""
_CREEP = 0.02
"""Speed at which a joint may always move, rad/s."""
_IN_TIME = 1e-3
"""Largest delay of the motion at a waypoint, seconds."""


@dataclass(frozen=True, eq=False)
class StreamState:
    """The commanded state of the arm: positions, velocities and accelerations, each (n,)."""

    positions: Array
    velocities: Array
    accelerations: Array


@dataclass(frozen=True, eq=False)
class StreamedMotion:
    """A motion from the clock's ``start`` to rest; ``accelerations``: (N, n) at its samples.

    ``intended``: the motion of the chunks, from the clock's ``said``, without the final braking.
    """

    start: float
    trajectory: JointTrajectory
    accelerations: Array
    said: float
    intended: JointTrajectory

    @property
    def end(self) -> float:
        """The time of the clock at which the motion ends at rest."""
        return self.start + self.trajectory.duration

    def state(self, time: float) -> StreamState:
        """Return the state at ``time`` by the clock; at rest after the end."""
        positions, velocities = self.trajectory.sample(time - self.start)
        times = self.trajectory.times + self.start
        accelerations = np.array([np.interp(time, times, column) for column in self.accelerations.T])
        return StreamState(positions, velocities, accelerations * (time < self.end))


@dataclass(eq=False)
class ChunkStream:
    """The current motion, and its continuation by the next chunk.

    ``splice`` proposes a motion; nothing changes until ``accept``, so that the proposal can be checked first. Every
    accepted motion ends at rest: an arm whose policy stops answering comes to rest.

    ``speed``: fraction of the arm's limits. ``jerk_time``: seconds from rest to full acceleration. ``blend``: seconds
    in which the weight of the current chunk falls to 0. ``period``: time between samples, seconds.
    """

    limits: JointLimits
    speed: SpeedScale = field(default_factory=lambda: SpeedScale(0.5, 0.35))
    jerk_time: Positive = 0.1
    blend: Positive = 0.4
    period: Positive = 0.02
    motion: StreamedMotion | None = field(default=None, init=False)

    def __post_init__(self) -> None:
        self._speed = self.limits.velocity * self.speed.velocity
        self._acceleration = self.limits.acceleration * self.speed.acceleration
        self.jerk_limits = self._acceleration / self.jerk_time
        """(n,) rad/s³."""
        self._jerk = _JERK_SHARE * self.jerk_limits
        self._ruckig = ruckig.Ruckig(len(self.limits.joint_names))

    def moving(self, time: float) -> bool:
        """Return whether a motion is executing at ``time``."""
        return self.motion is not None and time < self.motion.end - 1e-9

    def splice(self, path: Array, dt: float, seen: float, at: float) -> StreamedMotion:
        """Return the motion that starts at the clock's ``at``: first like the current one, then along ``path``, then to
        rest.

        ``path``: (H + 1, n) radians, ``dt`` seconds apart, from ``seen``, the time of the observation. It is stretched
        if it exceeds the limits. Raises PolicyActionError if it would take 20 times as long or leave the joints' range,
        StaleChunkError if it is already over.
        """
        path = joint_path(path, len(self.limits.joint_names), "path")
        times: Array = seen + dt * np.arange(len(path), dtype=np.float64)
        if self.moving(seen) and self.motion is not None:
            state = self.motion.state(at)
            waypoints = np.array([self._blended(point, t, at) for point, t in zip(path, times, strict=True)])
        else:
            # What was seen at rest is true whenever it begins.
            times = times + (at - seen)
            state = StreamState(path[0], np.zeros(path.shape[1]), np.zeros(path.shape[1]))
            waypoints = path
        ahead = times > at + 0.5 * dt
        if not ahead.any():
            raise StaleChunkError(f"the chunk of {dt * (len(path) - 1):.2f} s is over before it could begin")
        lower = np.minimum(self.limits.lower + _MARGIN, state.positions)
        upper = np.maximum(self.limits.upper - _MARGIN, state.positions)
        waypoints = np.clip(waypoints[ahead], lower, upper)
        waypoints = np.vstack([state.positions, waypoints])
        passing: Array = np.concatenate([[at], times[ahead]])
        slowdown = self._slowdown(passing, waypoints)
        if slowdown > MAX_SLOWDOWN:
            raise PolicyActionError(f"the chunk jumps: within the limits it would take {slowdown:.0f} times its time")
        return self._timed((passing - at) * slowdown, waypoints, state, at)

    def accept(self, spliced: StreamedMotion, now: float) -> JointTrajectory:
        """Accept the proposal; returns the trajectory that starts at ``now``: the current motion, then the proposal.

        Raises StaleChunkError if it is too late.
        """
        if self.motion is None or not self.moving(min(now, spliced.start)):
            # At rest, a late start changes nothing.
            said = spliced.said + now - spliced.start
            self.motion = replace(spliced, start=now, said=said)
            return spliced.trajectory
        if spliced.start < now - 1e-9:
            raise StaleChunkError(f"the motion should have begun {now - spliced.start:.3f} s ago")
        old, new, wait = self.motion, spliced.trajectory, spliced.start - now
        if wait > 1e-6:
            between = old.trajectory.times - (now - old.start)
            marks = np.concatenate([[0.0], between[(between > 1e-6) & (between < wait - 1e-6)]])
            states = [old.state(now + float(mark)) for mark in marks]
            joined = JointTrajectory(
                new.joint_names,
                np.concatenate([marks, new.times + wait]),
                np.vstack([[state.positions for state in states], new.positions]),
                np.vstack([[state.velocities for state in states], new.velocities]),
            )
            accelerations = np.vstack([[state.accelerations for state in states], spliced.accelerations])
        else:
            joined, accelerations = new, spliced.accelerations
        self.motion = replace(spliced, start=now, trajectory=joined, accelerations=accelerations)
        return joined

    def _blended(self, point: Array, time: float, at: float) -> Array:
        assert self.motion is not None
        said, intended = self.motion.said, self.motion.intended
        overlap = min(self.blend, said + intended.duration - at)
        u = 1.0 if overlap <= 0.0 else min(max((time - at) / overlap, 0.0), 1.0)
        share = u * u * (3.0 - 2.0 * u)
        blended: Array = share * point + (1.0 - share) * intended.sample(time - said)[0]
        return blended

    def _slowdown(self, times: Array, waypoints: Array) -> float:
        velocities = np.diff(waypoints, axis=0) / np.diff(times)[:, None]
        turns = np.diff(velocities[1:], axis=0) / np.diff(times)[2:, None]
        fastest = float((np.abs(velocities) / self._speed).max())
        hardest = float((np.abs(turns) / self._acceleration).max()) if len(turns) else 0.0
        return max(1.0, fastest / _TARGET_SHARE, math.sqrt(hardest / _TARGET_SHARE))

    def _timed(self, times: Array, waypoints: Array, state: StreamState, at: float) -> StreamedMotion:
        """Time the motion with Ruckig from waypoint to waypoint, each passed in motion; ``times`` count from ``at``."""
        targets, last = self._targets(times, waypoints, state), len(times) - 1
        braking = self._braking(times, targets)
        now, late, index = 0.0, 0.0, 1
        sampled: list[tuple[float, StreamState]] = [(0.0, state)]
        while index <= last:
            best: tuple[float, int, ruckig.Trajectory] | None = None
            for ahead, target in self._choices(targets, index, braking):
                span = float(times[ahead]) + late - now
                segment = self._segment(sampled[-1][1], target, span, braking=ahead == last)
                if segment is not None and (best is None or segment.duration - span < best[0] - 1e-3):
                    best = segment.duration - span, ahead, segment
                if best is not None and best[0] < _IN_TIME:
                    break
            if best is None:
                raise PolicyActionError("no motion within the limits continues along the chunk")
            lateness, reached, segment = best
            late += max(0.0, lateness)
            count = max(1, math.ceil(segment.duration / self.period - 1e-9))
            for k in range(1, count + 1):
                time = segment.duration * k / count
                position, velocity, acceleration = segment.at_time(time)
                sampled.append((now + time, StreamState(*map(np.array, (position, velocity, acceleration)))))
            now, index = now + segment.duration, reached + 1
        return self._motion(sampled, at, times, targets)

    def _choices(self, targets: list[StreamState], index: int, braking: int) -> Iterator[tuple[int, StreamState]]:
        """The next targets: waypoints up to the point where it brakes for its end, the nearest first; last, the end
        directly.

        To be in time at a waypoint may need a turn back and a new run-up; a later one, or one that is passed without
        acceleration, may not.
        """
        for ahead in range(index, braking + 1):
            yield ahead, targets[ahead]
            yield ahead, replace(targets[ahead], accelerations=np.zeros_like(targets[ahead].accelerations))
        yield len(targets) - 1, targets[-1]

    def _braking(self, times: Array, targets: list[StreamState]) -> int:
        """Return the last waypoint from which the motion can come to rest at the end of the chunk without passing
        it.
        """
        end = targets[-1]
        for index in range(len(targets) - 2, 0, -1):
            segment = self._segment(targets[index], end, float(times[-1] - times[index]), braking=True)
            if segment is None:
                continue
            ends = np.sort([targets[index].positions, end.positions], axis=0)
            extrema = np.array([(extremum.min, extremum.max) for extremum in segment.position_extrema]).T
            if np.all(extrema[0] >= ends[0] - _SWING) and np.all(extrema[1] <= ends[1] + _SWING):
                return index
        return 0

    def _targets(self, times: Array, waypoints: Array, start: StreamState) -> list[StreamState]:
        """Waypoints with the velocities and accelerations at which they are passed; the last one at rest."""
        velocities = np.zeros(waypoints.shape)
        velocities[0] = start.velocities
        spans = np.diff(times)[:, None]
        slopes = np.diff(waypoints, axis=0) / spans
        velocities[1:-1] = (slopes[:-1] * spans[1:] + slopes[1:] * spans[:-1]) / (spans[:-1] + spans[1:])
        accelerations = np.zeros(waypoints.shape)
        accelerations[1:-1] = 2.0 * (slopes[1:] - slopes[:-1]) / (spans[:-1] + spans[1:])
        accelerations[1:-1] = np.clip(
            accelerations[1:-1], -_TARGET_SHARE * self._acceleration, _TARGET_SHARE * self._acceleration
        )
        # Beyond this velocity the acceleration could not be taken back before the limit is met.
        room = (self._speed - accelerations**2 / (2.0 * self._jerk)) * _INSIDE
        velocities[1:] = np.clip(velocities[1:], -room[1:], room[1:])
        return [StreamState(*row) for row in zip(waypoints, velocities, accelerations, strict=True)]

    def _segment(
        self, start: StreamState, target: StreamState, span: float, braking: bool = False
    ) -> ruckig.Trajectory | None:
        """Return the motion from state to state in ``span`` seconds, or later; ``braking``: never quicker than it
        began.
        """
        request = ruckig.InputParameter(len(start.positions))
        # Ruckig fails on numbers as small as rounding errors: each state is rounded to what has a meaning.
        start, target = _rounded(start), _rounded(target)
        request.current_position, request.target_position = start.positions.tolist(), target.positions.tolist()
        request.current_velocity, request.target_velocity = start.velocities.tolist(), target.velocities.tolist()
        request.current_acceleration = start.accelerations.tolist()
        request.target_acceleration = target.accelerations.tolist()
        speed = self._speed
        if braking:
            began = np.abs(start.velocities) + start.accelerations**2 / (2.0 * self._jerk)
            least = np.abs(target.positions - start.positions) / max(span, 1e-3)
            speed = np.clip(1.01 * np.maximum(began, least) + _CREEP, None, self._speed)
        request.max_velocity, request.max_acceleration = speed.tolist(), self._acceleration.tolist()
        request.max_jerk = self._jerk.tolist()
        request.minimum_duration = max(span, 1e-3)
        segment = ruckig.Trajectory(len(start.positions))
        try:
            result = self._ruckig.calculate(request, segment)
        except ruckig.RuckigError:
            return None
        return segment if result in (ruckig.Result.Working, ruckig.Result.Finished) else None

    def _motion(
        self, sampled: list[tuple[float, StreamState]], at: float, times: Array, targets: list[StreamState]
    ) -> StreamedMotion:
        names, limits = self.limits.joint_names, self.limits
        trajectory = JointTrajectory(
            names,
            np.array([time for time, _ in sampled]),
            np.array([state.positions for _, state in sampled]),
            np.array([state.velocities for _, state in sampled]),
        )
        outside = np.maximum(limits.lower - trajectory.positions, trajectory.positions - limits.upper).max(axis=0)
        worst = int(np.argmax(outside))
        if outside[worst] > 0.0:
            raise PolicyActionError(f"along the chunk {names[worst]} would pass its limit by {outside[worst]:.4f}")
        accelerations = np.array([state.accelerations for _, state in sampled])
        points = np.array([target.positions for target in targets])
        velocities = np.array([target.velocities for target in targets])
        velocities[-1] = (points[-1] - points[-2]) / (times[-1] - times[-2])
        return StreamedMotion(at, trajectory, accelerations, at, JointTrajectory(names, times, points, velocities))


def _rounded(state: StreamState) -> StreamState:
    return StreamState(*(np.round(values, 9) for values in (state.positions, state.velocities, state.accelerations)))
