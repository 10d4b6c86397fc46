"""The audit monitor: observes the simulation 60 times a second and records violations."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Collection, Mapping
from typing import Literal

import numpy as np

from bestman_bt.messages import GRAVITY
from bestman_bt.scene.scene import World
from hal.simulation.audit_record import AuditRecord, DisturbanceEvent, DisturbanceLog, Finding
from hal.simulation.bodies import BodyState, Vector
from hal.simulation.contact_watcher import ContactWatcher
from hal.simulation.door_watcher import DoorWatcher
from hal.simulation.guards import Reader, ReadPurpose
from hal.simulation.motion_watcher import MotionWatcher
from hal.simulation.observation import Observer, SimulationState
from hal.simulation.simulation import Simulation

Door = tuple[int, int]
"""Body and link of a door or drawer."""

WINDOW = 0.5
MOVED = 3e-3
SAME = 0.25
PRESSING_SHARE = 0.1
ROLLING = 1.5


class AttachmentCheck:
    """Detects attached objects: for half a second, an object moved as a finger did while the robot pressed on it with
    less than a tenth of its weight.

    Carrying needs normal forces of the weight divided by the friction; pushing needs the friction on the table. Objects
    in a drawer move with it while a hand pulls the handle; they are not reported.
    """

    def __init__(self, simulation: Simulation, reader: Reader) -> None:
        built, parameters = simulation.built, simulation.parameters
        self._names = {body: name for name, body in built.objects.items()}
        self._link_names = {index: name for name, index in built.links.items()}
        self._weights = {body: GRAVITY * mass for body, mass in built.object_masses.items()}
        self._doors = set(built.articulations.values())
        self._joint_states = reader.joint_states
        length = max(2, round(WINDOW * parameters.step_rate / parameters.monitor_every))
        self._history: deque[tuple[SimulationState, dict[int, float]]] = deque(maxlen=length)
        self._drawers: deque[dict[int, tuple[Door, float]]] = deque(maxlen=length)
        self._following: set[int] = set()
        self._looks = 0
        self.findings: list[Finding] = []

    def watch(
        self, observation: SimulationState, robot_forces: Mapping[int, float], put_down: Collection[int] = ()
    ) -> None:
        """Process one observation and the normal forces of the robot on each body, newtons.

        ``put_down``: objects placed by a script: their half second of observation restarts.
        """
        if put_down:
            self._history.clear()
            self._drawers.clear()
        self._history.append((observation, dict(robot_forces)))
        self._drawers.append(self._drawers_below(observation))
        self._looks += 1
        if len(self._history) < (self._history.maxlen or 0) or self._looks % 5:
            return
        then = self._history[0][0]
        for body in self._names:
            moved = math.dist(then.bodies[body].position, observation.bodies[body].position)
            finger = self._finger_that_moved_alike(body, then, observation) if moved > MOVED else None
            if (
                finger is None
                or self._is_pressed(body)
                or self._is_rolling(body, observation)
                or self._is_in_moving_drawer(body)
            ):
                self._following.discard(body)
            elif body not in self._following:
                self._following.add(body)
                text = f"{self._names[body]} moved {1e3 * moved:.1f} mm with {self._link_names[finger]}, unpressed"
                self.findings.append(Finding(observation.stamp, text))

    def _finger_that_moved_alike(self, body: int, then: SimulationState, now: SimulationState) -> int | None:
        object_motion = _difference(now.bodies[body].position, then.bodies[body].position)
        for finger, position in now.fingers.items():
            finger_motion = _difference(position, then.fingers[finger])
            length = math.hypot(*finger_motion)
            if length > MOVED and math.dist(object_motion, finger_motion) < SAME * length:
                return finger
        return None

    def _is_pressed(self, body: int) -> bool:
        mean = sum(forces.get(body, 0.0) for _, forces in self._history) / len(self._history)
        return bool(mean > PRESSING_SHARE * self._weights[body])

    def _drawers_below(self, observation: SimulationState) -> dict[int, tuple[Door, float]]:
        """Return, for objects that touch a door or drawer, which it is and how far it is open."""
        below: dict[int, tuple[Door, float]] = {}
        if not self._doors:
            return below
        for contact in observation.contacts:
            first, second, first_link, second_link, *_ = contact
            for body, door in ((first, (second, second_link)), (second, (first, first_link))):
                if body in self._names and door in self._doors:
                    below[body] = (door, self._joint_states(door[0], door[1:])[0][0])
        return below

    def _is_in_moving_drawer(self, body: int) -> bool:
        """Return whether it touched the same door then and now, and that has moved meanwhile."""
        seen = [drawers[body] for drawers in self._drawers if body in drawers]
        return len(seen) > 1 and seen[0][0] == seen[-1][0] and abs(seen[-1][1] - seen[0][1]) > MOVED / 2

    @staticmethod
    def _is_rolling(body: int, now: SimulationState) -> bool:
        return math.hypot(*now.bodies[body].angular) > ROLLING


def _difference(a: Vector, b: Vector) -> Vector:
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


FIXED_BODY_MOVED = 1e-4


class IntegrityCheck:
    """Compares constants and constraints with those of the time at which the scene was built."""

    def __init__(self, simulation: Simulation, reader: Reader) -> None:
        built = simulation.built
        self._engine, self._reader = simulation.actor(), reader
        self._fixed = {**built.walls, **built.furniture, "floor": built.floor}
        self._constraints = self._engine.constraint_count()
        self._constants = self._engine.constants()
        self._places = {name: self._place(body) for name, body in self._fixed.items()}
        self.hidden_constraints: list[Finding] = []
        self.changes: list[Finding] = []
        self.jumps: list[Finding] = []

    def watch_constraints(self, stamp: float) -> None:
        """Compare the constraints; cheap, at every observation."""
        count = self._engine.constraint_count()
        if count != self._constraints:
            self.hidden_constraints.append(Finding(stamp, f"there are {count} constraints, {self._constraints} before"))
            self._constraints = count

    def watch_everything(self, stamp: float, slippery: Collection[str] = ()) -> None:
        """Compare everything, occasionally and at the end; ``slippery``: objects that may be without friction."""
        self.watch_constraints(stamp)
        before, now = self._constants, dict(self._engine.constants())
        for key in (f"friction of {name}" for name in slippery):
            now[key] = tuple(old if new == 0.0 else new for new, old in zip(now[key], before[key], strict=True))
        for key, value in now.items():
            if value != before.get(key):
                self.changes.append(Finding(stamp, f"{key} changed from {before.get(key)} to {value}"))
        self._constants = now
        for name, body in self._fixed.items():
            place = self._place(body)
            if math.dist(place, self._places[name]) > FIXED_BODY_MOVED:
                self.jumps.append(Finding(stamp, f"{name}, which is fixed, has moved"))
                self._places[name] = place

    def _place(self, body: int) -> tuple[float, ...]:
        position, quaternion = self._reader.body_pose(body)
        return (*position, *quaternion)


class ContactsBetweenObservations:
    """Contact forces in each step until the next observation, of moving objects on which the robot presses with less
    than their weight.

    A pushed object hops: it may touch nothing at each of several observations, and touch hand and table between them.
    """

    def __init__(self, simulation: Simulation, reader: Reader) -> None:
        built = simulation.built
        self._robot, self._contacts = built.robot, reader.contacts
        self._weights = {body: GRAVITY * mass for body, mass in built.object_masses.items()}
        self._steps = 0
        self._forces: dict[int, float] = {}
        self._robot_forces: dict[int, float] = {}

    def begin(self, awake: Collection[int], robot_forces: Mapping[int, float]) -> None:
        """Begin after an observation; ``robot_forces``: the robot's normal force on each body, newtons."""
        weights = self._weights
        watched = [body for body in awake if body in weights and robot_forces.get(body, 0.0) < weights[body]]
        self._forces, self._robot_forces = dict.fromkeys(watched, 0.0), dict.fromkeys(watched, 0.0)
        self._steps = 0

    def watch_step(self) -> None:
        """Process the contacts of one physics step."""
        self._steps += 1
        for body in self._forces:
            for contact in self._contacts(body):
                self._forces[body] += contact.pressure
                if contact.second == self._robot:
                    self._robot_forces[body] += contact.pressure

    def touched(self) -> set[int]:
        """Return those of these objects whose mean normal forces sum to more than a tenth of their weight."""
        least = PRESSING_SHARE * self._steps
        return {body for body, force in self._forces.items() if force > least * self._weights[body]}

    def mean_forces(self) -> dict[int, float]:
        """Return the robot's mean normal forces on these objects where it touched them, newtons."""
        return {body: force / self._steps for body, force in self._robot_forces.items() if force > 0.0}


FULL_CHECK_EVERY = 60
PUT_THERE = (2e-3, 1e-2)
"""Largest deviation of an object from the pose set by an intervention, at the next observation, metres and radians."""


class AuditMonitor:
    """Watches one simulation of ``world`` from the moment its scene is built.

    Events in ``disturbance_log`` are excused: each explains the motion of one object, door or drawer for a while. They
    remain in the record, even if the log changes; the evaluation compares them with the task's own script.
    """

    def __init__(self, simulation: Simulation, world: World) -> None:
        self._simulation = simulation
        reader = simulation.reader(ReadPurpose.MONITOR)
        self._observer = Observer(simulation, reader)
        self._contacts = ContactWatcher(simulation)
        self._between = ContactsBetweenObservations(simulation, reader)
        self._motions = MotionWatcher(simulation, reader)
        self._doors = DoorWatcher(simulation, world, reader)
        self._open_hand = AttachmentCheck(simulation, reader)
        self._integrity = IntegrityCheck(simulation, reader)
        self.disturbance_log = DisturbanceLog()
        self._events: tuple[DisturbanceEvent, ...] = ()
        self._new: list[DisturbanceEvent] = []
        self._looks = self._steps = 0
        simulation.step_observers.append(self._after_step)
        simulation.observers.append(self._look)

    def record(self) -> AuditRecord:
        """Return the record so far."""
        simulation, motions, doors, integrity = self._simulation, self._motions, self._doors, self._integrity
        stamp, counts = simulation.elapsed, simulation.ledger.counts
        self._take_in_events()
        integrity.watch_everything(stamp, self._forgiven("slip", stamp))
        return AuditRecord(
            duration=stamp,
            resets=counts["resets"],
            constraints=counts["constraints"],
            truth_reads=counts["truth_reads"],
            tampering=counts["tampering"],
            calls=dict(simulation.ledger.calls),
            jumps=tuple(sorted([*motions.jumps, *doors.jumps, *integrity.jumps], key=lambda finding: finding.stamp)),
            hidden_constraints=tuple(integrity.hidden_constraints),
            changes=tuple(integrity.changes),
            unexplained_forces=(*motions.unexplained_forces, *doors.unexplained_forces),
            joint_limits=tuple(motions.joint_limits),
            velocity_limits=tuple(motions.velocity_limits),
            open_hand=tuple(self._open_hand.findings),
            contacts=self._contacts.incidents(),
            penetrations=self._contacts.penetrations(),
            disturbances=tuple(
                sorted(
                    (
                        *simulation.walkers.log,
                        *simulation.moving_doors.log,
                        *(Finding(event.stamp, event.text) for event in self._events),
                        *self.disturbance_log.log,
                    ),
                    key=lambda finding: finding.stamp,
                )
            ),
            events=self._events,
            missed_looks=max(0, simulation.steps // simulation.parameters.monitor_every - self._looks)
            + max(0, simulation.steps - self._steps),
        )

    def _after_step(self) -> None:
        self._take_in_events()
        self._motions.integrate()
        self._between.watch_step()
        self._doors.watch_step(self._forgiven("push", self._simulation.elapsed))
        self._steps += 1

    def _look(self) -> None:
        motions, contacts = self._motions, self._contacts
        observation = self._observer.observe()
        slipping = self._forgiven("slip", observation.stamp)
        contacts.watch(observation, slipping)
        put_down = self._put_down(observation)
        touched = contacts.touched | self._between.touched()
        robot_forces = contacts.robot_forces | self._between.mean_forces()
        motions.watch(observation, touched, robot_forces, put_down)
        self._open_hand.watch(observation, robot_forces, put_down)
        self._between.begin(motions.awake, contacts.robot_forces)
        self._integrity.watch_constraints(observation.stamp)
        self._looks += 1
        if self._looks % FULL_CHECK_EVERY == 0:
            self._integrity.watch_everything(observation.stamp, slipping)

    def _take_in_events(self) -> None:
        """Record new events after every step; they are never dropped."""
        events = self.disturbance_log.events
        if events != self._events:
            new = [event for event in events if event not in self._events]
            self._events += tuple(new)
            self._new += new

    def _forgiven(self, kind: Literal["slip", "push"], now: float) -> frozenset[str]:
        """Return the objects, or doors and drawers, to which that is being done."""
        return frozenset(
            event.name
            for event in self._events
            if event.kind == kind and event.stamp <= now <= event.until and not self.disturbance_log.rests(event)
        )

    def _put_down(self, observation: SimulationState) -> set[int]:
        """Return the objects that interventions have put at their current poses since the look before."""
        objects = self._simulation.built.objects
        new, self._new = self._new, []
        return {
            objects[event.name]
            for event in new
            if event.kind == "put" and _is_at(observation.bodies[objects[event.name]], event.pose)
        }


def _is_at(state: BodyState, pose: tuple[float, ...]) -> bool:
    cosine = min(1.0, abs(float(np.dot(state.quaternion, pose[3:]))))
    return math.dist(state.position, pose[:3]) < PUT_THERE[0] and 2.0 * math.acos(cosine) < PUT_THERE[1]
