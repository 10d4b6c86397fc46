"""Suction cups as a channel: an object that closes the rim is held with at most the rated force."""

from __future__ import annotations

import math

from typing_extensions import override

from bestman_bt.robot_model.part_config import SuctionPart
from hal.parts.channels import GripperChannel, GripperReading
from hal.simulation.bodies import Vector
from hal.simulation.engine import Engine
from hal.simulation.guards import Reader, ReadPurpose
from hal.simulation.parameters import SimulationParameters
from hal.simulation.simulation import SimulatedChannel, Simulation

# The rim lies flat where its axis is this near to the surface's normal; a vacuum takes so long to build, seconds.
FLAT = math.cos(math.radians(20.0))
BUILD_UP = 0.15


class SuctionPump(SimulatedChannel, GripperChannel):
    """A cup that sucks at width 0 and releases at any other. While the rim lies flat on a body, the vacuum presses the
    two together with equal and opposite forces. No constraint is used: friction at the rim holds sideways, and a pull
    beyond the rated force separates them. The width is nominal: half of the full width while an object is held; while
    sucking air, it falls to 0 in twice the time that a vacuum needs to build up.
    """

    reaction_time = 0.0

    def __init__(self, cup: SuctionPart, parameters: SimulationParameters) -> None:
        self._part, self._parameters = cup, parameters
        self._reader: Reader | None = None
        self._engine: Engine | None = None
        self._cup = -1
        self._force = 0.0  # N, asked for; 0: the pump is off
        self._width = cup.max_width
        self._sealed_for = 0.0

    def attach(self, simulation: Simulation) -> None:
        """Connect with the pump off."""
        super().attach(simulation)
        self._reader = simulation.reader(ReadPurpose.SENSOR)
        self._engine = simulation.actor()  # of a declared cup: not the audit's tampering
        self._cup = simulation.built.links[self._part.cup]
        self._force = self._sealed_for = 0.0
        self._width = self._part.max_width
        simulation.effort_controls.append(self._suck)

    @override
    def detach(self) -> None:
        super().detach()
        self._reader = self._engine = None

    def read(self) -> GripperReading:
        """Return the reading of the vacuum sensor."""
        width = self._part.max_width / 2 if self._sealed_for > 0.0 else self._width
        return GripperReading(width, object_held=self._sealed_for >= BUILD_UP)

    def send(self, width: float, force: float, speed: float) -> None:
        """Switch the pump on (``width`` 0) or off; ``speed`` has no effect."""
        if width > 1e-6:
            self._force, self._width, self._sealed_for = 0.0, width, 0.0
        else:
            self._force = force

    def halt(self) -> None:
        """Do nothing: the pump keeps its state, so that a held object does not fall."""

    def _suck(self) -> None:
        if self._force > 0.0:
            sinking = self._part.max_width * self._parameters.time_step / (2.0 * BUILD_UP)
            self._width = max(0.0, self._width - sinking)
        touched = self._touched() if self._force > 0.0 else None
        if touched is None or self._engine is None:
            self._sealed_for = 0.0
            return
        body, link, point, axis = touched
        self._sealed_for += self._parameters.time_step
        force = self._force * min(1.0, self._sealed_for / BUILD_UP)
        x, y, z = (force * value for value in axis)
        self._engine.push(body, link, (-x, -y, -z), point)
        self._engine.push(self.simulation.built.robot, self._cup, (x, y, z), point)

    def _touched(self) -> tuple[int, int, Vector, Vector] | None:
        """Return the body and link that the rim lies flat on, the middle of the contact, and the axis out of the
        cup.
        """
        if self._reader is None:
            return None
        simulation = self.simulation
        robot = simulation.built.robot
        pose = simulation.link_pose(self._reader, self._part.cup)
        x, y, z = pose.rotation[:, 2].tolist()
        points: dict[tuple[int, int], list[Vector]] = {}
        for contact in self._reader.contacts(robot, self._cup):
            body, link, at, normal, gap = contact[1], contact[3], contact[5], contact[6], contact[7]
            # The normal points from the touched body to the cup.
            facing = -(normal[0] * x + normal[1] * y + normal[2] * z)
            if body != robot and gap <= self._part.seal_gap and facing > FLAT:
                points.setdefault((body, link), []).append(at)
        if not points:
            return None
        (body, link), found = max(points.items(), key=lambda item: (len(item[1]), -item[0][0]))
        n = len(found)
        middle = (sum(p[0] for p in found) / n, sum(p[1] for p in found) / n, sum(p[2] for p in found) / n)
        return body, link, middle, (x, y, z)
