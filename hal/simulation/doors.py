"""Doors and drawers: their latches, hands that push them, and scripts by which a person moves them.

A latch is additional dry friction near the closed position, like that of a magnet or a spring catch. A hand is a motor
of the joint with bounded effort.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from bestman_bt.messages import JointKind
from bestman_bt.scene.scene import LATCH_TRAVEL, Articulation, MovingDoor, World
from hal.simulation.audit_record import Finding
from hal.simulation.engine import Engine


@dataclass
class _Latch:
    body: int
    joint: int
    friction: float
    latched: float
    travel: float
    caught: bool = True


class Latches:
    """Gives each latched joint its breakaway effort while it is closed and its plain friction beyond that.

    A latch never moves a joint: it only bounds the effort of a motor with target speed 0.
    """

    def __init__(self, engine: Engine, world: World) -> None:
        self._engine = engine
        self._latches = [
            _Latch(
                *engine.built.articulations[f"{piece.name}/{door.name}"],
                door.friction,
                door.friction + door.latch,
                LATCH_TRAVEL[door.kind],
            )
            for piece in world.furniture
            for door in piece.model.articulations
            if door.latch > 0.0
        ]
        for latch in self._latches:
            self._apply(latch)

    def __len__(self) -> int:
        return len(self._latches)

    def update(self) -> None:
        """Update the latches before each physics step."""
        for latch in self._latches:
            caught = abs(_position(self._engine, (latch.body, latch.joint))) < latch.travel
            if caught != latch.caught:
                latch.caught = caught
                self._apply(latch)

    def _apply(self, latch: _Latch) -> None:
        effort = latch.latched if latch.caught else latch.friction
        self._engine.turn(latch.body, [latch.joint], [0.0], [effort])


ARRIVED: dict[JointKind, float] = {"revolute": math.radians(1.0), "prismatic": 0.004}
"""Distance from its goal at which a hand releases the door, radians or metres; less than the range of a latch."""


@dataclass(frozen=True)
class DoorPush:
    """A push on a door or drawer. ``place``: body and joint. The joint moves to the opening ``to``, radians or metres,
    at ``speed``, rad/s or m/s. ``effort``: maximum effort, N m or N, beyond the friction of the joint.
    """

    place: tuple[int, int]
    door: Articulation
    to: float
    speed: float
    effort: float


class Hand:
    """Pushes doors and drawers with the force of a hand, for scripted disturbances."""

    def __init__(self, engine: Engine) -> None:
        self._engine = engine

    def push(self, push: DoorPush) -> bool:
        """Push for one control period. Returns True, and releases, at the target."""
        left = push.to - _position(self._engine, push.place)
        if abs(left) < ARRIVED[push.door.kind]:
            self.rest(push)
            return True
        self._turn(push, math.copysign(push.speed, left), push.door.friction + push.effort)
        return False

    def rest(self, push: DoorPush) -> None:
        """Release the door, which is then held by its friction and, near the closed position, by its latch."""
        door = push.door
        caught = abs(_position(self._engine, push.place)) < LATCH_TRAVEL[door.kind]
        self._turn(push, 0.0, door.friction + door.latch if caught else door.friction)

    def _turn(self, push: DoorPush, speed: float, effort: float) -> None:
        body, joint = push.place
        self._engine.turn(body, [joint], [speed], [effort])


def _position(engine: Engine, place: tuple[int, int]) -> float:
    """Return how far a door or drawer is open, radians or metres."""
    body, joint = place
    return float(engine.joint_states(body, [joint])[0][0])


@dataclass
class _Script:
    """``middle``: of its frame, x and y in the map. ``phase``: 0 waits, 1 moves, 2 rests."""

    door: MovingDoor
    push: DoorPush
    middle: tuple[float, float]
    phase: int = 0


class MovingDoors:
    """Moves the doors of a world's script. ``log``: their motions, reported as disturbances of the run."""

    def __init__(self, engine: Engine, world: World) -> None:
        self._engine, self._hand = engine, Hand(engine)
        self._scripts = []
        for door in world.moving_doors:
            name, _, part = door.articulation.partition("/")
            piece = next(p for p in world.furniture if p.name == name)
            moved = next(a for a in piece.model.articulations if a.name == part)
            middle = (piece.actual.x, piece.actual.y)
            push = DoorPush(engine.built.articulations[door.articulation], moved, door.to, door.speed, door.torque)
            self._scripts.append(_Script(door, push, middle))
        self.log: list[Finding] = []

    @property
    def bodies(self) -> frozenset[int]:
        """Return the bodies of the doors that it moves."""
        return frozenset(script.push.place[0] for script in self._scripts)

    def __len__(self) -> int:
        return len(self._scripts)

    def update(self, now: float) -> None:
        """Move the doors before each control period; ``now``: seconds since the scene was built."""
        robot, _ = self._engine.body_pose(self._engine.built.robot)
        for script in self._scripts:
            door = script.door
            if script.phase == 0 and math.dist(robot[:2], script.middle) < door.within:
                script.phase = 1
                self.log.append(Finding(now, f"a person moves {door.articulation} to {math.degrees(door.to):.0f}°"))
            if script.phase == 1 and self._hand.push(script.push):
                script.phase = 2
                self.log.append(Finding(now, f"{door.articulation} has come to {math.degrees(door.to):.0f}°"))
