"""What opening asks of the arm: how far, about what, on which tool poses, and what it must keep clear of meanwhile."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from behaviours.arm_motion import hand_contacts
from behaviours.context import SkillContext
from behaviours.skill import SkillFailure
from bestman_bt.manipulation.collision import CollisionWorld, planning_scene_from_world_model
from bestman_bt.messages import Handle, Pose, Pose2D
from bestman_bt.perception.grasp_pose import handle_motion
from bestman_bt.world_model import BasePose, HandleBelief, MapFurniture, MapLeaf

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


@dataclass(frozen=True, eq=False)
class Opening:
    """A door or drawer to be opened: its handle in the map frame, and how far that is to go, metres along its way.

    ``angle``: radians, of a door; None of a drawer. ``asked``: what counts as done, radians or metres.
    """

    articulation: str
    furniture: MapFurniture
    leaf: MapLeaf
    handle: Handle
    asked: float
    distance: float
    angle: float | None

    def way(self) -> NDArray[np.float64]:
        """Metres from closed at which the stations are, first 0."""
        return np.linspace(0.0, self.distance, 1 + max(1, round(self.distance / STEP)))

    def turns(self) -> tuple[float, ...]:
        """Shares of the leaf's turn by which the hand may turn with it: a bar along the hinge turns between fingers."""
        axis = self.handle.hinge_direction
        if self.angle is None or axis is None:
            return (1.0,)
        parallel = self.handle.kind == "bar" and abs(float(self.handle.axis @ axis)) > PARALLEL
        return (1.0, 0.5, 0.75, 0.25, 0.0) if parallel else (1.0,)

    def bodies(self) -> list[str]:
        """Names of the bodies in the planning scene that the hand works at."""
        return [self.furniture.name, *(f"{self.furniture.name}/{leaf.name}" for leaf in self.furniture.leaves)]


def find_leaf(skills: SkillContext, articulation: str) -> tuple[MapFurniture, MapLeaf]:
    """The door or drawer ``furniture/leaf`` of the map; SkillFailure names what there is."""
    known = skills.world.map.furniture
    name, _, part = articulation.partition("/")
    leaf = next((leaf for leaf in known[name].leaves if leaf.name == part), None) if name in known else None
    if leaf is None:
        there = ", ".join(f"{piece.name}/{one.name}" for piece in known.values() for one in piece.leaves)
        raise SkillFailure("unknown_articulation", f"no door or drawer {articulation!r} in the map; there are {there}")
    return known[name], leaf


def leaf_front(furniture: MapFurniture, leaf: MapLeaf) -> Pose:
    """The middle of the leaf's front board when it is closed, in the map frame."""
    return furniture.pose.to_pose() @ leaf.shapes[0].pose


def plan_opening(skills: SkillContext, articulation: str, belief: HandleBelief, asked: float) -> Opening:
    """What the map says of the kind of joint goes before what the handle's looks suggest; its hinge is a guess."""
    furniture, leaf = find_leaf(skills, articulation)
    handle = belief.handle
    if leaf.kind == "prismatic":
        distance = min(asked + DRAWER_MARGIN, END_STOP * leaf.upper)
        return Opening(articulation, furniture, leaf, replace(handle, joint="prismatic"), asked, distance, None)
    if handle.joint != "revolute" or handle.hinge is None or handle.hinge_direction is None:
        frame = furniture.pose.to_pose()
        hinge, axis = frame.apply(np.array([leaf.origin]))[0], frame.rotation @ np.array(leaf.axis)
        handle = replace(handle, joint="revolute", hinge=hinge, hinge_direction=axis)
    assert handle.hinge is not None
    assert handle.hinge_direction is not None
    radius = float(np.linalg.norm(np.cross(handle.hinge_direction, handle.pose.position - handle.hinge)))
    angle = min(asked + DOOR_MARGIN, END_STOP * leaf.upper)
    return Opening(articulation, furniture, leaf, handle, asked, angle * radius, angle)


def stations(opening: Opening, grasp: Pose, turn: float = 1.0, base_from_map: Pose | None = None) -> list[list[Pose]]:
    """Tool poses along the way, one per station, from ``grasp`` on; in the base frame if ``base_from_map`` is given.

    ``turn``: share of the leaf's turn that the hand turns with it.
    """
    handle = opening.handle if base_from_map is None else opening.handle.seen_from(base_from_map)
    poses = []
    for distance in opening.way():
        moved = handle_motion(handle, float(distance)) @ grasp
        poses.append([Pose(moved.position, (handle_motion(handle, turn * float(distance)) @ grasp).quaternion)])
    return poses


def world_at_leaf(
    skills: SkillContext,
    opening: Opening,
    position: float,
    stand: Pose2D | None = None,
    touching: bool = True,
    ignore: Iterable[str] = (),
) -> CollisionWorld:
    """What the arm has around it while the leaf is open by ``position``, radians or metres.

    ``stand``: where the base will be, None where it is. ``touching``: whether the hand may touch the furniture.
    ``ignore``: names to leave out.
    """
    world = replace(skills.world, articulations={**skills.world.articulations, opening.articulation: position})
    if stand is not None:
        world = replace(world, base=BasePose(stand, 0.0, 0.0, skills.clock.now()))
    bodies = opening.bodies()
    scene = planning_scene_from_world_model(
        world,
        skills.robot,
        skills.joints.positions(),
        skills.arm.name,
        ignore=ignore,
        allowed_pairs=hand_contacts(skills, *bodies) if touching else (),
        hollow=[opening.furniture.name],
    )
    return skills.arm_world(scene)
