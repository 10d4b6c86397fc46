"""What closing asks of the arm: where to push at a front, and on which tool poses it goes shut."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import islice
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from behaviours.context import SkillContext
from behaviours.leaf import Leaf
from bestman_bt.messages import Box, PlacedShape, Pose
from bestman_bt.world_model import handle_shape

if TYPE_CHECKING:
    from bestman_bt.control.arm import FollowGuide, JointAxis
    from bestman_bt.manipulation.kinematics import ArcPath
    from bestman_bt.robot_model import GripperModel

STEP = 0.04
"""Metres of the pushed point's way between two stations."""
BEFORE = 0.08
"""Metres before the front from which the hand comes."""
ROOM = 0.075
"""Metres from the pushed point to any handle."""
PALM_GAP = 0.01
"""Metres that the palm keeps from the front and its handles, in addition to what the map may be off."""
PALM_STEP = 0.03
"""Metres, at most, between the points that stand for the palm."""
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
"""How many places are tried with each pitch."""


@dataclass(frozen=True, eq=False)
class Push:
    """One way to push: ``point`` (3,) on the front, in the front board's frame (x inwards), and how the hand is held.

    ``tip``: metres from the tool frame to the finger tips, along z of the tool. ``palm``: (N, 3) metres, points all
    over the palm in the tool frame. ``handles``: what stands out of the front, in the front board's frame.
    """

    leaf: Leaf
    start: float
    point: NDArray[np.float64]
    roll: float
    pitch: float
    tip: float
    palm: NDArray[np.float64]
    handles: tuple[PlacedShape, ...] = ()

    @property
    def lever(self) -> float:
        """Metres that the pushed point moves per unit of the joint."""
        return self.leaf.lever(self.at(0.0))

    @cached_property
    def tilts(self) -> tuple[float, ...]:
        """Turns of the hand beside the leaf's own, about its hinge, with which the fingers alone touch the leaf.

        A drawer's hand has no turn but 0. Empty where the palm would touch the front or a handle with any of them.
        """
        return tuple(
            tilt for tilt in ((0.0,) if self.leaf.leaf.kind == "prismatic" else TILTS) if self._palm_is_free(tilt)
        )

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

    def _palm_is_free(self, tilt: float) -> bool:
        """Whether the palm keeps clear of the leaf while the finger tips are at the pushed point.

        Where the tips touch, the front is there, wherever the map has it. How the front is turned, and where on it the
        tips are, is off by what the map is off.
        """
        board, piece = self.leaf.leaf.shapes[0].shape, self.leaf.furniture
        assert isinstance(board, Box)
        palm = self._front_from_tool(tilt).apply(self.palm)
        room = -palm[:, 0] - board.size[0] / 2 - PALM_GAP
        if self.leaf.leaf.kind == "revolute":
            from_hinge = np.cross(self._hinge, [1.0, 0.0, 0.0])
            turned = piece.position_error / self.lever + piece.heading_error
            room -= turned * np.abs((palm - self.point) @ from_hinge)
        before = (np.abs(palm[:, 1:]) < np.array(board.size[1:]) / 2 + piece.position_error).all(axis=1)
        if (before & (room < 0.0)).any():
            return False
        gap = PALM_GAP + piece.position_error
        return all((_distance(handle, palm) > gap).all() for handle in self.handles)

    def _tool(self, position: float, tilt: float, back: float) -> Pose:
        """The finger tips at the pushed point, or ``back`` metres before it, in the map frame."""
        return self.leaf.front(position) @ self._front_from_tool(tilt, back)

    def _front_from_tool(self, tilt: float, back: float = 0.0) -> Pose:
        """The hand beside the front board: z of the tool into it, turned by pitch, roll and tilt."""
        inwards = Pose.from_matrix(_INWARDS) @ _about([1.0, 0.0, 0.0], -self.pitch) @ _about([0.0, 0.0, 1.0], self.roll)
        hand = _about(self._hinge, tilt) @ inwards if tilt else inwards
        return Pose(self.point - (self.tip + back) * hand.rotation[:, 2], hand.quaternion)

    @cached_property
    def _hinge(self) -> NDArray[np.float64]:
        """The joint's axis, (3,) unit, in the front board's frame: the same wherever the leaf is."""
        axis: NDArray[np.float64] = self.leaf.front(self.start).rotation.T @ self.leaf.axis()[1]
        return axis


_INWARDS = np.array([[0.0, 0.0, 1.0, 0.0], [-1.0, 0.0, 0.0, 0.0], [0.0, -1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
"""front_from_tool: z inwards, y down."""


def _about(axis: object, angle: float) -> Pose:
    direction = np.asarray(axis, dtype=float)
    return Pose(np.zeros(3), np.append(math.sin(angle / 2) * direction, math.cos(angle / 2)))


def pushes(skills: SkillContext, leaf: Leaf) -> Iterator[Push]:
    """Ways to push a leaf shut, best places first: far from its hinge, or in the middle of a drawer; no handle near."""
    start = max(0.0, skills.world.articulations.get(leaf.articulation, 0.0))
    tip, palm = skills.gripper_model.part.pad_size[1] / 2, _palm(skills.gripper_model)
    map_from_front = leaf.front(start)
    seen = [handle_shape(belief.handle) for belief in skills.world.handles_of(leaf.furniture, leaf.leaf)]
    handles = tuple(PlacedShape(bar.shape, map_from_front.inverse() @ bar.pose) for bar in seen)
    points = _points(leaf, handles)
    for pitch in PITCHES:
        here = ([Push(leaf, start, point, roll, pitch, tip, palm, handles) for roll in ROLLS] for point in points)
        free = ([push for push in held if push.tilts] for held in here)
        for held in islice(filter(None, free), POINTS):
            yield from held


def _palm(gripper: GripperModel) -> NDArray[np.float64]:
    """Points (N, 3) all over the palm of a hand with closed fingers, tool frame, ``PALM_STEP`` apart."""
    from bestman_bt.perception.grasp_pose import HandShape, HandSize

    centres, halves = HandShape(gripper, HandSize()).boxes(np.array([gripper.part.min_width]))
    centre, half = centres[0, 2], halves[0, 2]
    steps = [np.linspace(-extent, extent, 2 + int(2 * extent / PALM_STEP)) for extent in half]
    points: NDArray[np.float64] = centre + np.stack(np.meshgrid(*steps), axis=-1).reshape(-1, 3)
    return points


def _distance(placed: PlacedShape, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Metres (N,) from a box to points (N, 3) in the frame of its pose; 0 inside."""
    assert isinstance(placed.shape, Box)
    outside = np.abs(placed.pose.inverse().apply(points)) - np.array(placed.shape.size) / 2
    distance: NDArray[np.float64] = np.linalg.norm(np.maximum(outside, 0.0), axis=1)
    return distance


def _points(leaf: Leaf, handles: Sequence[PlacedShape]) -> list[NDArray[np.float64]]:
    front = leaf.leaf.shapes[0]
    assert isinstance(front.shape, Box)
    thickness, width, height = front.shape.size
    grid = np.array([[-thickness / 2, y * width, z * height] for y in ACROSS for z in UP])
    free = np.ones(len(grid), dtype=bool)
    for handle in handles:
        free &= _distance(handle, grid) > ROOM
    aside = np.linalg.norm(grid[:, 1:] / (width, height), axis=1)
    if leaf.leaf.kind == "prismatic":
        order = np.argsort(aside, kind="stable")
    else:
        levers = np.array([leaf.lever(point) for point in leaf.front(0.0).apply(grid)])
        free &= levers > SHORT_LEVER * levers.max()
        order = np.argsort(np.abs(levers / levers.max() - 0.8) + 0.5 * np.abs(grid[:, 2] / height), kind="stable")
    return [grid[index] for index in order if free[index]]
