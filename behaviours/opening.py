"""What opening asks of the arm: how far, about what, and on which tool poses."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from behaviours.context import SkillContext
from behaviours.leaf import MEASURED, Leaf, Touching, find_leaf
from bestman_bt.messages import Handle, Pose
from bestman_bt.world_model import HandleBelief

if TYPE_CHECKING:
    from bestman_bt.control.arm import FollowGuide, JointAxis
    from bestman_bt.manipulation.kinematics import ArcPath

STEP = 0.04
"""Metres of the handle's way between two stations."""
DRAWER_MARGIN = 0.025
"""Metres that a drawer is pulled further than is asked: the hand gives a little, and the drawer rolls back."""
DOOR_MARGIN = 0.09
"""Radians, likewise."""
END_STOP = 0.95
"""Share of a leaf's range that is used at most."""
PARALLEL = 0.98
"""Cosine between bar and hinge from which on the bar may turn between the fingers."""
FINGER_ROOM = 0.03
"""Metres between front and bar from which on fingers around the bar are clear of the front."""
PALM_GAP = 0.01
"""Metres that the palm keeps from a front."""
TILTS = tuple(math.radians(degrees) for degrees in range(-50, 51, 10))
"""Turns of the hand about a bar, from straight at the front."""


@dataclass(frozen=True, eq=False)
class Opening:
    """A leaf to be opened: its handle in the map frame, and how far that is to go, metres along its way.

    ``angle``: radians, of a door; None of a drawer. ``asked``: what counts as done, radians or metres. ``start``: how
    far it is believed to be open already. ``most_tilt``: radians by which the hand may be turned beside the door.
    """

    leaf: Leaf
    handle: Handle
    asked: float
    start: float
    distance: float
    angle: float | None
    most_tilt: float = TILTS[-1]

    def way(self) -> NDArray[np.float64]:
        """Metres from the start at which the stations are, first 0."""
        return np.linspace(0.0, self.distance, 1 + max(1, math.ceil(self.distance / STEP)))

    def positions(self) -> list[float]:
        """Where the leaf is at the stations, radians or metres from closed."""
        further = self.distance if self.angle is None else self.angle
        return [self.start + share * further for share in np.linspace(0.0, 1.0, len(self.way()))]

    def axis(self, base_from_map: Pose) -> JointAxis | None:
        """Where a door's hinge is believed to be, in the base frame; it opens in the positive sense."""
        from bestman_bt.control.arm import JointAxis

        handle = self.handle.seen_from(base_from_map)
        if self.angle is None or handle.hinge is None or handle.hinge_direction is None:
            return None
        return JointAxis("revolute", handle.hinge, handle.hinge_direction, _radius(handle), 0.0)

    @property
    def touching(self) -> Touching:
        """Fingers around a bar reach no further than before the front; those at a knob or a lip may touch it."""
        return "nothing" if self.handle.kind == "bar" and self.handle.standoff > FINGER_ROOM else "fingers"

    @property
    def bar_turns(self) -> bool:
        """Whether the hand may turn about what it holds: a bar along the hinge turns between the fingers."""
        axis = self.handle.hinge_direction
        if self.angle is None or axis is None or self.handle.kind != "bar":
            return False
        return abs(float(self.handle.axis @ axis)) > PARALLEL

    def held_at(self, grasp: Pose) -> NDArray[np.float64]:
        """Where in the tool frame the hand at ``grasp`` (map frame) holds a bar: on its axis; else the origin."""
        if not self.bar_turns:
            return np.zeros(3)
        apart = grasp.position - self.handle.pose.position
        on_bar = self.handle.pose.position + float(apart @ self.handle.axis) * self.handle.axis
        held: NDArray[np.float64] = grasp.inverse().apply(on_bar[None])[0]
        return held

    def tilts(self, grasp: Pose) -> tuple[float, ...]:
        """Turns about the hinge by which ``grasp`` (map frame) may go on beside the door's own, ascending, with 0."""
        axis = self.handle.hinge_direction
        if not self.bar_turns or axis is None:
            return (0.0,)
        inwards = -self.handle.outward
        now = math.atan2(float(np.cross(inwards, grasp.rotation[:, 2]) @ axis), float(inwards @ grasp.rotation[:, 2]))
        return tuple(
            sorted({0.0, *(t - now for t in TILTS if abs(t) <= self.most_tilt and abs(t - now) > math.radians(5.0))})
        )


def plan_opening(skills: SkillContext, articulation: str, belief: HandleBelief, asked: float) -> Opening:
    """What the map says of the joint goes before what the handle's looks suggest; the true axis is felt later.

    SkillFailure (``bad_input``) where the leaf cannot be open as far as asked.
    """
    leaf = find_leaf(skills, articulation)
    leaf.check_opening("opening", asked)
    start = skills.world.articulations.get(articulation, 0.0)
    end = min(asked + (DRAWER_MARGIN if leaf.leaf.kind == "prismatic" else DOOR_MARGIN), END_STOP * leaf.leaf.upper)
    further = max(end - start, STEP)
    handle = belief.handle
    if leaf.leaf.kind == "prismatic":
        _, direction = leaf.axis()
        handle = replace(handle, joint="prismatic", opening_direction=direction)
        return Opening(leaf, handle, asked, start, further, None)
    hinge, axis = leaf.axis()
    opening = np.cross(axis, handle.pose.position - hinge)
    opening = opening / np.linalg.norm(opening)
    handle = replace(handle, joint="revolute", hinge=hinge, hinge_direction=axis, opening_direction=opening)
    most_tilt = TILTS[-1] if leaf.furniture.position_error <= MEASURED else _palm_limit(skills, handle)
    return Opening(leaf, handle, asked, start, further * _radius(handle), further, most_tilt)


def _palm_limit(skills: SkillContext, handle: Handle) -> float:
    """Radians that the hand may be turned about a bar until a corner of its palm is at the front.

    Where the map is too vague to check the palm against it, what was seen of the handle tells how far the front is.
    """
    from bestman_bt.perception.grasp_pose import HandSize

    depth, half = skills.gripper_model.part.finger_depth, HandSize().palm_size[1] / 2
    room = max(0.0, handle.standoff - PALM_GAP)
    return math.asin(min(1.0, room / math.hypot(depth, half))) + math.atan2(depth, half)


def stations(
    opening: Opening, grasp: Pose, tilts: tuple[float, ...] = (0.0,), base_from_map: Pose | None = None
) -> list[list[Pose]]:
    """Tool poses along the way from ``grasp`` (map frame) on: at each station one per tilt of the hand beside the door.

    In the base frame if ``base_from_map`` is given.
    """
    from bestman_bt.perception.grasp_pose import handle_motion

    handle, frame = opening.handle, base_from_map or Pose()
    turned = [_turned(opening, grasp, tilt) for tilt in tilts]
    return [[frame @ handle_motion(handle, float(distance)) @ pose for pose in turned] for distance in opening.way()]


def before(opening: Opening, grasp: Pose, pre_grasp: Pose, tilts: tuple[float, ...]) -> list[Pose]:
    """For each tilt, from where the hand comes straight to the turned ``grasp``, map frame."""
    return [_turned(opening, grasp, tilt) @ grasp.inverse() @ pre_grasp for tilt in tilts]


def guide(opening: Opening, grasp: Pose, arc: ArcPath, tilts: tuple[float, ...]) -> FollowGuide:
    """What the hand is to do along the way of ``arc`` from ``grasp`` (map frame) on, whose options are ``tilts``."""
    from bestman_bt.control.arm import FollowGuide

    way = opening.way()[: len(arc.path)]
    hand = np.array([tilts[option] for option in arc.options])
    doors = np.zeros(len(way)) if opening.angle is None else way / _radius(opening.handle)
    return FollowGuide(way, doors + hand - hand[0], arc.path, opening.held_at(grasp))


def _turned(opening: Opening, grasp: Pose, tilt: float) -> Pose:
    """The hand turned about the bar that it holds."""
    axis = opening.handle.hinge_direction
    if axis is None or tilt == 0.0:
        return grasp
    bar = grasp.apply(opening.held_at(grasp)[None])[0]
    turn = Pose(np.zeros(3), np.append(math.sin(tilt / 2) * axis, math.cos(tilt / 2)))
    return Pose(bar) @ turn @ Pose(-bar) @ grasp


def _radius(handle: Handle) -> float:
    assert handle.hinge is not None
    assert handle.hinge_direction is not None
    return float(np.linalg.norm(np.cross(handle.hinge_direction, handle.pose.position - handle.hinge)))
