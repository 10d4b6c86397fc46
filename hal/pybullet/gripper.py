"""Simulated parallel grippers: force-limited finger motors; what they hold, they hold by friction."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from bestman_bt.robot_model import GripperModel
from hal.api import Gripper, GripperDescription, GripperState, Motion, MotionErrorCode, MotionStatus
from hal.parts import GripperCommandChecks, PartMotion
from hal.pybullet.contact_renewal import ContactRenewal
from hal.pybullet.package import pybullet
from hal.pybullet.parameters import PhysicsParameters
from hal.pybullet.part import Connection
from hal.pybullet.simulation import Simulation

AT_TARGET = 0.001
BLOCKED_MARGIN = 0.0015
STILL_SPEED = 0.004
STILL_TIME = 0.15


class SimulatedGripper(Gripper):
    """A gripper: motors at the joints that drive its fingers, gears to those that follow (see the world's builder)."""

    def __init__(
        self, name: str, model: GripperModel, parameters: PhysicsParameters, stopped: Callable[[], bool]
    ) -> None:
        super().__init__(name)
        self._model, self._parameters = model, parameters
        self._checks = GripperCommandChecks(name, model, parameters.gripper_force, parameters.gripper_speed)
        self._connection = Connection(name, stopped)
        self._slots: NDArray[np.intp] = np.zeros(0, np.intp)
        self._indices: list[int] = []
        self._contacts: ContactRenewal | None = None
        self._target = model.max_width
        self._closing = self._blocked = False
        self._still_for = 0.0
        self._left = 0.0

    @property
    def description(self) -> GripperDescription:
        """Ranges."""
        return self._checks.description

    def width(self) -> float:
        """Measured opening, metres."""
        return self._model.width(self._connection.simulation.joint_states()[0, self._slots])

    def state(self) -> GripperState:
        """What encoders and motors say; an object that slips out shows as ``empty`` once the fingers have closed."""
        width = self.width()
        moving = self._connection.motion is not None
        at_target = abs(width - self._target) < AT_TARGET
        held = self._blocked and not moving and width > self._target + BLOCKED_MARGIN
        return GripperState(moving, at_target, held, self._closing and at_target and not moving)

    def move(self, width: float, force: float | None = None, speed: float | None = None) -> Motion:
        """Open or close to ``width`` at ``speed`` (rate of the width); without ``force``, 40 N or what the hand can."""
        self._connection.check_command("move")
        width, force, speed = self._checks.move(width, force, speed)
        motion = PartMotion(self)
        self._connection.begin(motion)
        present = self.width()
        if self._blocked and self._contacts is not None:
            self._contacts.renew_all()
        self._closing = width < present
        self._target = width
        self._blocked = False
        self._still_for = 0.0
        self._left = abs(present - width) / speed + 1.0
        self._send(force, speed)
        return motion

    def stop(self) -> None:
        """Stay as it is: moving fingers halt, a grasp goes on pressing."""
        if not self._connection.present:
            return
        self.brake()
        self._connection.end_motion(MotionStatus.CANCELED, MotionErrorCode.STOPPED, "stopped")

    def brake(self) -> None:
        """Halt the fingers, unless an object blocks them."""
        if self._connection.motion is not None and self._still_for < STILL_TIME / 3:
            limits = self._model
            self._target = float(np.clip(self.width(), limits.min_width, limits.max_width))
            self._send(min(self._parameters.gripper_force, limits.max_force), limits.max_speed)

    def attach(self, simulation: Simulation) -> None:
        """Hold the present width."""
        self._connection.attach(simulation)
        self._slots = simulation.slots(self._model.joint_names)
        self._indices = simulation.indices(self._model.joint_names)
        self._contacts = ContactRenewal(simulation, self._model.finger_links, self._parameters.contact_turn)
        self._target, self._still_for = self.width(), 0.0
        self._closing = self._blocked = False
        self._send(min(self._parameters.gripper_force, self._model.max_force), self._model.max_speed)
        simulation.controls.append(self._control)

    def detach(self) -> None:
        """Let go."""
        self._connection.detach()
        self._contacts = None

    def _control(self) -> None:
        motion = self._connection.motion
        if self._blocked and self._contacts is not None:
            self._contacts.follow()
        if motion is None:
            # Fingers that press tremble; only when they have closed, the object is gone.
            self._blocked = self._blocked and self.width() > self._target + BLOCKED_MARGIN
            return
        rates = self._connection.simulation.joint_states()[1, self._slots]
        speed = abs(float(rates.mean())) / self._model.transmission(self.width())
        period = self._parameters.control_period
        self._still_for = self._still_for + period if speed < STILL_SPEED else 0.0
        self._left -= period
        if abs(self.width() - self._target) < AT_TARGET and speed < STILL_SPEED:
            motion.succeed()
        elif self._still_for >= STILL_TIME:
            self._blocked = self._closing
            motion.succeed()
        elif self._left < 0.0:
            text = f"the width is {self.width():.4f} m, asked were {self._target:.4f} m"
            self._connection.end_motion(MotionStatus.FAILED, MotionErrorCode.TIMEOUT, text)

    def _send(self, force: float, speed: float) -> None:
        """Motors towards the target width; by virtual work, what they exert together gives ``force`` at each finger."""
        simulation, model = self._connection.simulation, self._model
        targets, per_metre = model.joint_positions(self._target), model.transmission(self.width())
        for joint, index in zip(model.joint_names, self._indices, strict=True):
            simulation.client.setJointMotorControl2(
                simulation.built.robot,
                index,
                pybullet.POSITION_CONTROL,
                targetPosition=targets[joint],
                force=force / (per_metre * len(self._indices)),
                maxVelocity=speed * per_metre,
            )
