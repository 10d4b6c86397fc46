"""One running simulation: the built world, the robot's encoders, and the loop that steps physics and controllers."""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import Pose
from bestman_bt.robot_model import BaseModel, GripperModel, JointedModel, RobotModel
from bestman_bt.scene import World
from hal.pybullet.client import PhysicsClient, Reader, SimulationError
from hal.pybullet.doors import Latches, MovingDoors
from hal.pybullet.parameters import PhysicsParameters
from hal.pybullet.walkers import Walkers
from hal.pybullet.world_builder import BuiltWorld, build_world

Contact = tuple[Any, ...]


class Simulation:
    """Physics, world and robot body; parts hang their control in it, the monitor its observation.

    ``controls`` run every control period before the step, ``effort_controls`` before every step;
    ``step_observers`` run after every step, ``observers`` after every ``monitor_every``-th. ``torques``: what parts
    that command torques exert at the driven joints, NaN where pybullet's own motors work.
    """

    def __init__(self, client: PhysicsClient, model: RobotModel, world: World, parameters: PhysicsParameters) -> None:
        self.client, self.model, self.parameters = client, model, parameters
        self.built: BuiltWorld = build_world(client, model, world, parameters)
        self.steps = 0
        self.epoch = 0.0
        self.controls: list[Callable[[], None]] = []
        self.effort_controls: list[Callable[[], None]] = []
        self.step_observers: list[Callable[[], None]] = []
        self.observers: list[Callable[[], None]] = []
        latches = Latches(client, world, self.built.articulations)
        if latches:
            self.effort_controls.append(latches.update)
        self.walkers = Walkers(client, world, self.built.walkers, self.built.robot)
        if self.walkers:
            self.controls.append(lambda: self.walkers.update(self.steps * parameters.time_step))
        self.moving_doors = MovingDoors(client, world, self.built.articulations, self.built.robot)
        if self.moving_doors:
            self.controls.append(lambda: self.moving_doors.update(self.steps * parameters.time_step))
        movable = [joint for base in model.of(BaseModel).values() for joint in base.part.driven_joints]
        movable += [
            joint
            for part in model.parts.values()
            if isinstance(part, JointedModel | GripperModel)
            for joint in part.part.joints
        ]
        missing = [joint for joint in movable if joint not in self.built.joints]
        if missing:
            raise SimulationError(f"the URDF of robot {model.name!r} has no joints {', '.join(missing)}")
        self.joint_names: tuple[str, ...] = tuple(dict.fromkeys(movable))
        self._indices = [self.built.joints[joint] for joint in self.joint_names]
        self._slots = {joint: slot for slot, joint in enumerate(self.joint_names)}
        self._states: NDArray[np.float64] = np.zeros((3, len(self._indices)))
        self.torques: NDArray[np.float64] = np.full(len(self._indices), np.nan)
        self._read_at = -1
        self._contacts: Sequence[Contact] = ()
        self._contacts_at = -1
        client.seal(self.built.robot)

    @property
    def now(self) -> float:
        """The robot's time: ``epoch``, when this simulation began, and the steps since then; seconds."""
        return self.epoch + self.steps * self.parameters.time_step

    def step(self) -> None:
        """One physics step, with the controllers that are due before it and the observers after it."""
        if self.steps % self.parameters.control_every == 0:
            for control in self.controls:
                control()
        for control in self.effort_controls:
            control()
        self.client.stepSimulation()
        self.steps += 1
        for observe in self.step_observers:
            observe()
        if self.steps % self.parameters.monitor_every == 0:
            for observe in self.observers:
                observe()

    def slots(self, joint_names: Sequence[str]) -> NDArray[np.intp]:
        """Where joints are in ``joint_states``."""
        return np.array([self._slots[joint] for joint in joint_names], dtype=np.intp)

    def indices(self, joint_names: Sequence[str]) -> list[int]:
        """Pybullet's joint indices."""
        return [self.built.joints[joint] for joint in joint_names]

    def joint_states(self) -> NDArray[np.float64]:
        """Encoders of all driven joints: rows position, velocity, motor effort; read once per step at most."""
        if self._read_at != self.steps:
            states = self.client.getJointStates(self.built.robot, self._indices)
            columns = tuple(zip(*states, strict=True))
            self._states = np.array((columns[0], columns[1], columns[3])) if columns else np.zeros((3, 0))
            self._read_at = self.steps
        return self._states

    def efforts(self) -> NDArray[np.float64]:
        """What motors exert at the driven joints; where torques are commanded, pybullet's own figure is a stale one."""
        return np.where(np.isnan(self.torques), self.joint_states()[2], self.torques)

    def contacts(self, reader: Reader) -> Sequence[Contact]:
        """All contacts as pybullet tells them; read once per step at most, for all who ask.

        To ask for those of the robot alone costs as much.
        """
        if self._contacts_at != self.steps or not reader.trusted:
            self._contacts = reader.getContactPoints()
            self._contacts_at = self.steps
        return self._contacts

    def link_pose(self, reader: Reader, link: str) -> Pose:
        """True pose of a link of the robot in the map frame; SimulationError names the links there are."""
        links, robot = self.built.links, self.built.robot
        if link in self.built.frames:
            holder, holder_from_frame = self.built.frames[link]
            return self.link_pose(reader, holder) @ holder_from_frame
        if link not in links:
            raise SimulationError(f"robot {self.model.name!r} has no link {link!r}; it has {', '.join(links)}")
        if links[link] >= 0:
            state = reader.getLinkState(robot, links[link], computeForwardKinematics=1)
            return Pose(np.array(state[4]), np.array(state[5]))
        position, quaternion = reader.getBasePositionAndOrientation(robot)
        return Pose(np.array(position), np.array(quaternion)) @ self._inertial_from_root

    @functools.cached_property
    def _inertial_from_root(self) -> Pose:
        """Pybullet gives the pose of the root link's centre of mass."""
        position, quaternion = self.client.getDynamicsInfo(self.built.robot, -1)[3:5]
        return Pose(np.array(position), np.array(quaternion)).inverse()
