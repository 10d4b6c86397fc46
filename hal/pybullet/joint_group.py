"""Simulated joint groups: set-points within limits, followed by position motors at the control rate."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bestman_bt.robot_model import ArmModel, JointGroupModel
from hal.api import JointGroup, JointLimits, Motion, MotionErrorCode, MotionStatus
from hal.parts import Brake, BrakeThenMove, Drift, Hold, JointCommandChecks, PartMotion, Reach, Setpoints
from hal.pybullet.encoders import EncoderReading, Encoders
from hal.pybullet.package import pybullet
from hal.pybullet.parameters import PhysicsParameters
from hal.pybullet.part import Connection
from hal.pybullet.simulation import Simulation

Array = NDArray[np.float64]


class SimulatedJointGroup(JointGroup):
    """Joints with position motors; commands become set-points every control period."""

    def __init__(
        self,
        name: str,
        model: JointGroupModel | ArmModel,
        parameters: PhysicsParameters,
        stopped: Callable[[], bool],
        rng: np.random.Generator,
    ) -> None:
        super().__init__(name)
        self._model, self._parameters = model, parameters
        self._connection = Connection(name, stopped)
        self.encoders = Encoders(name, model.encoders, parameters.step_rate, rng)
        self._checks = JointCommandChecks(name, model)
        self._lower, self._upper = self._checks.lower, self._checks.upper
        self._speed, self._acceleration = self._checks.speed, self._checks.acceleration
        self._effort_limits = self._checks.effort
        self._indices: list[int] = []
        self._slots: NDArray[np.intp] = np.zeros(0, np.intp)
        self._setpoints: Setpoints = Hold(np.zeros(len(self._lower)))
        self._position: Array = np.zeros(len(self._lower))
        self._velocity: Array = np.zeros(len(self._lower))
        self._step, self._steps_left = self._velocity, 0  # of the physics, to the set-point
        self._torques: Array | None = None
        self._astray = 0.0
        self._waiting = 0.0

    # Description

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the joints."""
        return self._model.joint_names

    @property
    def limits(self) -> tuple[JointLimits, ...]:
        """Limits of the joints."""
        return self._checks.limits

    # Measurements

    def positions(self) -> Array:
        """Measured positions, (n,); NoDataError where the encoders tell none."""
        return self.encoders.read().positions

    def velocities(self) -> Array:
        """Measured velocities, (n,); NoDataError where the encoders tell none."""
        return self.encoders.read().speeds

    def efforts(self) -> Array:
        """Efforts of the motors, (n,)."""
        efforts: Array = self._connection.simulation.efforts()[self._slots]
        return efforts

    # Commands

    def command(
        self,
        positions: ArrayLike | None = None,
        velocities: ArrayLike | None = None,
        efforts: ArrayLike | None = None,
    ) -> None:
        """Set one kind of set-point; positions and velocities are approached within the limits."""
        self._connection.check_command("command")
        self._checks.one_kind("command", positions, velocities, efforts)
        if positions is not None:
            target = self._checks.positions("command", positions)
            self._take_over(Reach(self._position, self._velocity, target, self._speed, self._acceleration), None)
        elif velocities is not None:
            wanted = self._checks.velocities("command", velocities)
            drift = Drift(self._position, self._velocity, wanted, self._acceleration, self._lower, self._upper)
            self._take_over(drift, None)
        else:
            torques = self._checks.efforts("command", np.asarray(efforts))
            self._take_over(Hold(self._measured(0)), None)
            self._release_motors()
            self._torques = torques
            self._connection.simulation.torques[self._slots] = torques

    def move_to(self, positions: ArrayLike, speed_scale: float = 1.0) -> Motion:
        """Move on a straight line in joint space with a trapezoid of speed; brakes first if it is moving."""
        self._connection.check_command("move_to")
        target = self._checks.positions("move_to", positions)
        speed_scale = self._checks.speed_scale("move_to", speed_scale)
        motion = PartMotion(self)
        speed, acceleration = self._speed * speed_scale, self._acceleration * speed_scale
        self._take_over(BrakeThenMove(self._braking(), target, speed, acceleration), motion)
        return motion

    def stop(self) -> None:
        """Brake to rest, ending the motion under way."""
        if not self._connection.present:
            return
        self.brake()
        self._connection.end_motion(MotionStatus.CANCELED, MotionErrorCode.STOPPED, "stopped")

    def brake(self) -> None:
        """Come to rest within the deceleration limits and half a second."""
        self._leave_effort_mode()
        if not isinstance(self._setpoints, (Hold, Brake)):
            self._setpoints = self._braking()

    # The simulation's side

    def attach(self, simulation: Simulation) -> None:
        """Hold where the joints are."""
        self._connection.attach(simulation)
        self._indices = simulation.indices(self.joint_names)
        self._slots = simulation.slots(self.joint_names)
        self.encoders.attach(simulation, lambda: EncoderReading(self._measured(0), self._measured(1)))
        self._position, self._velocity = self._measured(0), np.zeros(len(self._lower))
        self._setpoints, self._torques, self._astray = Hold(self._position), None, 0.0
        self._steps_left = 0
        self._send(self._position, self._velocity)
        simulation.controls.append(self._control)
        simulation.effort_controls += (self._interpolate, self._apply_torques)

    def detach(self) -> None:
        """Let go."""
        self._connection.detach()
        self.encoders.detach()

    def _control(self) -> None:
        if self._torques is not None:
            return
        motion = self._connection.motion
        if motion is None and isinstance(self._setpoints, Hold):
            return
        period = self._parameters.control_period
        self._watch_tracking(period)
        was_finished = self._setpoints.finished
        position, velocity = self._setpoints.advance(period)
        self._steps_left = self._parameters.control_every
        self._step = (position - self._position) / self._steps_left
        self._position, self._velocity = position, velocity
        if motion is not None and was_finished:
            self._watch_settling(motion, period)
        elif was_finished:
            self._setpoints = Hold(position)

    def _interpolate(self) -> None:
        """Go on to the set-point at the physics rate, as the drives of real arms do.

        Steps at the control rate would shake what the hand holds, and it would work its way out of the fingers.
        """
        if self._steps_left and self._torques is None:
            self._steps_left -= 1
            self._send(self._position - self._steps_left * self._step, self._step * self._parameters.step_rate)

    def _watch_tracking(self, period: float) -> None:
        error = np.abs(self._position - self._measured(0))
        if np.any(error > self._parameters.tracking_tolerance):
            self._astray += period
        else:
            self._astray = 0.0
        if self._astray > self._parameters.tracking_time:
            worst = int(np.argmax(error))
            text = f"{self.joint_names[worst]} is {error[worst]:.3f} off its set-point"
            self._position, self._velocity = np.clip(self._measured(0), self._lower, self._upper), 0.0 * error
            self._setpoints, self._astray = Hold(self._position), 0.0
            self._connection.end_motion(MotionStatus.FAILED, MotionErrorCode.TRACKING, text)

    def _watch_settling(self, motion: PartMotion, period: float) -> None:
        """The set-points have arrived: the motion succeeds when the joints have, too."""
        error = float(np.max(np.abs(self._position - self._measured(0))))
        speed = float(np.max(np.abs(self._measured(1))))
        self._waiting += period
        if error < self._parameters.settle_tolerance and speed < 0.02:
            motion.succeed()
        elif self._waiting > 2.0:
            text = f"did not settle at the target: {error:.4f} off, speed {speed:.4f}"
            self._connection.end_motion(MotionStatus.FAILED, MotionErrorCode.TIMEOUT, text)

    def _take_over(self, setpoints: Setpoints, motion: PartMotion | None) -> None:
        self._connection.begin(motion)
        self._leave_effort_mode()
        self._setpoints, self._waiting, self._astray = setpoints, 0.0, 0.0

    def _braking(self) -> Brake:
        deceleration = np.maximum(self._acceleration, np.abs(self._velocity) / self._parameters.stop_time)
        return Brake(self._position, self._velocity, deceleration, self._lower, self._upper)

    def _send(self, position: Array, velocity: Array) -> None:
        simulation = self._connection.simulation
        count = len(self._indices)
        simulation.client.setJointMotorControlArray(
            simulation.built.robot,
            self._indices,
            pybullet.POSITION_CONTROL,
            targetPositions=position.tolist(),
            targetVelocities=velocity.tolist(),
            forces=self._effort_limits.tolist(),
            positionGains=[self._parameters.joint_position_gain] * count,
            velocityGains=[self._parameters.joint_velocity_gain] * count,
        )

    # Efforts

    def _release_motors(self) -> None:
        simulation = self._connection.simulation
        simulation.client.setJointMotorControlArray(
            simulation.built.robot,
            self._indices,
            pybullet.VELOCITY_CONTROL,
            forces=[0.0] * len(self._indices),
        )

    def _apply_torques(self) -> None:
        if self._torques is not None:
            simulation = self._connection.simulation
            simulation.client.setJointMotorControlArray(
                simulation.built.robot, self._indices, pybullet.TORQUE_CONTROL, forces=self._torques.tolist()
            )

    def _leave_effort_mode(self) -> None:
        if self._torques is not None:
            self._torques, self._steps_left = None, 0
            self._connection.simulation.torques[self._slots] = np.nan
            self._position = np.clip(self._measured(0), self._lower, self._upper)
            self._velocity = np.clip(self._measured(1), -self._speed, self._speed)
            self._setpoints = self._braking()

    def _measured(self, row: int) -> Array:
        """What the drives know by their own encoders."""
        values: Array = self._connection.simulation.joint_states()[row, self._slots]
        return values
