"""One running simulation: the built world, the robot's encoders, and the loop that steps physics and controllers."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from typing import cast

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import Pose
from bestman_bt.robot_model import BaseModel, GripperModel, JointedModel, RobotModel
from bestman_bt.scene import World
from hal.api import NotConnectedError
from hal.simulation.bodies import Array, Contact, SimulationError
from hal.simulation.doors import Latches, MovingDoors
from hal.simulation.engine import Engine
from hal.simulation.guards import GuardedEngine, Reader, ReadPurpose
from hal.simulation.parameters import SimulationParameters
from hal.simulation.walkers import Walkers


class Simulation:
    """Physics, world and robot body; parts hang their control in it, the monitor its observation.

    ``engine``: the physics, for the robot's own motors and encoders; what else it does is counted in ``ledger``.
    ``controls`` run every control period before the step, ``effort_controls`` before every step;
    ``step_observers`` run after every step, ``observers`` after every ``monitor_every``-th. ``torques``: what parts
    that command torques exert at the driven joints, NaN where the engine's own motors work.
    """

    def __init__(self, engine: Engine, model: RobotModel, world: World, parameters: SimulationParameters) -> None:
        self._engine, self.built, self.ledger = engine, engine.built, engine.ledger
        self._guarded = GuardedEngine(engine)
        self.engine = cast(Engine, self._guarded)
        self.model, self.parameters = model, parameters
        self.steps = 0
        self.epoch = 0.0
        self.controls: list[Callable[[], None]] = []
        self.effort_controls: list[Callable[[], None]] = []
        self.step_observers: list[Callable[[], None]] = []
        self.observers: list[Callable[[], None]] = []
        latches = Latches(engine, world)
        if latches:
            self.effort_controls.append(latches.update)
        self.walkers = Walkers(engine, world)
        if self.walkers:
            self.controls.append(lambda: self.walkers.update(self.elapsed))
        self.moving_doors = MovingDoors(engine, world)
        if self.moving_doors:
            self.controls.append(lambda: self.moving_doors.update(self.elapsed))
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
        self._joints = self.joints(self.joint_names)
        self._slots = {joint: slot for slot, joint in enumerate(self.joint_names)}
        self._states: Array = np.zeros((3, len(self._joints)))
        self.torques: Array = np.full(len(self._joints), np.nan)
        self._read_at = -1
        self._contacts: Sequence[Contact] = ()
        self._contacts_at = -1
        self.ledger.seal()

    @property
    def elapsed(self) -> float:
        """Seconds since the scene was built."""
        return self.steps * self.parameters.time_step

    @property
    def now(self) -> float:
        """The robot's time: ``epoch``, when this simulation began, and the steps since then; seconds."""
        return self.epoch + self.elapsed

    def step(self) -> None:
        """One physics step, with the controllers that are due before it and the observers after it."""
        if self.steps % self.parameters.control_every == 0:
            for control in self.controls:
                control()
        for control in self.effort_controls:
            control()
        self._engine.step()
        self.steps += 1
        for observe in self.step_observers:
            observe()
        if self.steps % self.parameters.monitor_every == 0:
            for observe in self.observers:
                observe()

    def close(self) -> None:
        """Free what the engine holds."""
        self._engine.close()

    def reader(self, purpose: ReadPurpose) -> Reader:
        """A view of what is true for the module that calls this; its reads are counted if it opens after
        ``close_truth``.
        """
        return Reader(self._engine, self._guarded, purpose, sys._getframe(1).f_globals.get("__name__", ""))

    def actor(self) -> Engine:
        """The engine for parts that act on the world by what they are, such as a suction cup: taken before
        ``close_truth``, its calls are free.
        """
        return self.engine if self.ledger.truth_closed else self._engine

    def slots(self, joint_names: Sequence[str]) -> NDArray[np.intp]:
        """Where joints are in ``joint_states``."""
        return np.array([self._slots[joint] for joint in joint_names], dtype=np.intp)

    def joints(self, joint_names: Sequence[str]) -> list[int]:
        """The engine's numbers of the robot's joints."""
        return [self.built.joints[joint] for joint in joint_names]

    def release(self, joints: Sequence[int]) -> None:
        """The engine's own motors at joints of the robot let go: they would work against torques."""
        nothing = [0.0] * len(joints)
        self._engine.turn(self.built.robot, joints, nothing, nothing)

    def joint_states(self) -> Array:
        """Encoders of all driven joints: rows position, velocity, motor effort; read once per step at most."""
        if self._read_at != self.steps:
            self._states = np.array(self._engine.joint_states(self.built.robot, self._joints))
            self._read_at = self.steps
        return self._states

    def efforts(self) -> Array:
        """What motors exert at the driven joints; where torques are commanded, the engine's own figure is stale."""
        return np.where(np.isnan(self.torques), self.joint_states()[2], self.torques)

    def contacts(self, reader: Reader) -> Sequence[Contact]:
        """All contacts; read once per step at most, for all who ask.

        To ask for those of the robot alone costs as much.
        """
        if self._contacts_at != self.steps or not reader.trusted:
            self._contacts = reader.contacts()
            self._contacts_at = self.steps
        return self._contacts

    def link_pose(self, reader: Reader, link: str) -> Pose:
        """True pose of a link of the robot in the map frame; SimulationError names the links there are."""
        links = self.built.links
        if link in self.built.frames:
            holder, holder_from_frame = self.built.frames[link]
            return self.link_pose(reader, holder) @ holder_from_frame
        if link not in links:
            raise SimulationError(f"robot {self.model.name!r} has no link {link!r}; it has {', '.join(links)}")
        pose: Pose = reader.link_pose(self.built.robot, links[link])
        return pose

    def holder(self, frame: str) -> int:
        """The number of the robot's link that carries a frame, or is it."""
        return self.built.links[self.built.frames.get(frame, (frame, None))[0]]


class SimulatedChannel:
    """What the channels to simulated actuators share: the simulation, to which they are attached while connected."""

    _attached_to: Simulation | None = None

    @property
    def simulation(self) -> Simulation:
        """The running simulation; NotConnectedError without one."""
        if self._attached_to is None:
            raise NotConnectedError("the robot is not connected; call connect()")
        return self._attached_to

    def attach(self, simulation: Simulation) -> None:
        """Act in a running simulation from now on; the actuator holds where it is."""
        self._attached_to = simulation

    def detach(self) -> None:
        """Let go of the simulation; idempotent."""
        self._attached_to = None
