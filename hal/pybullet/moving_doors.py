"""Doors that somebody moves before the robot: a scripted disturbance by motors of bounded torque, logged apart."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from bestman_bt.scene import MovingDoor, World
from hal.pybullet.audit_record import Finding
from hal.pybullet.client import PhysicsClient, ReadPurpose
from hal.pybullet.leaf_push import Hand, Push


@dataclass
class _Script:
    """``middle``: of its frame, x and y in the map. ``phase``: 0 waits, 1 moves, 2 rests."""

    door: MovingDoor
    push: Push
    middle: tuple[float, float]
    phase: int = 0


class MovingDoors:
    """Moves the doors of a world's script. ``log``: what was done, to be told with the run as a disturbance of it."""

    def __init__(
        self, client: PhysicsClient, world: World, articulations: Mapping[str, tuple[int, int]], robot: int
    ) -> None:
        self._hand = Hand(client)
        self._reader = client.reader(ReadPurpose.WALKER)
        self._robot = robot
        self._scripts = []
        for door in world.moving_doors:
            piece = next(p for p in world.furniture if p.name == door.leaf.partition("/")[0])
            leaf = next(a for a in piece.model.articulations if a.name == door.leaf.partition("/")[2])
            middle = (piece.actual.x, piece.actual.y)
            push = Push(articulations[door.leaf], leaf, door.to, door.speed, door.torque)
            self._scripts.append(_Script(door, push, middle))
        self.log: list[Finding] = []

    @property
    def bodies(self) -> frozenset[int]:
        """Of the doors that it moves."""
        return frozenset(script.push.place[0] for script in self._scripts)

    def __len__(self) -> int:
        return len(self._scripts)

    def update(self, now: float) -> None:
        """Before each control period; ``now``: seconds since the scene was built."""
        robot, _ = self._reader.getBasePositionAndOrientation(self._robot)
        for script in self._scripts:
            door = script.door
            if script.phase == 0 and math.dist(robot[:2], script.middle) < door.within:
                script.phase = 1
                self.log.append(Finding(now, f"somebody moves {door.leaf} to {math.degrees(door.to):.0f}°"))
            if script.phase == 1 and self._hand.push(script.push):
                script.phase = 2
                self.log.append(Finding(now, f"{door.leaf} has come to {math.degrees(door.to):.0f}°"))
