"""Joints over a channel: every command becomes a stream of set-points within the limits."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from typing_extensions import override

from bestman_bt.messages import JointTrajectory, MotionObstacle, MotionStage
from bestman_bt.robot_model.model import JointedModel
from hal.api import Failure, JointGroup, Motion, MotionErrorCode, MotionStatus
from hal.parts.channels import JointChannel, StoppablePart
from hal.parts.gate import SetpointGate, ToolLimits
from hal.parts.part_connection import ConnectionFailedError, refusal
from hal.parts.setpoints import Brake, BrakeThenMove, Drift, Hold, Reach, Setpoints, Stream, Trapezoid
from hal.parts.stop_latch import StopLatch
from hal.parts.time_scale import TimeScale

Array = NDArray[np.float64]
OUTSIDE = 0.01
"""Radians or metres by which a joint may be outside its range when connecting."""
SHORTEST = 1e-5
"""Shortest cycle time that counts, seconds."""
TRACED = (
    "asked position",
    "set position",
    "set velocity",
    "measured position",
    "measured velocity",
    "measured effort",
)
"""Traced values of joints: requested, admitted by the gate, and measured."""
SLOWEST = 0.01
"""Time scale below which joints count as at rest."""
AT_REST = 1e-3
"""Fraction of their top speed below which joints count as held at rest by the gate."""
START_TOLERANCE = 0.05
"""Largest distance of a trajectory's start from the measured positions, radians."""
SPEED_TOLERANCE = 1.02
"""Fraction of the speed limits up to which samples and streamed set-points are accepted."""


class JointCommandChecks:
    """Checks of the commands of a group of joints; they raise CommandRefusedError."""

    def __init__(self, part_name: str, model: JointedModel) -> None:
        self._part_name, self._model = part_name, model

    def positions(self, command: str, values: ArrayLike) -> Array:
        """Return ``values`` as positions (n,). Raises CommandRefusedError beyond a limit."""
        return self._within(command, "positions", values, self._model.lower, self._model.upper)

    def velocities(self, command: str, values: ArrayLike) -> Array:
        """Return ``values`` as velocities (n,). Raises CommandRefusedError beyond a limit."""
        return self._within(command, "velocities", values, -self._model.velocity, self._model.velocity)

    def efforts(self, command: str, values: ArrayLike) -> Array:
        """Return ``values`` as efforts (n,). Raises CommandRefusedError beyond a limit."""
        return self._within(command, "efforts", values, -self._model.effort, self._model.effort)

    def one_kind(self, command: str, *kinds: ArrayLike | None) -> None:
        """Raise CommandRefusedError unless exactly one of the kinds of set-point is given."""
        given = sum(kind is not None for kind in kinds)
        if given != 1:
            raise refusal(
                self._part_name, command, f"exactly one of positions, velocities, efforts should be given, got {given}"
            )

    def speed_scale(self, command: str, scale: float) -> float:
        """Return ``scale``, a fraction of the limits. Raises CommandRefusedError outside (0, 1]."""
        if not (np.isfinite(scale) and 0.0 < scale <= 1.0):
            raise refusal(self._part_name, command, f"speed_scale = {scale} is not within (0, 1]")
        return float(scale)

    def servo(self, target: Array, position: Array, interval: float) -> None:
        """Raise CommandRefusedError unless ``target`` can be reached from ``position`` within ``interval`` seconds."""
        speed = np.abs(target - position) / interval
        worst = int(np.argmax(speed / self._model.velocity))
        if speed[worst] > self._model.velocity[worst] * SPEED_TOLERANCE:
            raise refusal(
                self._part_name,
                "servo",
                f"{self._model.joint_names[worst]} would need {speed[worst]:.3f} rad/s, its limit is "
                f"{self._model.velocity[worst]:.3f} rad/s",
            )

    def trajectory(self, trajectory: JointTrajectory, measured: Array) -> None:
        """Raise CommandRefusedError unless joints and limits fit the arm and the trajectory starts at ``measured``."""
        names, limit = self._model.joint_names, self._model.velocity * SPEED_TOLERANCE
        if trajectory.joint_names != names:
            raise refusal(
                self._part_name, "follow", f"the joints are {trajectory.joint_names}, but this arm's are {names}"
            )
        pairs = [(trajectory.positions, self._model.lower, self._model.upper, "position")]
        speeds = [trajectory.velocities]
        if len(trajectory.times) > 1:
            speeds.append(np.diff(trajectory.positions, axis=0) / np.diff(trajectory.times)[:, None])
        pairs += [(speed, -limit, limit, "velocity") for speed in speeds]
        for values, lower, upper, what in pairs:
            wrong = ~((values >= lower - 1e-6) & (values <= upper + 1e-6))
            if np.any(wrong):
                sample, joint = (int(index) for index in np.argwhere(wrong)[0])
                raise refusal(
                    self._part_name,
                    "follow",
                    f"{what} of {names[joint]} in sample {sample} is {values[sample, joint]:.4f}, its "
                    f"limits are [{lower[joint]:.4f}, {upper[joint]:.4f}]",
                )
        start = trajectory.positions[0]
        worst = int(np.argmax(np.abs(start - measured)))
        if abs(start[worst] - measured[worst]) > START_TOLERANCE:
            raise refusal(
                self._part_name,
                "follow",
                f"the trajectory starts with {names[worst]} = {start[worst]:.4f}, but the joint is at "
                f"{measured[worst]:.4f}; within {START_TOLERANCE} would be accepted",
            )

    def _within(self, command: str, what: str, values: ArrayLike, lower: Array, upper: Array) -> Array:
        try:
            array = np.array(values, dtype=float)
        except (TypeError, ValueError) as error:
            raise refusal(self._part_name, command, f"{what} are not numbers: {values!r}") from error
        if array.shape != lower.shape:
            raise refusal(self._part_name, command, f"{what} should have shape {lower.shape} but have {array.shape}")
        if not np.all(np.isfinite(array)):
            raise refusal(self._part_name, command, f"{what} should be finite but are {array.tolist()}")
        for joint, value, low, high in zip(self._model.joint_names, array, lower, upper, strict=True):
            if not low - 1e-6 <= value <= high + 1e-6:
                why = f"{what} of {joint} = {value:.4f} is beyond its limits [{low:.4f}, {high:.4f}]"
                raise refusal(self._part_name, command, why)
        clipped: Array = np.clip(array, lower, upper)
        return clipped


@dataclass(frozen=True)
class Tracking:
    """Parameters of streaming and of tracking errors. SI units, radians.

    A path waits while its set-points are ``held_back`` or more from those that the gate admits; it is given up if the
    gate has held the joints at rest for ``tracking_time``. A motion fails as TRACKING if a joint deviates from its
    set-point by more than its tolerance for ``tracking_time``, and as TIMEOUT if it has not settled in time; tolerances
    are the part's ``constraints``. ``stop_time``: longest braking of a stop, if necessary beyond the acceleration
    limits. Set-points never jump: a late one advances by at most ``longest_step`` periods, so that a slow connection
    slows the motion down; a total delay of more than ``slip_limit`` seconds, halved every ``slip_half_life``, fails it
    as TIMEOUT. ``latency``: from a set-point to the reading that shows it. ``stream_reserve``: factor on the
    acceleration limits for streamed set-points; above 1 for drivers below another controller, whose set-points jitter.
    ``velocity_timeout``: seconds after which a commanded velocity expires, and the joints brake, unless it is repeated.
    """

    tracking_time: float = 0.15
    held_back: float = 0.01
    stop_time: float = 0.3
    moved_by_hand: float = 0.05
    longest_stream_interval: float = 0.1
    longest_step: float = 3.0
    latency: float = 0.1
    slip_limit: float = 0.5
    slip_half_life: float = 1.0
    velocity_timeout: float = 0.25
    stream_reserve: float = 1.0


class StreamedJointGroup(StoppablePart, JointGroup):
    """Joints over a channel. A loop of the connection calls ``cycle`` once per ``period`` seconds.

    ``comes_into_limits``: set before connecting; accepts joints outside their range, so that they can be moved into it.
    Commands are processed under the part's lock; set-points are sent without it, so that an unresponsive controller
    never blocks a stop.
    """

    def __init__(
        self,
        name: str,
        model: JointedModel,
        channel: JointChannel,
        latch: StopLatch,
        period: float,
        tracking: Tracking = Tracking(),
        tool: ToolLimits | None = None,
    ) -> None:
        super().__init__(name, latch)
        self.model, self._channel, self._period = model, channel, period
        self._tracking = tracking
        self._checks = JointCommandChecks(name, model)
        self._gate = SetpointGate(model, period, tool, tracking.stop_time, channel.longest_tool_step)
        self._time_scale = TimeScale(model.acceleration)
        rest = np.zeros(len(model.joint_names))
        self._wanted: Array = rest  # where the set-points would be without the gate
        self._position: Array = rest
        self._velocity: Array = rest
        self._setpoints: Setpoints = Hold(rest)
        self._astray = self._waiting = self._slip = self._held = 0.0
        self._lapses_in = 0.0
        self._efforts: Array | None = None
        self._halting, self._halted = False, 0.0  # joints that efforts have moved; for so many seconds
        self._gave_way = False  # with a motion under way, which has not been informed
        self.comes_into_limits = False

    def positions(self) -> Array:
        """Return the measured positions, (n,) rad or m."""
        self._connection.check_reading()
        return self._channel.published().positions

    @override
    def velocities(self) -> Array:
        self._connection.check_reading()
        return self._channel.published().velocities

    @override
    def efforts(self) -> Array:
        self._connection.check_reading()
        return self._channel.published().efforts

    def command(
        self,
        positions: ArrayLike | None = None,
        velocities: ArrayLike | None = None,
        efforts: ArrayLike | None = None,
    ) -> None:
        """Set one kind of set-point, (n,); positions and velocities are approached within the limits, efforts act
        immediately. Raises CommandRefusedError.

        After efforts, positions and velocities start from the measured ones. Velocities expire after
        ``velocity_timeout`` unless they are repeated.
        """
        checks, model = self._checks, self.model
        with self._connection.lock:
            self._connection.check_command("command")
            checks.one_kind("command", positions, velocities, efforts)
            if efforts is not None:
                torques = checks.efforts("command", efforts)
                if not self._channel.takes_efforts:
                    why = "its controller accepts only positions and velocities, not efforts"
                    raise self._connection.refuse("command", why)
                self._take_over(Hold(self._position), None)
                self._efforts, self._halting = torques, False
                self._channel.exert(torques)
                return
            self._start_from_rest()
            if positions is not None:
                target = checks.positions("command", positions)
                self._check_way("command", target)
                self._leave_effort_mode()
                reach = Reach(self._position, self._own_velocity, target, model.velocity, model.acceleration)
                self._take_over(reach, None)
            else:
                wanted = checks.velocities("command", velocities if velocities is not None else ())
                self._leave_effort_mode()
                drift = Drift(self._position, self._own_velocity, wanted, model.acceleration, model.lower, model.upper)
                self._take_over(drift, None)
                self._lapses_in = self._tracking.velocity_timeout

    def move_to(self, positions: ArrayLike, speed_scale: float = 1.0) -> Motion[None]:
        """Move on a straight line in joint space with a trapezoidal speed profile; brakes first if in motion."""
        checks, model = self._checks, self.model
        with self._connection.lock:
            self._connection.check_command("move_to")
            target = checks.positions("move_to", positions)
            scale = checks.speed_scale("move_to", speed_scale)
            self._start_from_rest()
            self._check_way("move_to", target)
            self._leave_effort_mode()
            speed, acceleration = model.velocity * scale, model.acceleration * scale
            share = self._slow_down(Trapezoid(self._position, target, speed, acceleration))
            motion: Motion[None] = Motion(self.name, self.brake)
            # The whole profile in 1 / share of the time.
            move = BrakeThenMove(self._braking(), target, speed * share, acceleration * share**2)
            self._take_over(move, motion)
            return motion

    @override
    def brake(self) -> None:
        with self._connection.lock:
            if self._efforts is not None:
                self._halting = True
            elif not self._settled and not isinstance(self._setpoints, Brake):
                self._setpoints = self._braking()

    def attach(self) -> None:
        """Hold the current joint positions. Raises ConnectionFailedError if a joint is outside its range."""
        with self._connection.lock:
            measured = self._channel.read().positions
            if not self.comes_into_limits:
                self._check_range(measured)
            self._rest_at(measured)
            self._astray = self._slip = 0.0
            self._gave_way = False
            self._efforts = None
            self._connection.open()

    @property
    def resting(self) -> bool:
        """Return whether the set-points are at rest."""
        return self._settled and self._efforts is None

    def fail(self, fault: Failure) -> None:
        """Fail the current motion and brake, if the controller responds."""
        with self._connection.lock:
            self._connection.fail_motion(fault)
            if fault.code is MotionErrorCode.DISCONNECTED:
                self.give_way()
            else:
                self.brake()

    def give_way(self) -> None:
        """Stop sending set-points: the controller has stopped the joints, or is unreachable."""
        with self._connection.lock:
            if not self.resting:
                self._gave_way = self._connection.motion is not None
                self._rest_at(self._start)
            self._efforts = None

    def cycle(self, elapsed: float) -> None:
        """Run one control period, ``elapsed`` seconds after the last one: send the next set-point if one is due."""
        if self._must_halt(elapsed):
            self._channel.halt()
        elif (due := self._next_setpoint(elapsed)) is not None:
            self._channel.send(*due)
        self.record()

    @property
    def traced(self) -> tuple[str, ...]:
        """Return the names of the traced values of each joint."""
        return tuple(f"{what} {joint}" for what in TRACED for joint in self.joint_names)

    def record(self) -> None:
        """Write a row into the ``trace``, if recorded."""
        row = None if self.trace is None else self.trace.row()
        if row is None or self.trace is None:
            return
        reading, n = self._channel.read(), len(self.joint_names)
        row[:n], row[n : 2 * n], row[2 * n : 3 * n] = self._wanted, self._position, self._velocity
        row[3 * n : 4 * n], row[4 * n : 5 * n], row[5 * n :] = reading.positions, reading.velocities, reading.efforts
        self.trace.note(self._gate.reason)

    def _must_halt(self, elapsed: float) -> bool:
        """Return whether joints that efforts have moved are still to be braked; once at rest, set-points hold them.

        They hold them in any case after twice the time of a stop, so that a noisy reading does not keep them from it.
        """
        with self._connection.lock:
            if self._efforts is None or not self._halting:
                self._halted = 0.0
                return False
            self._halted += elapsed
            speeds = np.abs(self._channel.read().velocities)
            at_rest = np.max(speeds) < self.model.part.constraints.stopped_velocity
            if at_rest or self._halted > 2.0 * self._tracking.stop_time:
                self._leave_effort_mode()
            return self._efforts is not None

    def _next_setpoint(self, elapsed: float) -> tuple[Array, Array] | None:
        """Return the position and velocity to send, or None."""
        with self._connection.lock:
            if self._efforts is not None:
                return None
            if self._gave_way:
                self._gave_way = False
                why = "the controller has stopped the joints on their way"
                self._connection.end_motion(MotionStatus.FAILED, MotionErrorCode.FAULT, why)
            at_rest = self._settled and self._connection.motion is None
            elapsed = max(elapsed, SHORTEST)
            if self._channel.scaling == 0.0 and not self._gate.moving:
                self._wait(elapsed)
            elif at_rest:
                self._gate.rest(elapsed)
                self._time_scale.rest(self._share)
            else:
                self._advance(elapsed)
            if at_rest and not self._channel.stream_at_rest:
                return None
            return self._position, self._velocity

    @property
    def _share(self) -> float:
        """Rate of the set-points' time relative to real time, as set by the operator and limited by what the controller
        can follow.
        """
        return self.speed_share * self._channel.scaling

    def _wait(self, elapsed: float) -> None:
        """Keep set-points at the joints while the controller is paused, so that nothing jumps when it continues."""
        self._watch_lapse(elapsed)
        here = np.clip(self._channel.read().positions, self.model.lower, self.model.upper)
        if isinstance(self._setpoints, (Hold, Brake)):
            self._rest_at(here)
        else:
            self._gate.start(here)
            self._position, self._velocity = here, np.zeros_like(here)

    @property
    def _settled(self) -> bool:
        """Whether no motion is commanded, and the set-points have reached the target."""
        return isinstance(self._setpoints, Hold) and self._arrived

    @property
    def _arrived(self) -> bool:
        """Whether the set-points rest where they were to come to."""
        return not self._gate.moving and np.array_equal(self._wanted, self._position)

    def _check_range(self, measured: Array) -> None:
        model = self.model
        outside = np.maximum(model.lower - measured, measured - model.upper)
        worst = int(np.argmax(outside))
        if not outside[worst] <= OUTSIDE:  # nor where it is not known
            raise ConnectionFailedError(
                f"{self.name}: {self.joint_names[worst]} is at {measured[worst]:.4f}, outside its range "
                f"[{model.lower[worst]:.4f}, {model.upper[worst]:.4f}]; "
                "bestman-bt robot move-into-limits brings it back"
            )

    def _advance(self, elapsed: float) -> None:
        dt = min(elapsed, self._tracking.longest_step * self._period)
        self._watch_slip(elapsed, dt)
        self._watch_tracking(elapsed)
        self._watch_lapse(elapsed)
        motion, was_finished = self._connection.motion, self._setpoints.finished
        self._step(dt, elapsed)
        self._watch_gate(elapsed)
        if not was_finished:
            return
        if motion is not None:
            self._watch_settling(motion, elapsed)
        elif self._setpoints.finished:
            self._setpoints = Hold(self._wanted)

    def _step(self, dt: float, elapsed: float) -> None:
        """Send the next set-point through the gate."""
        setpoints, pace = self._setpoints, 1.0
        if setpoints.waits:
            behind = float(np.max(np.abs(self._wanted - self._position)))
            pace = max(0.0, 1.0 - behind / self._tracking.held_back)
        if self._channel.scaling == 0.0 and not setpoints.brakes:  # nothing moves: neither does the time
            pace = self._time_scale.share = 0.0
        elif setpoints.scaled:
            pace *= self._time_scale.approach(self._share, dt)
        self._velocity = np.zeros_like(self._velocity)
        if pace > 0.0:
            self._wanted, velocity = setpoints.advance(pace * dt)
            self._time_scale.took(velocity, pace * dt)
            self._velocity = pace * velocity
        reserve = self._tracking.stream_reserve if isinstance(setpoints, Stream) else 1.0
        self._position = self._gate.admit(self._wanted, self._velocity, dt, elapsed, setpoints.brakes, reserve)
        if self._gate.reason:
            self._velocity = self._gate.rate
            own = self._own_velocity if setpoints.scaled else self._velocity
            if setpoints.continue_from(self._position, own):
                self._wanted = self._position

    @property
    def _own_velocity(self) -> Array:
        """Velocity of the joints relative to the set-points' time, which may pass more slowly than real time."""
        velocity: Array = self._velocity / max(self._time_scale.share, SLOWEST)
        return np.clip(velocity, -self.model.velocity, self.model.velocity)

    def _watch_lapse(self, elapsed: float) -> None:
        if isinstance(self._setpoints, Drift):
            self._lapses_in -= elapsed
            if self._lapses_in < 0.0:
                self._setpoints = self._braking()

    def _watch_gate(self, elapsed: float) -> None:
        """Give up a motion that the gate has brought to rest."""
        held = self._gate.reason and np.all(np.abs(self._gate.rate) < AT_REST * self.model.velocity)
        self._held = self._held + elapsed if held else 0.0
        if self._held > self._tracking.tracking_time:
            self._give_up(MotionErrorCode.FAULT, self._gate.reason)
            self._rest_at(self._position)

    def _watch_slip(self, elapsed: float, dt: float) -> None:
        tracking = self._tracking
        self._slip = self._slip * 0.5 ** (elapsed / tracking.slip_half_life) + elapsed - dt
        if self._slip > tracking.slip_limit and not isinstance(self._setpoints, (Hold, Brake)):
            text = f"set-points were held up by {self._slip:.2f} s: the controller answers too slowly"
            self._give_up(MotionErrorCode.TIMEOUT, text)

    def _watch_tracking(self, elapsed: float) -> None:
        if self._channel.age > self._tracking.latency or self._channel.scaling == 0.0:
            return  # positions are unknown, which the watchdog handles; or the controller has stopped them
        error = np.abs(self._position - self._channel.read().positions)
        tolerance = self.model.path_tolerance
        worst = int(np.argmax(error / tolerance))
        self._astray = self._astray + elapsed if error[worst] > tolerance[worst] else 0.0
        if self._astray > self._tracking.tracking_time:
            off = f"{self.joint_names[worst]} is {error[worst]:.3f} off its set-point"
            text = f"{off}, its tolerance is {tolerance[worst]:.3g}"
            self._give_up(MotionErrorCode.TRACKING, text, self._off(worst, error))
            # At the measured positions, so that they no longer press on the obstacle; set-points do not jump.
            model = self.model
            here = np.clip(self._channel.read().positions, model.lower, model.upper)
            self._setpoints = Reach(self._position, self._velocity, here, model.velocity, model.acceleration)
            self._setpoints.scaled = False  # whatever an operator has slowed down

    def _rest_at(self, position: Array, velocity: Array | None = None) -> None:
        """Continue the set-points from ``position``, at rest or with ``velocity``."""
        self._gate.start(position, velocity)
        self._position = self._wanted = position
        self._velocity, self._setpoints = np.zeros_like(position), Hold(position)

    def _give_up(self, code: MotionErrorCode, text: str, obstacle: MotionObstacle | None = None) -> None:
        self._note_fault(text)
        self._astray = self._slip = self._held = 0.0
        self._setpoints = self._braking()
        self._connection.end_motion(MotionStatus.FAILED, code, text, obstacle=obstacle)

    def _watch_settling(self, motion: Motion[None], elapsed: float) -> None:
        """Wait for the joints after the last set-point: the motion succeeds when they have arrived."""
        reading, constraints, tolerance = self._channel.read(), self.model.part.constraints, self.model.goal_tolerance
        error, speed = np.abs(self._wanted - reading.positions), float(np.max(np.abs(reading.velocities)))
        self._waiting += elapsed
        settled = self._arrived and bool(np.all(error < tolerance)) and speed < constraints.stopped_velocity
        if not settled and self._waiting <= constraints.goal_time:
            return
        # Before the motion ends: joints at rest take the next command at once.
        self._velocity, self._setpoints = np.zeros_like(self._velocity), Hold(self._wanted)
        if settled:
            motion.succeed()
        else:
            worst = int(np.argmax(error / tolerance))
            off = f"{self.joint_names[worst]} is {error[worst]:.4f} off, its tolerance is {tolerance[worst]:.3g}"
            text = f"did not settle at the target within {constraints.goal_time:g} s: {off}, speed {speed:.4f}"
            self._note_fault(text)
            off_by = self._off(worst, error)
            self._connection.end_motion(MotionStatus.FAILED, MotionErrorCode.TIMEOUT, text, obstacle=off_by)

    def _off(self, worst: int, error: NDArray[np.float64]) -> MotionObstacle:
        """Return the joint that is farthest from where it should be."""
        at = dict(zip(self.joint_names, self._channel.read().positions.tolist(), strict=True))
        return MotionObstacle(MotionStage.EXECUTION, (), self.joint_names[worst], float(error[worst]), at)

    def _note_fault(self, text: str) -> None:
        if self.trace is not None and self._connection.motion is not None:
            self.trace.fault = text

    def _take_over(self, setpoints: Setpoints, motion: Motion[None] | None) -> None:
        self._connection.begin(motion)
        self._gave_way = False
        self._setpoints, self._wanted = setpoints, self._position
        self._waiting = self._astray = self._slip = self._held = 0.0

    @property
    def _start(self) -> Array:
        """The start of the set-points of the next command: at the joints after efforts, which no set-point follows."""
        return self._position if self._efforts is None else self._channel.read().positions

    def _leave_effort_mode(self) -> None:
        """Continue the set-points at the measured positions and velocities; the gate brakes joints that are too
        fast.
        """
        if self._efforts is not None:
            reading = self._channel.read()
            self._efforts = None
            self._rest_at(reading.positions, reading.velocities)
            self._velocity = reading.velocities
            self._setpoints = self._braking()

    def _start_from_rest(self) -> None:
        """Start from the measured positions if the joints were moved by hand while at rest."""
        if self._settled:
            measured = self._channel.read().positions
            if np.any(np.abs(measured - self._position) > self._tracking.moved_by_hand):
                self._rest_at(measured)

    def _braking(self) -> Brake:
        model = self.model
        deceleration = np.maximum(model.acceleration, np.abs(self._velocity) / self._tracking.stop_time)
        return Brake(self._position, self._velocity, deceleration, model.lower, model.upper)

    def _check_way(self, command: str, target: Array) -> None:
        """Check the way to a target; without a tool, joint limits alone bound it."""

    def _slow_down(self, profile: Trapezoid) -> float:
        return 1.0
