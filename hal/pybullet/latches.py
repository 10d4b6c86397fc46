"""Latches of doors and drawers: more dry friction near the closed position, as a magnet or a spring catch has it."""

from __future__ import annotations

from dataclasses import dataclass

from bestman_bt.scene import LATCH_TRAVEL, World
from hal.pybullet.client import PhysicsClient
from hal.pybullet.package import pybullet


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

    No latch ever moves anything: it bounds a motor that wants speed 0. ``articulations``: ``furniture/name`` → body and
    joint.
    """

    def __init__(self, client: PhysicsClient, world: World, articulations: dict[str, tuple[int, int]]) -> None:
        self._read = client.function("getJointState")
        self._hold = client.function("setJointMotorControl2")
        self._latches = [
            _Latch(
                *articulations[f"{piece.name}/{leaf.name}"],
                leaf.friction,
                leaf.friction + leaf.latch,
                LATCH_TRAVEL[leaf.kind],
            )
            for piece in world.furniture
            for leaf in piece.model.articulations
            if leaf.latch > 0.0
        ]
        for latch in self._latches:
            self._apply(latch)

    def __len__(self) -> int:
        return len(self._latches)

    def update(self) -> None:
        """Before each physics step."""
        for latch in self._latches:
            caught = abs(self._read(latch.body, latch.joint)[0]) < latch.travel
            if caught != latch.caught:
                latch.caught = caught
                self._apply(latch)

    def _apply(self, latch: _Latch) -> None:
        effort = latch.latched if latch.caught else latch.friction
        self._hold(latch.body, latch.joint, pybullet.VELOCITY_CONTROL, targetVelocity=0.0, force=effort)
