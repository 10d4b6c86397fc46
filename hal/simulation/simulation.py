"""One running simulation: the built world, the robot's encoders, and the loop that steps physics and controllers."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import cast

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import Pose
from bestman_bt.robot_model.model import BaseModel, GripperModel, JointedModel, RobotModel
from bestman_bt.scene.scene import Walker, World
from hal.api import NotConnectedError
from hal.simulation.audit_record import Finding
from hal.simulation.bodies import Array, ContactPoint, SimulationError
from hal.simulation.doors import Latches, MovingDoors
from hal.simulation.engine import Engine
from hal.simulation.guards import GuardedEngine, Reader, ReadPurpose
from hal.simulation.parameters import SimulationParameters

FORCE = 120.0
"""Newtons that a walker pushes with, at most, along each axis: it walks into a robot, and does not shove it away."""
AHEAD = 0.25
"""Metres along its round to the point that a walker makes for."""
STOPS_BEFORE = 0.9
"""Metres between the middles of a considerate walker and the robot, beyond the walker's radius, at which it stops."""
BEHIND_OTHERS = 0.15
"""Distance at which a considerate walker stops behind another one, metres."""
IN_FRONT = math.radians(70.0)
"""From its direction, each way: where a considerate walker minds the robot and others."""
PATIENCE = 4.0
"""Seconds after which a walker that is blocked turns round."""
GETS_ON = 0.15
"""Metres in that time that count as getting on."""


@dataclass
class _Walk:
    """``body``, ``slides``: in the physics. ``at``: index of the point of the round that it is near.

    ``sense``: 1 or -1, which way round. ``since``, ``place``: when it last got on, and where it was then.
    """

    walker: Walker
    body: int
    slides: tuple[int, int]
    route: NDArray[np.float64]
    at: int = 0
    sense: int = 1
    since: float = 0.0
    place: tuple[float, float] = (0.0, 0.0)
    waits: bool = False


class Walkers:
    """Moves all walkers of a world. ``log``: their motions, reported as disturbances of the run."""

    def __init__(self, engine: Engine, world: World) -> None:
        self._engine = engine
        self._walks = [
            _Walk(walker, *engine.built.walkers[walker.name], np.array(walker.route), place=walker.route[0])
            for walker in world.walkers
        ]
        self.log = [
            Finding(
                0.0, f"{walk.walker.name} walks a round of {_length(walk.route):.1f} m at {walk.walker.speed:.2f} m/s"
            )
            for walk in self._walks
        ]

    def __len__(self) -> int:
        return len(self._walks)

    def update(self, now: float) -> None:
        """Move the walkers before each control period; ``now``: seconds since the scene was built."""
        robot, _ = self._engine.body_pose(self._engine.built.robot)
        places = [self._place(walk) for walk in self._walks]
        for walk, here in zip(self._walks, places, strict=True):
            self._turn_if_stuck(walk, here, now)
            direction, radius = _direction(walk, here), walk.walker.radius
            waits = walk.walker.considerate and _is_ahead(here, direction, robot[:2], STOPS_BEFORE + radius)
            if waits and not walk.waits:
                self.log.append(Finding(now, f"{walk.walker.name} stops before the robot"))
            walk.waits = waits
            queues = walk.walker.considerate and any(
                _is_ahead(here, direction, place, BEHIND_OTHERS + radius + other.walker.radius)
                for other, place in zip(self._walks, places, strict=True)
                if other is not walk
            )
            speed = 0.0 if waits or queues else walk.walker.speed
            speeds = [speed * direction[0], speed * direction[1]]
            self._engine.turn(walk.body, walk.slides, speeds, [FORCE, FORCE])

    def _place(self, walk: _Walk) -> tuple[float, float]:
        x, y = self._engine.joint_states(walk.body, walk.slides)[0]
        start = walk.walker.route[0]
        return start[0] + x, start[1] + y

    def _turn_if_stuck(self, walk: _Walk, here: tuple[float, float], now: float) -> None:
        if math.dist(here, walk.place) > GETS_ON:
            walk.since, walk.place = now, here
        elif now - walk.since > PATIENCE:
            walk.since, walk.sense = now, -walk.sense
            self.log.append(Finding(now, f"{walk.walker.name} turns round"))


def _direction(walk: _Walk, here: tuple[float, float]) -> tuple[float, float]:
    """Return the unit vector towards a point of the route a little ahead; the nearest one is the last
    or soon after it.
    """
    count = len(walk.route)
    window = (walk.at + walk.sense * np.arange(5)) % count
    distances = np.hypot(walk.route[window, 0] - here[0], walk.route[window, 1] - here[1])
    walk.at = int(window[int(np.argmin(distances))])
    target = walk.at
    for _ in range(count):
        if math.dist(walk.route[target], here) >= AHEAD:
            break
        target = (target + walk.sense) % count
    dx, dy = float(walk.route[target][0]) - here[0], float(walk.route[target][1]) - here[1]
    length = max(math.hypot(dx, dy), 1e-9)
    return dx / length, dy / length


def _is_ahead(
    here: tuple[float, float], direction: tuple[float, float], there: tuple[float, float], within: float
) -> bool:
    dx, dy = there[0] - here[0], there[1] - here[1]
    distance = math.hypot(dx, dy)
    return distance < within and dx * direction[0] + dy * direction[1] > distance * math.cos(IN_FRONT)


def _length(route: NDArray[np.float64]) -> float:
    return float(np.linalg.norm(route - np.roll(route, 1, axis=0), axis=1).sum())


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
        """The robot's time: ``epoch``, when this simulation began, and the steps since then; seconds."""
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
        """Return the engine for parts that act on the world, such as a suction cup; not counted if taken before
        ``close_truth``.
        """
        return self.engine if self.ledger.truth_closed else self._engine

    def slots(self, joint_names: Sequence[str]) -> NDArray[np.intp]:
        """Return the indices of joints in ``joint_states``."""
        return np.array([self._slots[joint] for joint in joint_names], dtype=np.intp)

    def joints(self, joint_names: Sequence[str]) -> list[int]:
        """Return the engine's numbers of the robot's joints."""
        return [self.built.joints[joint] for joint in joint_names]

    def release(self, joints: Sequence[int]) -> None:
        """Switch the engine's motors at joints of the robot off, so that torques can be commanded."""
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

        Reading only those of the robot takes as long.
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
        """Return the number of the robot's link that carries a frame, or is it."""
        return self.built.links[self.built.frames.get(frame, (frame, None))[0]]


class SimulatedChannel:
    """The base of channels to simulated actuators: the simulation, attached while connected."""

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
