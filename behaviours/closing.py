"""What closing asks of the arm: where to push at a front, and on which tool poses it goes shut."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from behaviours.context import SkillContext
from behaviours.leaf import Leaf
from bestman_bt.messages import Box, Pose
from bestman_bt.world_model import handle_shape

if TYPE_CHECKING:
    from bestman_bt.control.arm import FollowGuide, JointAxis
    from bestman_bt.manipulation.kinematics import ArcPath

STEP = 0.04
"""Metres of the pushed point's way between two stations."""
BEFORE = 0.08
"""Metres before the front from which the hand comes."""
ROOM = 0.075
"""Metres from the pushed point to any handle: half a hand."""
ACROSS = (0.0, -0.12, 0.12, -0.25, 0.25, -0.38, 0.38)
"""Places on a front, as shares of its width, and, the same, of its height."""
UP = (0.0, 0.3, -0.3, 0.15, -0.15, 0.42, -0.42)
ROLLS = tuple(math.radians(degrees) for degrees in (0, 90, 180, 270))
"""Turns of the hand about its own axis."""
PITCHES = tuple(math.radians(degrees) for degrees in (0, 35, 65))
"""By which the hand points downwards."""
TILTS = tuple(math.radians(degrees) for degrees in range(-50, 51, 10))
"""Turns of the hand about a hinge, from straight at a door."""
SHORT_LEVER = 0.5
"""Share of the longest lever below which a place on a door is not pushed at."""
POINTS = 6


@dataclass(frozen=True, eq=False)
class Push:
    """One way to push: ``point`` (3,) on the front, in the front board's frame (x inwards), and how the hand is held.

    ``tip``: metres from the tool frame to the finger tips, along z of the tool.
    """

    leaf: Leaf
    start: float
    point: NDArray[np.float64]
    roll: float
    pitch: float
    tip: float

    @property
    def lever(self) -> float:
        """Metres that the pushed point moves per unit of the joint."""
        return self.leaf.lever(self.at(0.0))

    @property
    def tilts(self) -> tuple[float, ...]:
        """Turns of the hand beside the leaf's own, about its hinge; a drawer's has none."""
        return (0.0,) if self.leaf.leaf.kind == "prismatic" else TILTS

    def at(self, position: float) -> NDArray[np.float64]:
        """Where the pushed point is in the map, (3,), when the leaf is open by ``position``."""
        point: NDArray[np.float64] = self.leaf.front(position).apply(self.point[None])[0]
        return point

    def positions(self) -> list[float]:
        """Where the leaf is at the stations, from where it is believed to be to closed."""
        count = 1 + max(1, math.ceil(self.start * self.lever / STEP))
        return [float(position) for position in np.linspace(self.start, 0.0, count)]

    def stations(self, back: float = 0.0) -> list[list[Pose]]:
        """Tool poses in the map frame, per station one for each tilt; ``back``: metres before the front."""
        return [[self._tool(position, tilt, back) for tilt in self.tilts] for position in self.positions()]

    def axis(self) -> JointAxis:
        """The joint's axis in the map frame; it closes in the positive sense."""
        from bestman_bt.control.arm import JointAxis

        point, direction = self.leaf.axis()
        if self.leaf.leaf.kind == "prismatic":
            return JointAxis("prismatic", self.at(self.start), -direction, 0.0, 0.0)
        return JointAxis("revolute", point, -direction, self.lever, 0.0)

    def opening(self, tip: NDArray[np.float64]) -> float:
        """How far the leaf is open, radians or metres, with the finger tips (3,), map frame, at its front."""
        axis = self.axis()
        if axis.kind == "prismatic":
            return axis.travelled(tip, self.at(0.0))
        return axis.angle(tip, self.at(0.0))

    def guide(self, arc: ArcPath) -> FollowGuide:
        """What hand and arm are to do along the way."""
        from bestman_bt.control.arm import FollowGuide

        closed_by = self.start - np.array(self.positions()[: len(arc.path)])
        tilts = np.array([self.tilts[option] for option in arc.options])
        door = np.zeros(len(tilts)) if self.leaf.leaf.kind == "prismatic" else closed_by
        return FollowGuide(self.lever * closed_by, door - (tilts - tilts[0]), arc.path, np.array([0.0, 0.0, self.tip]))

    def _tool(self, position: float, tilt: float, back: float) -> Pose:
        """The finger tips at the pushed point; z of the tool into the front, turned by pitch, roll and tilt."""
        inwards = Pose.from_matrix(_INWARDS) @ _about([1.0, 0.0, 0.0], -self.pitch) @ _about([0.0, 0.0, 1.0], self.roll)
        hand = Pose(np.zeros(3), self.leaf.front(position).quaternion) @ inwards
        if tilt:
            hand = _about(self.leaf.axis()[1], tilt) @ hand
        return Pose(self.at(position) - (self.tip + back) * hand.rotation[:, 2], hand.quaternion)


_INWARDS = np.array([[0.0, 0.0, 1.0, 0.0], [-1.0, 0.0, 0.0, 0.0], [0.0, -1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
"""front_from_tool: z inwards, y down."""


def _about(axis: object, angle: float) -> Pose:
    direction = np.asarray(axis, dtype=float)
    return Pose(np.zeros(3), np.append(math.sin(angle / 2) * direction, math.cos(angle / 2)))


def pushes(skills: SkillContext, leaf: Leaf) -> Iterator[Push]:
    """Ways to push a leaf shut, best places first: far from its hinge, or in the middle of a drawer; no handle near."""
    start = max(0.0, skills.world.articulations.get(leaf.articulation, 0.0))
    tip = skills.gripper_model.pad_size[1] / 2
    for pitch in PITCHES:
        for point in _points(skills, leaf):
            for roll in ROLLS:
                yield Push(leaf, start, point, roll, pitch, tip)


def _points(skills: SkillContext, leaf: Leaf) -> list[NDArray[np.float64]]:
    front = leaf.leaf.shapes[0]
    assert isinstance(front.shape, Box)
    thickness, width, height = front.shape.size
    grid = np.array([[-thickness / 2, y * width, z * height] for y in ACROSS for z in UP])
    position = skills.world.articulations.get(leaf.articulation, 0.0)
    in_map = leaf.front(position).apply(grid)
    free = np.ones(len(grid), dtype=bool)
    for belief in skills.world.handles_of(leaf.furniture, leaf.leaf):
        placed = handle_shape(belief.handle)
        assert isinstance(placed.shape, Box)
        outside = np.abs(placed.pose.inverse().apply(in_map)) - np.array(placed.shape.size) / 2
        free &= np.linalg.norm(np.maximum(outside, 0.0), axis=1) > ROOM
    aside = np.linalg.norm(grid[:, 1:] / (width, height), axis=1)
    if leaf.leaf.kind == "prismatic":
        order = np.argsort(aside, kind="stable")
    else:
        levers = np.array([leaf.lever(point) for point in in_map])
        free &= levers > SHORT_LEVER * levers.max()
        order = np.argsort(np.abs(levers / levers.max() - 0.8) + 0.5 * np.abs(grid[:, 2] / height), kind="stable")
    return [grid[index] for index in order if free[index]][:POINTS]
