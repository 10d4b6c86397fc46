"""Geometry of opening for the arm: distance, hinge, tool poses."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from behaviours.context import SkillContext
from behaviours.furniture.articulation import (
    MEASURED,
    ArticulationPath,
    FurnitureArticulation,
    OpeningWorlds,
    Touching,
    find_articulation,
    stands_along_opening,
    world_at_opening,
)
from behaviours.manipulation.grasp_candidates import handle_grasp_candidates
from behaviours.parameters import OpenParameters
from bestman_bt.messages import Handle, Pose
from bestman_bt.world_model.world_model import HandleBelief

if TYPE_CHECKING:
    from bestman_bt.control.arm.constraint_following import FollowGuide
    from bestman_bt.control.arm.joint_axis import JointAxis
    from bestman_bt.manipulation.kinematics.arc_path import ArcPath
    from bestman_bt.perception.grasp_pose.base import GraspCandidate


STEP = 0.04
"""Metres of the handle's path between two stations."""
PARALLEL = 0.98
"""Smallest cosine between bar and hinge with which the bar may turn between the fingers."""
TILTS = tuple(math.radians(degrees) for degrees in range(-50, 51, 10))
"""Rotations of the hand about a bar, relative to the normal of the front."""


@dataclass(frozen=True, eq=False)
class Opening:
    """A door to open: its handle in the map frame, and the ``distance`` of the handle along its path, metres.

    ``angle``: radians, for a door; None for a drawer. ``asked``: the target opening, radians or metres. ``start``: the
    believed opening. ``most_tilt``: largest rotation of the hand relative to the door, radians.
    """

    door: FurnitureArticulation
    handle: Handle
    asked: float
    start: float
    distance: float
    angle: float | None
    most_tilt: float = TILTS[-1]
    parameters: OpenParameters = field(default_factory=OpenParameters)

    def way(self) -> NDArray[np.float64]:
        """Return the distances of the stations from the start, metres, first 0."""
        return np.linspace(0.0, self.distance, 1 + max(1, math.ceil(self.distance / STEP)))

    def positions(self) -> list[float]:
        """Return the door positions at the stations, radians or metres from closed."""
        further = self.distance if self.angle is None else self.angle
        return [self.start + share * further for share in np.linspace(0.0, 1.0, len(self.way()))]

    def axis(self, base_from_map: Pose) -> JointAxis | None:
        """Return the believed hinge of a door in the base frame, or None; a positive motion opens it."""
        from bestman_bt.control.arm.joint_axis import JointAxis

        handle = self.handle.seen_from(base_from_map)
        if self.angle is None or handle.hinge is None or handle.hinge_direction is None:
            return None
        return JointAxis("revolute", handle.hinge, handle.hinge_direction, _radius(handle), 0.0)

    @property
    def touching(self) -> Touching:
        """The allowed contact: fingers around a bar stay clear of the front; those at a knob or a lip may touch it."""
        free = self.handle.kind == "bar" and self.handle.standoff > self.parameters.finger_room
        return "nothing" if free else "fingers"

    @property
    def bar_turns(self) -> bool:
        """Whether the hand may rotate about the held part: a bar parallel to the hinge rotates between the fingers."""
        axis = self.handle.hinge_direction
        if self.angle is None or axis is None or self.handle.kind != "bar":
            return False
        return abs(float(self.handle.axis @ axis)) > PARALLEL

    def held_at(self, grasp: Pose) -> NDArray[np.float64]:
        """Return the grasped point of a turning bar, on its axis, in the tool frame, metres; otherwise the origin.

        ``grasp``: tool pose in the map frame.
        """
        if not self.bar_turns:
            return np.zeros(3)
        apart = grasp.position - self.handle.pose.position
        on_bar = self.handle.pose.position + float(apart @ self.handle.axis) * self.handle.axis
        held: NDArray[np.float64] = grasp.inverse().apply(on_bar[None])[0]
        return held

    def tilts(self, grasp: Pose) -> tuple[float, ...]:
        """Return the rotations about the hinge that ``grasp`` (map frame) allows relative to the door, ascending, with
        0.
        """
        axis = self.handle.hinge_direction
        if not self.bar_turns or axis is None:
            return (0.0,)
        inwards = -self.handle.outward
        now = math.atan2(float(np.cross(inwards, grasp.rotation[:, 2]) @ axis), float(inwards @ grasp.rotation[:, 2]))
        return tuple(
            sorted({0.0, *(t - now for t in TILTS if abs(t) <= self.most_tilt and abs(t - now) > math.radians(5.0))})
        )


def plan_opening(skills: SkillContext, articulation: str, belief: HandleBelief, asked: float) -> Opening:
    """Return the opening to plan for; the map's joint has priority over the handle's appearance, and contact refines
    it.

    Raises SkillFailure (``bad_input``) if the door cannot be open as far as requested.
    """
    door = find_articulation(skills, articulation)
    door.check_opening("opening", asked)
    start = skills.world.articulations.get(articulation, 0.0)
    parameters = skills.parameters.open
    margin = parameters.drawer_margin if door.articulation.kind == "prismatic" else parameters.door_margin
    end = min(asked + margin, parameters.max_opening * door.articulation.upper)
    further = max(end - start, STEP)
    handle = belief.handle
    if door.articulation.kind == "prismatic":
        _, direction = door.axis()
        handle = replace(handle, joint="prismatic", opening_direction=direction)
        return Opening(door, handle, asked, start, further, None, parameters=parameters)
    hinge, axis = door.axis()
    opening = np.cross(axis, handle.pose.position - hinge)
    opening = opening / np.linalg.norm(opening)
    handle = replace(handle, joint="revolute", hinge=hinge, hinge_direction=axis, opening_direction=opening)
    most_tilt = TILTS[-1] if door.furniture.position_error <= MEASURED else _palm_limit(skills, handle)
    return Opening(door, handle, asked, start, further * _radius(handle), further, most_tilt, parameters)


def _palm_limit(skills: SkillContext, handle: Handle) -> float:
    """Return the largest rotation about a bar, radians, before a corner of the palm touches the front.

    If the map is too uncertain to check the palm, the detected handle gives the distance of the front.
    """
    from bestman_bt.perception.grasp_pose.hand_shape import HandSize

    depth, half = skills.gripper_model.part.finger_depth, HandSize().palm_size[1] / 2
    room = max(0.0, handle.standoff - skills.parameters.open.palm_gap)
    return math.asin(min(1.0, room / math.hypot(depth, half))) + math.atan2(depth, half)


def stations(
    opening: Opening, grasp: Pose, tilts: tuple[float, ...] = (0.0,), base_from_map: Pose | None = None
) -> list[list[Pose]]:
    """Return the tool poses along the path from ``grasp`` (map frame): at each station one per tilt of the hand.

    They are in the base frame if ``base_from_map`` is given.
    """
    from bestman_bt.perception.grasp_pose.hand_poses import handle_motion

    handle, frame = opening.handle, base_from_map or Pose()
    turned = [_turned(opening, grasp, tilt) for tilt in tilts]
    return [[frame @ handle_motion(handle, float(distance)) @ pose for pose in turned] for distance in opening.way()]


def before(opening: Opening, grasp: Pose, pre_grasp: Pose, tilts: tuple[float, ...]) -> list[Pose]:
    """Return the start of the straight approach to the rotated ``grasp`` for each tilt, map frame."""
    return [_turned(opening, grasp, tilt) @ grasp.inverse() @ pre_grasp for tilt in tilts]


def guide(opening: Opening, grasp: Pose, arc: ArcPath, tilts: tuple[float, ...]) -> FollowGuide:
    """Return the guide of the hand along ``arc`` from ``grasp`` (map frame), whose options are ``tilts``."""
    from bestman_bt.control.arm.constraint_following import FollowGuide

    way = opening.way()[: len(arc.path)]
    hand = np.array([tilts[option] for option in arc.options])
    doors = np.zeros(len(way)) if opening.angle is None else way / _radius(opening.handle)
    return FollowGuide(way, doors + hand - hand[0], arc.path, opening.held_at(grasp))


def _turned(opening: Opening, grasp: Pose, tilt: float) -> Pose:
    """Return the hand turned about the bar that it holds."""
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


ENOUGH = 1
"""Number of grasps that reach the end of the path after which the search stops."""
SAME_PLACE = 0.02
"""Distance between two grasps of a bar below which they count as one, metres."""
SAME_BRANCH = 0.3
"""Largest distance, radians, between the end of the approach and the start posture of the arc."""


@dataclass(frozen=True, eq=False)
class HandlePull:
    """A pull at a handle. ``into``: (N, n) radians, the hand's straight approach around the handle. ``fingers``:
    opening, metres.

    ``reached``: fraction of the path within reach.
    """

    fingers: float
    into: NDArray[np.float64]
    guide: FollowGuide
    reached: float
    score: float

    @property
    def planned(self) -> float:
        """The fraction of the path for which the guide has postures; its first station is the current hand pose."""
        stations = (len(self.guide.ways) + 1) / self.reached - 1  # but for the one before the handle
        return min(1.0, (len(self.guide.ways) - 1) / (stations - 1))


def plan_pull(skills: SkillContext, opening: Opening, belief: HandleBelief) -> HandlePull | None:
    """Return the grasp that lets the arm move furthest from the current base, or None if none is within reach."""
    from bestman_bt.manipulation.kinematics.cartesian_path import cartesian_path

    base_from_map, here = skills.map_from_base.inverse(), [skills.world.base.pose]
    free = world_at_opening(skills, opening.door, opening.start, "free")
    contact = world_at_opening(skills, opening.door, opening.start, "fingers")
    from_here = skills.path_placement.from_fixed_base()
    plans: list[HandlePull] = []
    worlds: OpeningWorlds = {}
    for candidate in pull_grasps(skills, opening, belief):
        grasp, pre_grasp = skills.map_from_base @ candidate.grasp, skills.map_from_base @ candidate.pre_grasp
        tilts = opening.tilts(grasp)
        way = [before(opening, grasp, pre_grasp, tilts), *stations(opening, grasp, tilts)]
        along_door = ArticulationPath(here, way, opening.positions(), opening.touching, skip=1)
        for stand in stands_along_opening(skills, opening.door, along_door, worlds, from_here):
            arc = replace(stand.arc, path=stand.arc.path[1:], options=stand.arc.options[1:])
            if len(arc.path) < 2 or not free.is_free(stand.arc.path[0]):
                continue
            around = base_from_map @ way[1][arc.options[0]]
            into = cartesian_path(skills.kinematics, stand.arc.path[0], around, contact.is_free)
            if into.complete and float(np.abs(into.path[-1] - arc.path[0]).max()) < SAME_BRANCH:
                along = guide(opening, grasp, arc, tilts)
                score = candidate.quality + np.sqrt(arc.margin)
                plans.append(HandlePull(candidate.opening, into.path, along, stand.arc.fraction, float(score)))
        if sum(plan.reached >= 1.0 for plan in plans) >= ENOUGH:
            break
    return max(plans, key=lambda plan: (plan.reached, plan.score)) if plans else None


def pull_grasps(skills: SkillContext, opening: Opening, belief: HandleBelief) -> list[GraspCandidate]:
    """Return grasps of a detected handle in the base frame, best first.

    Of grasps that differ only by a rotation about a bar, only the best is kept.
    """
    from bestman_bt.perception.grasp_pose.ranking import GraspRanking

    ranked = [entry.candidate for entry in GraspRanking().rank(handle_grasp_candidates(skills, belief))]
    if not opening.bar_turns:
        return ranked[: opening.parameters.grasps]
    kept: list[GraspCandidate] = []
    for candidate in (_deeper(candidate, opening) for candidate in ranked):
        same = (
            np.linalg.norm(candidate.grasp.position - other.grasp.position) < SAME_PLACE
            and float(candidate.grasp.rotation[:, 1] @ other.grasp.rotation[:, 1]) > 0.0
            for other in kept
        )
        if not any(same):
            kept.append(candidate)
    return kept[: opening.parameters.grasps]


def _deeper(candidate: GraspCandidate, opening: Opening) -> GraspCandidate:
    """Return the grasp with a bar nearer to the palm, where the finger tips have room before the front."""
    if opening.touching != "nothing":
        return candidate
    parameters = opening.parameters
    grasp, depth = candidate.grasp, parameters.grip_depth * (opening.handle.standoff - parameters.finger_room)
    return replace(candidate, grasp=replace(grasp, position=grasp.position + depth * grasp.rotation[:, 2]))
