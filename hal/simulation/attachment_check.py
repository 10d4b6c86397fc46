"""Watches for objects that move with a hand that does not press on them: glue, whatever it is made of."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Collection, Mapping

from hal.simulation.audit_record import Finding
from hal.simulation.bodies import Vector
from hal.simulation.guards import Reader
from hal.simulation.observation import Observation
from hal.simulation.simulation import Simulation

Leaf = tuple[int, int]
"""Body and link of a door or drawer."""

WINDOW = 0.5
MOVED = 3e-3
SAME = 0.25
PRESSING_SHARE = 0.1
ROLLING = 1.5
GRAVITY = 9.81


class AttachmentCheck:
    """Over half a second: an object moved as a finger did, while the robot pressed on it with less than a tenth of
    its weight. To carry takes normal forces of its weight over the friction; to push takes its friction on the table.

    What lies in a drawer goes with it while a hand pulls the handle: that is the drawer's doing.
    """

    def __init__(self, simulation: Simulation, reader: Reader) -> None:
        built, parameters = simulation.built, simulation.parameters
        self._names = {body: name for name, body in built.objects.items()}
        self._link_names = {index: name for name, index in built.links.items()}
        self._weights = {body: GRAVITY * mass for body, mass in built.object_masses.items()}
        self._leaves = set(built.articulations.values())
        self._joint_states = reader.joint_states
        length = max(2, round(WINDOW * parameters.step_rate / parameters.monitor_every))
        self._history: deque[tuple[Observation, dict[int, float]]] = deque(maxlen=length)
        self._drawers: deque[dict[int, tuple[Leaf, float]]] = deque(maxlen=length)
        self._following: set[int] = set()
        self._looks = 0
        self.findings: list[Finding] = []

    def watch(
        self, observation: Observation, robot_forces: Mapping[int, float], put_down: Collection[int] = ()
    ) -> None:
        """Take in one observation and the normal forces of the robot on each body.

        ``put_down``: objects that a script has put where they are: the half second begins anew.
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

    def _finger_that_moved_alike(self, body: int, then: Observation, now: Observation) -> int | None:
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

    def _drawers_below(self, observation: Observation) -> dict[int, tuple[Leaf, float]]:
        """For objects that touch a door or drawer: which, and how far that is open."""
        below: dict[int, tuple[Leaf, float]] = {}
        if not self._leaves:
            return below
        for contact in observation.contacts:
            first, second, first_link, second_link, *_ = contact
            for body, leaf in ((first, (second, second_link)), (second, (first, first_link))):
                if body in self._names and leaf in self._leaves:
                    below[body] = (leaf, self._joint_states(leaf[0], leaf[1:])[0][0])
        return below

    def _is_in_moving_drawer(self, body: int) -> bool:
        """Whether it touched the same leaf then and now, and that has moved meanwhile."""
        seen = [drawers[body] for drawers in self._drawers if body in drawers]
        return len(seen) > 1 and seen[0][0] == seen[-1][0] and abs(seen[-1][1] - seen[0][1]) > MOVED / 2

    @staticmethod
    def _is_rolling(body: int, now: Observation) -> bool:
        return math.hypot(*now.bodies[body].angular) > ROLLING


def _difference(a: Vector, b: Vector) -> Vector:
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])
