"""One running simulation: the built world, the robot's encoders, and the loop that steps physics and controllers."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from typing import cast

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import Pose
from bestman_bt.robot_model.model import BaseModel, GripperModel, JointedModel, RobotModel
from bestman_bt.scene.scene import World
from hal.api import NotConnectedError
from hal.simulation.bodies import Array, ContactPoint, SimulationError
from hal.simulation.doors import Latches, MovingDoors
from hal.simulation.engine import Engine
from hal.simulation.guards import GuardedEngine, Reader, ReadPurpose
from hal.simulation.parameters import SimulationParameters
from hal.simulation.walkers import Walkers


class Simulation:
    """Physics, world and robot body; parts register their controllers in it, the monitor its observers.

    ``engine``: the physics, for the robot's own motors and encoders; other calls are counted in ``ledger``.
    ``controls`` run every control period before the step, ``effort_controls`` before every step; ``step_observers`` run
    after every step, ``observers`` after every ``monitor_every``-th. ``torques``: efforts of parts that command torques
    at the driven joints, NaN for joints moved by the engine's motors.
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
        self._contacts: Sequence[ContactPoint] = ()
        self._contacts_at = -1
        self.ledger.seal()

    @property
    def elapsed(self) -> float:
        """Seconds since the scene was built."""
        return self.steps * self.parameters.time_step

    @property
    def now(self) -> float:
        """The robot's time, seconds: ``epoch``, the start of this simulation, plus the steps since then."""
        return self.epoch + self.elapsed

    def step(self) -> None:
        """Execute one physics step: due controllers before it, observers after it."""
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
        """Free the engine's resources."""
        self._engine.close()

    def reader(self, purpose: ReadPurpose) -> Reader:
        """Return a view of the ground truth for the calling module; its reads are counted if it opens after
        ``close_truth``.
        """
        return Reader(self._engine, self._guarded, purpose, sys._getframe(1).f_globals.get("__name__", ""))

    def actor(self) -> Engine:
        """Return the engine for parts that act on the world, such as a suction cup; its calls are not counted if it is
        obtained before ``close_truth``.
        """
        return self.engine if self.ledger.truth_closed else self._engine

    def slots(self, joint_names: Sequence[str]) -> NDArray[np.intp]:
        """Return the indices of joints in ``joint_states``."""
        return np.array([self._slots[joint] for joint in joint_names], dtype=np.intp)

    def joints(self, joint_names: Sequence[str]) -> list[int]:
        """Return the engine's numbers of the robot's joints."""
        return [self.built.joints[joint] for joint in joint_names]

    def release(self, joints: Sequence[int]) -> None:
        """Switch off the engine's motors at joints of the robot, so that torques can be commanded."""
        nothing = [0.0] * len(joints)
        self._engine.turn(self.built.robot, joints, nothing, nothing)

    def joint_states(self) -> Array:
        """Return the encoders of all driven joints: rows position, velocity, motor effort; read at most once per
        step.
        """
        if self._read_at != self.steps:
            self._states = np.array(self._engine.joint_states(self.built.robot, self._joints))
            self._read_at = self.steps
        return self._states

    def efforts(self) -> Array:
        """Return the motor efforts at the driven joints; with commanded torques the engine's value is stale."""
        return np.where(np.isnan(self.torques), self.joint_states()[2], self.torques)

    def contacts(self, reader: Reader) -> Sequence[ContactPoint]:
        """Return all contacts; read at most once per step.

        Reading only those of the robot would take as long.
        """
        if self._contacts_at != self.steps or not reader.trusted:
            self._contacts = reader.contacts()
            self._contacts_at = self.steps
        return self._contacts

    def link_pose(self, reader: Reader, link: str) -> Pose:
        """Return the true pose of a link of the robot in the map frame. Raises SimulationError listing the links."""
        links = self.built.links
        if link in self.built.frames:
            holder, holder_from_frame = self.built.frames[link]
            return self.link_pose(reader, holder) @ holder_from_frame
        if link not in links:
            raise SimulationError(f"robot {self.model.name!r} has no link {link!r}; it has {', '.join(links)}")
        pose: Pose = reader.link_pose(self.built.robot, links[link])
        return pose

    def holder(self, frame: str) -> int:
        """Return the number of the robot's link that is, or carries, a frame."""
        return self.built.links[self.built.frames.get(frame, (frame, None))[0]]


class SimulatedChannel:
    """Base class of channels to simulated actuators: the simulation, attached while connected."""

    _attached_to: Simulation | None = None
    motors: Engine

    @property
    def simulation(self) -> Simulation:
        """The running simulation. Raises NotConnectedError without one."""
        if self._attached_to is None:
            raise NotConnectedError("the robot is not connected; call connect()")
        return self._attached_to

    def attach(self, simulation: Simulation) -> None:
        """Connect to a running simulation; the actuator holds its position."""
        self._attached_to, self.motors = simulation, simulation.actor()

    def detach(self) -> None:
        """Disconnect from the simulation; idempotent."""
        self._attached_to = None
