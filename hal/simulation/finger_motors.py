"""The motors of parallel fingers as a channel: force-limited; objects are held only by friction."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import Pose
from bestman_bt.robot_model.model import GripperModel
from hal.parts.channels import GripperChannel, GripperReading
from hal.simulation.guards import ReadPurpose
from hal.simulation.parameters import SimulationParameters
from hal.simulation.simulation import SimulatedChannel, Simulation

PRESSING = 0.0015
"""Distance from the commanded width, metres, above which fingers press on something or are still moving."""


class FingerMotors(SimulatedChannel, GripperChannel):
    """Motors at the driving joints of the fingers; gears move the others (see the world builder)."""

    reaction_time = 0.0

    def __init__(self, model: GripperModel, parameters: SimulationParameters) -> None:
        self._model, self._parameters = model, parameters
        self._holding_force = min(parameters.gripper_holding_force, model.part.max_force)
        self._slots: NDArray[np.intp] = np.zeros(0, np.intp)
        self._indices: list[int] = []
        self._contacts: ContactRefresh | None = None
        self._sent_to = model.max_width

    def attach(self, simulation: Simulation) -> None:
        """Hold the current width."""
        super().attach(simulation)
        self._slots = simulation.slots(self._model.part.joints)
        self._indices = simulation.joints(self._model.part.joints)
        self._contacts = ContactRefresh(simulation, self._model.part.finger_links, self._parameters.contact_turn)
        self._drive(self.read().width, self._holding_force, self._model.part.max_speed)
        simulation.controls.append(self._follow_contacts)

    def read(self) -> GripperReading:
        """Return the width by the encoders of the joints."""
        return GripperReading(self._model.width(self.simulation.joint_states()[0, self._slots]))

    def send(self, width: float, force: float, speed: float) -> None:
        """Move towards a width."""
        if self._contacts is not None and self._pressing:
            self._contacts.renew_all()
        self._drive(width, force, speed)

    def halt(self) -> None:
        """Hold the current width."""
        width = float(np.clip(self.read().width, self._model.part.min_width, self._model.max_width))
        self._drive(width, self._holding_force, self._model.part.max_speed)

    @property
    def _pressing(self) -> bool:
        return self.read().width > self._sent_to + PRESSING

    def _follow_contacts(self) -> None:
        if self._contacts is not None and self._pressing:
            self._contacts.follow()

    def _drive(self, width: float, force: float, speed: float) -> None:
        """Set the efforts so that, by virtual work, the motors together exert ``force`` at each finger."""
        model = self._model
        self._sent_to = width
        targets, per_metre = model.joint_positions(width), model.transmission(self.read().width)
        for joint, index in zip(model.part.joints, self._indices, strict=True):
            effort = force / (per_metre * len(self._indices))
            self.motors.approach(index, targets[joint], speed * per_metre, effort)


class ContactRefresh:
    """Discards the cached contacts of the fingers, one finger after the other, so that the others hold meanwhile.

    Bullet moves contact points along with the bodies from step to step, but keeps their normals in the world frame
    (``btPersistentManifold::refreshContactPoints``). When a hand and its object rotate together, for example while the
    base turns, old normals become wrong, at worst sideways: the object creeps, and opening fingers get stuck.

    ``turn``: rotation of the hand, radians, within which each finger is refreshed once.
    """

    def __init__(self, simulation: Simulation, fingers: Sequence[str], turn: float) -> None:
        self._simulation, self._fingers = simulation, tuple(fingers)
        self._reader = simulation.reader(ReadPurpose.SENSOR)
        # Taken before the truth is closed: it changes nothing that touches, and is no tampering.
        self._engine = simulation.actor()
        self._least = math.cos(turn / len(self._fingers) / 2.0)
        self._next = 0
        self._renewed_at = self._pose()

    def follow(self) -> None:
        """Refresh the next finger's contacts if the hand has rotated far enough."""
        pose = self._pose()
        if abs(float(pose.quaternion @ self._renewed_at.quaternion)) < self._least:
            self._renew(self._fingers[self._next])
            self._next = (self._next + 1) % len(self._fingers)
            self._renewed_at = pose

    def renew_all(self) -> None:
        """Find all contacts afresh in the next step."""
        for finger in self._fingers:
            self._renew(finger)
        self._renewed_at = self._pose()

    def _pose(self) -> Pose:
        return self._simulation.link_pose(self._reader, self._fingers[0])

    def _renew(self, finger: str) -> None:
        built = self._simulation.built
        self._engine.forget_contacts(built.robot, built.links[finger])
