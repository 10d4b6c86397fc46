"""Contacts of fingers that turn together with what they hold, found afresh before their normals are wrong.

Bullet keeps points of contact from step to step and moves them along with the bodies, but not their normals: those
stay as they were in the world (``btPersistentManifold::refreshContactPoints``). Between two bodies that turn together,
as a hand does with what it holds while the base turns, old normals end up pointing anywhere, at worst sideways: what
is held creeps, and fingers that shall open are caught.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from bestman_bt.messages import Pose
from hal.simulation.guards import ReadPurpose
from hal.simulation.simulation import Simulation


class ContactRefresh:
    """Drops the kept contacts of a hand's fingers, one finger after the other, so that the others hold meanwhile.

    ``turn``: radians that the hand may turn until each finger has had its turn.
    """

    def __init__(self, simulation: Simulation, fingers: Sequence[str], turn: float) -> None:
        self._simulation, self._fingers = simulation, tuple(fingers)
        self._reader = simulation.reader(ReadPurpose.SENSOR)
        # Taken before the truth is closed: it changes nothing that touches, and is no tampering.
        self._engine = simulation.actor()
        self._least = math.cos(turn / len(self._fingers) / 2.0)
        self._next = 0
        self._renewed_at = self._pose()

    def follow(self) -> None:
        """Renew the next finger's contacts if the hand has turned far enough."""
        pose = self._pose()
        if abs(float(pose.quaternion @ self._renewed_at.quaternion)) < self._least:
            self._renew(self._fingers[self._next])
            self._next = (self._next + 1) % len(self._fingers)
            self._renewed_at = pose

    def renew_all(self) -> None:
        """Find all contacts afresh in the next step."""
        for finger in self._fingers:
            self._renew(finger)
        self._renewed_at = self._pose()

    def _pose(self) -> Pose:
        return self._simulation.link_pose(self._reader, self._fingers[0])

    def _renew(self, finger: str) -> None:
        built = self._simulation.built
        self._engine.forget_contacts(built.robot, built.links[finger])
