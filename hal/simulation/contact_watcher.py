"""Records contacts of the robot and its held objects, and the penetration depth of bodies."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Iterable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bestman_bt.robot_model.model import BaseModel, GripperModel, LeggedBaseModel, WheeledBaseModel
from bestman_bt.robot_model.part_config import SuctionPart
from hal.simulation.audit_record import Body, ContactIncident, Penetration
from hal.simulation.bodies import BodyState, BuiltWorld, ContactPoint
from hal.simulation.observation import SimulationState
from hal.simulation.simulation import Simulation

FORCE_THRESHOLD = 1.0
GAP = 0.25


class ContactWatcher:
    """Sums contact forces by pair of links or bodies, except wheels and casters on the floor."""

    def __init__(self, simulation: Simulation) -> None:
        built, model = simulation.built, simulation.model
        self._robot, self._floor = built.robot, built.floor
        self._objects = frozenset(built.objects.values())
        self._minded = self._objects | {built.robot}
        self._names = built.body_names
        kinds: dict[Body, Iterable[int]] = {
            "floor": [built.floor],
            "wall": built.walls.values(),
            "furniture": built.furniture.values(),
            "object": built.objects.values(),
            "walker": [body for body, _ in built.walkers.values()],
        }
        self._kinds = {body: kind for kind, bodies in kinds.items() for body in bodies}
        self._doors = {place: name for name, place in built.articulations.items()}
        self._link_names = {index: name for name, index in built.links.items()}
        self._fingers = frozenset(
            built.links[link] for hand in model.of(GripperModel).values() for link in hand.part.finger_links
        )
        self._cups = frozenset(
            built.links[hand.part.cup] for hand in model.of(GripperModel).values() if isinstance(hand.part, SuctionPart)
        )
        self._rolling = frozenset(
            index for base in model.of(BaseModel).values() for index in _on_the_floor(base, built)
        )
        self._walkers = frozenset(body for body, _ in built.walkers.values()) | simulation.moving_doors.bodies
        self._approach = ApproachWatcher(built.robot)
        self._period = simulation.parameters.monitor_every * simulation.parameters.time_step
        self._running: dict[tuple[str, str, str], ContactIncident] = {}
        self._ended: list[ContactIncident] = []
        self._deepest: dict[tuple[int, int, int, int], tuple[float, float]] = {}
        self.robot_forces: defaultdict[int, float] = defaultdict(float)
        self.touched: set[int] = set()

    def watch(self, observation: SimulationState, falling: Collection[str] = ()) -> None:
        """Process one observation.

        ``falling``: objects that are slipping out of the hand; their impacts are not attributed to the robot.
        """
        fallen = {body for body in self._objects if self._names[body] in falling}
        forces: defaultdict[tuple[int, int, int, int], float] = defaultdict(float)
        robot, floor, rolling = self._robot, self._floor, self._rolling
        walkers, minded = self._walkers, self._minded
        for contact in observation.contacts:
            body_a, body_b, link_a, link_b, _, _, _, distance, force, *_ = contact
            if body_b == robot and (body_a != robot or link_b < link_a):
                body_a, body_b, link_a, link_b = body_b, body_a, link_b, link_a
            if body_a == robot and body_b == floor and link_a in rolling:
                continue
            if (body_a in walkers or body_b in walkers) and body_a not in minded and body_b not in minded:
                continue  # what people do to each other and to walls is none of the robot's doing
            if body_b in walkers and body_a == robot:
                self._approach.take(contact, observation, self._period)
            if force > 0.0:
                forces[body_a, link_a, body_b, link_b] += force
            falls = body_a != robot and (body_a in fallen or body_b in fallen)
            if distance < 0.0 and not falls:
                pair = (body_a, link_a, body_b, link_b)
                deepest = self._deepest.get(pair)
                if deepest is None or distance < deepest[0]:
                    self._deepest[pair] = (distance, observation.stamp)
        self._note_forces(forces, observation.stamp)
        self._approach.look_ends(observation)

    def incidents(self) -> tuple[ContactIncident, ...]:
        """Return all incidents up to now, by start."""
        return tuple(sorted([*self._ended, *self._running.values()], key=lambda incident: incident.start))

    def penetrations(self) -> tuple[Penetration, ...]:
        """Return the deepest overlap of each pair, deepest first."""
        overlaps = [
            Penetration(self._name(body_a, link_a), self._name(body_b, link_b), -distance, stamp)
            for (body_a, link_a, body_b, link_b), (distance, stamp) in self._deepest.items()
        ]
        return tuple(sorted(overlaps, key=lambda overlap: -overlap.depth))

    def _note_forces(self, forces: dict[tuple[int, int, int, int], float], stamp: float) -> None:
        """Record which hands hold which objects, then what the robot and the held objects press on.

        Two fingers hold an object, or a suction cup that presses on it.
        """
        grips: defaultdict[int, set[int]] = defaultdict(set)
        self.robot_forces = defaultdict(float)
        self.touched = set()
        for (body_a, link_a, body_b, _), force in forces.items():
            self.touched.update((body_a, body_b))
            if body_a == self._robot:
                self.robot_forces[body_b] += force
                if link_a in self._fingers and force > FORCE_THRESHOLD and body_b in self._objects:
                    grips[body_b].add(link_a)
        held = {body for body, links in grips.items() if len(links) > 1 or links & self._cups}
        for (body_a, link_a, body_b, link_b), force in forces.items():
            if body_a != self._robot and not (body_a in held or body_b in held):
                continue
            if body_a != self._robot and body_b in held and body_a not in held:
                body_a, link_a, body_b, link_b = body_b, link_b, body_a, link_a
            if force > FORCE_THRESHOLD:
                by_walker = (
                    body_b in self._walkers and body_a == self._robot and not self._approach.ours(link_a, body_b)
                )
                seen = ContactIncident(
                    self._name(body_a, link_a),
                    self._name(body_b, link_b),
                    (self._kind(body_a, link_a), self._kind(body_b, link_b)),
                    stamp,
                    stamp,
                    force,
                    by_walker,
                    self._doors.get((body_b, link_b), ""),
                )
                self._note_incident(seen)
        for pair in [pair for pair, incident in self._running.items() if stamp - incident.end > GAP]:
            self._ended.append(self._running.pop(pair))

    def _note_incident(self, seen: ContactIncident) -> None:
        pair = seen.first, seen.second, seen.articulation
        running = self._running.get(pair)
        if running is not None:
            seen = replace(
                running,
                end=seen.end,
                peak_force=max(running.peak_force, seen.peak_force),
                by_walker=seen.by_walker and running.by_walker,
            )
        self._running[pair] = seen

    def _kind(self, body: int, link: int) -> Body:
        if body == self._robot:
            return "fingers" if link in self._fingers else "robot"
        return self._kinds.get(body, "other")

    def _name(self, body: int, link: int) -> str:
        if body == self._robot:
            return self._link_names[link]
        return self._names.get(body, f"body {body}")


def _on_the_floor(base: BaseModel, built: BuiltWorld) -> list[int]:
    """Return the links that roll or step: casters, wheels, feet."""
    if isinstance(base, WheeledBaseModel):
        casters, wheels = base.part.caster_links, base.part.wheel_joints
        return [*(built.links[link] for link in casters), *(built.joints[joint] for joint in wheels)]
    return [built.links[foot] for foot in base.part.feet] if isinstance(base, LeggedBaseModel) else []


CLOSING = 0.02
"""Speed towards the other body, just before the contact, from which the robot counts as its cause, m/s."""
PUSHING = 0.01
"""Motion towards the other body during contact above which a body counts as moving, metres; recoil is less."""
APART = 0.25
"""Seconds without contact after which a contact has ended."""

Pair = tuple[int, int]  # a link of the robot and the other body


@dataclass
class _Touch:
    """``ours``: it is the robot's doing. ``way``: metres that it has moved towards the other, ``least`` so far."""

    ours: bool
    stamp: float
    way: float = 0.0
    least: float = 0.0


class ApproachWatcher:
    """Processes the contacts of an observation one by one; the cause is determined from the motion of the robot's body.

    An impact changes velocities, so the first contact is judged by the velocities of the observation before, 1/60 s
    earlier; later, by how far the body has moved towards the other.
    """

    def __init__(self, robot: int) -> None:
        self._robot = robot
        self._before: BodyState | None = None
        self._touches: dict[Pair, _Touch] = {}

    def take(self, contact: ContactPoint, observation: SimulationState, period: float) -> None:
        """Process a contact between the robot and a walker, in either order."""
        body_a, body_b, link_a, link_b, on_a, _, normal_on_b, *_ = contact
        first = body_a == self._robot
        pair = (link_a, body_b) if first else (link_b, body_a)
        # From the robot to the other: the normal points from the second body to the first.
        towards = -np.array(normal_on_b) if first else np.array(normal_on_b)
        state = self._before or observation.bodies[self._robot]
        closing = _closing(state, np.array(on_a), towards)
        touch = self._touches.get(pair)
        if touch is None or observation.stamp - touch.stamp > APART:
            self._touches[pair] = _Touch(closing > CLOSING, observation.stamp)
            return
        if observation.stamp > touch.stamp:
            touch.way += closing * period
            touch.least = min(touch.least, touch.way)
            touch.ours = touch.ours or touch.way - touch.least > PUSHING
            touch.stamp = observation.stamp

    def ours(self, link: int, other: int) -> bool:
        """Return whether the robot caused the current contact of a link with ``other``."""
        touch = self._touches.get((link, other))
        return touch is None or touch.ours

    def look_ends(self, observation: SimulationState) -> None:
        """End the current observation."""
        self._before = observation.bodies[self._robot]


def _closing(state: BodyState, point: NDArray[np.float64], towards: NDArray[np.float64]) -> float:
    """Return the speed of a point of the robot's body towards the other, m/s."""
    return float(towards @ (np.array(state.linear) + np.cross(state.angular, point - np.array(state.position))))
