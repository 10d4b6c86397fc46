"""What is true in the simulation, for evaluation alone."""

from __future__ import annotations

import numpy as np

from bestman_bt.messages import Pose
from hal.pybullet.client import ReadPurpose, SimulationError
from hal.pybullet.robot import PyBulletRobot


class GroundTruth:
    """True poses in the map frame. Make it right after ``robot.connect()``, before time runs.

    One that is made later works, too, but each of its reads counts as a ``ground_truth_read`` in the audit: so a
    skill cannot look at the truth unnoticed. ``trusted``: whether reads are free.
    """

    def __init__(self, robot: PyBulletRobot) -> None:
        self._simulation = robot.simulation
        self._reader = robot.simulation.client.reader(ReadPurpose.EVALUATION)
        self.trusted = self._reader.trusted

    @property
    def object_names(self) -> tuple[str, ...]:
        """The movable objects."""
        return tuple(self._simulation.built.objects)

    def object_pose(self, name: str) -> Pose:
        """True pose of an object; SimulationError names what there is."""
        return self._body_pose(name, self._simulation.built.objects, "object")

    def object_speed(self, name: str) -> tuple[float, float]:
        """Speed in m/s and rate of turn in rad/s of an object."""
        body = self._body(name, self._simulation.built.objects, "object")
        linear, angular = self._reader.getBaseVelocity(body)
        return float(np.linalg.norm(linear)), float(np.linalg.norm(angular))

    def furniture_pose(self, name: str) -> Pose:
        """True pose of a piece of furniture."""
        return self._body_pose(name, self._simulation.built.furniture, "furniture")

    @property
    def articulation_names(self) -> tuple[str, ...]:
        """Doors and drawers, as ``furniture/name``."""
        return tuple(self._simulation.built.articulations)

    def articulation_position(self, name: str) -> float:
        """How far a door or drawer is open, radians or metres from closed."""
        built = self._simulation.built
        if name not in built.articulations:
            known = ", ".join(built.articulations) or "none"
            raise SimulationError(f"there is no door or drawer {name!r}; there is {known}")
        return float(self._reader.getJointState(*built.articulations[name])[0])

    def walker_position(self, name: str) -> tuple[float, float]:
        """Where the middle of a walker is, x and y in the map frame, metres."""
        body, slides = self._simulation.built.walkers[name]
        (x0, y0, _), _ = self._reader.getBasePositionAndOrientation(body)
        (x, *_), (y, *_) = self._reader.getJointStates(body, slides)
        return x0 + x, y0 + y

    def base_pose(self) -> Pose:
        """True pose of the robot's base frame."""
        return self.frame_pose(self._simulation.model.base_frame)

    def frame_pose(self, frame: str) -> Pose:
        """True pose of a frame (link) of the robot."""
        return self._simulation.link_pose(self._reader, frame)

    def touches_robot(self, name: str) -> bool:
        """Whether any link of the robot presses on an object."""
        body = self._body(name, self._simulation.built.objects, "object")
        contacts = self._reader.getContactPoints(bodyA=self._simulation.built.robot, bodyB=body)
        return any(contact[9] > 0.0 for contact in contacts)

    def supports(self, name: str) -> tuple[str, ...]:
        """Names of the bodies other than the robot that an object rests on or touches."""
        body = self._body(name, self._simulation.built.objects, "object")
        names = self._simulation.built.body_names
        touched = {contact[2] for contact in self._reader.getContactPoints(bodyA=body) if contact[9] > 0.0}
        return tuple(sorted(names[other] for other in touched if other in names))

    def _body(self, name: str, bodies: dict[str, int], kind: str) -> int:
        if name not in bodies:
            raise SimulationError(f"there is no {kind} {name!r}; there is {', '.join(bodies) or 'none'}")
        return bodies[name]

    def _body_pose(self, name: str, bodies: dict[str, int], kind: str) -> Pose:
        position, quaternion = self._reader.getBasePositionAndOrientation(self._body(name, bodies, kind))
        return Pose(np.array(position), np.array(quaternion))
