"""The ground truth of the simulation, for evaluation only."""

from __future__ import annotations

import numpy as np

from bestman_bt.messages import Pose
from hal.simulation.bodies import among
from hal.simulation.guards import ReadPurpose
from hal.simulation.robot import SimulatedRobot


class GroundTruth:
    """True poses in the map frame. Create it right after ``robot.connect()``, before the first step.

    One created later also works, but each of its reads counts as a ``ground_truth_read`` in the audit, so that skills
    cannot read the ground truth unnoticed. ``trusted``: whether reads are not counted.
    """

    def __init__(self, robot: SimulatedRobot) -> None:
        self._simulation = robot.simulation
        self._reader = robot.simulation.reader(ReadPurpose.EVALUATION)
        self.trusted = self._reader.trusted

    @property
    def object_names(self) -> tuple[str, ...]:
        """Return the names of the movable objects."""
        return tuple(self._simulation.built.objects)

    def object_pose(self, name: str) -> Pose:
        """Return the true pose of an object. Raises SimulationError listing the objects."""
        return self._pose(among(self._simulation.built.objects, name, "object"))

    def object_speed(self, name: str) -> tuple[float, float]:
        """Return the speed of an object in m/s and its rotation rate in rad/s."""
        linear, angular = self._reader.body_velocity(among(self._simulation.built.objects, name, "object"))
        return float(np.linalg.norm(linear)), float(np.linalg.norm(angular))

    def furniture_pose(self, name: str) -> Pose:
        """Return the true pose of a piece of furniture."""
        return self._pose(among(self._simulation.built.furniture, name, "furniture"))

    @property
    def articulation_names(self) -> tuple[str, ...]:
        """Doors and drawers, as ``furniture/name``."""
        return tuple(self._simulation.built.articulations)

    def articulation_position(self, name: str) -> float:
        """Return the opening of a door or drawer, radians or metres from closed."""
        body, joint = among(self._simulation.built.articulations, name, "door or drawer")
        return float(self._reader.joint_states(body, [joint])[0][0])

    def base_pose(self) -> Pose:
        """Return the true pose of the robot's base frame."""
        return self.frame_pose(self._simulation.model.base_frame)

    def frame_pose(self, frame: str) -> Pose:
        """Return the true pose of a frame (link) of the robot."""
        return self._simulation.link_pose(self._reader, frame)

    def touches_robot(self, name: str) -> bool:
        """Return whether any link of the robot presses on an object."""
        built = self._simulation.built
        contacts = self._reader.contacts(built.robot, other=among(built.objects, name, "object"))
        return any(contact.pressure > 0.0 for contact in contacts)

    def supports(self, name: str) -> tuple[str, ...]:
        """Return the names of the bodies other than the robot that an object rests on or touches."""
        names, body = self._simulation.built.body_names, among(self._simulation.built.objects, name, "object")
        touched = {contact.second for contact in self._reader.contacts(body) if contact.pressure > 0.0}
        return tuple(sorted(names[other] for other in touched if other in names))

    def _pose(self, body: int) -> Pose:
        position, quaternion = self._reader.body_pose(body)
        return Pose(np.array(position), np.array(quaternion))
