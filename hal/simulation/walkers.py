"""People who walk through a scene: their routes, what they yield to, and when they stop."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bestman_bt.scene.scene import Walker, World
from hal.simulation.audit_record import Finding
from hal.simulation.engine import Engine

FORCE = 120.0
"""Largest pushing force of a walker along each axis, newtons: it may walk into a robot, but does not push it away."""
AHEAD = 0.25
"""Lookahead distance of a walker along its route, metres."""
STOPS_BEFORE = 0.9
"""Distance between the centres of a considerate walker and the robot, minus the walker's radius, at which it stops,
metres.
"""
BEHIND_OTHERS = 0.15
"""Distance at which a considerate walker stops behind another one, metres."""
IN_FRONT = math.radians(70.0)
"""Half-angle of the sector ahead in which a considerate walker yields to the robot and others."""
PATIENCE = 4.0
"""Seconds after which a blocked walker turns round."""
GETS_ON = 0.15
"""Distance in that time that counts as progress, metres."""


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
    """Return the unit vector towards a point of the round a little ahead; the nearest is the last or soon after it."""
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
