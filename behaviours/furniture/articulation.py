"""Doors and drawers of the map for skills, and the surroundings of the arm there."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from behaviours.arm_motion import hand_contacts
from behaviours.context import DRIVEN, SkillContext
from behaviours.skill import SkillFailure
from bestman_bt.messages import Box, PlacedShape, Pose, Pose2D
from bestman_bt.world_model.semantic_map import MapArticulation, MapFurniture
from bestman_bt.world_model.world_model import BasePose, Obstacle, WorldModel

if TYPE_CHECKING:
    from bestman_bt.manipulation.base_placement import PathPlacement, PathPlacementPlanner
    from bestman_bt.manipulation.collision.base import CollisionWorld
    from bestman_bt.manipulation.collision.planning_scene import PlanningScene
    from bestman_bt.manipulation.kinematics.arc_path import IsFreeAt, Stations
    from bestman_bt.manipulation.kinematics.reachability_map import ReachabilityMap


MEASURED = 0.01
"""Largest position error of furniture, metres, up to which its doors count as known, for the palm too."""

Touching = Literal["free", "nothing", "fingers", "hand"]
"""The parts of the robot that may touch the furniture.

``fingers``: the fingers, only the door or drawer. ``hand``: the whole hand, all of the furniture. ``nothing``: nothing,
if the pose of the furniture is known well; otherwise, and for the fingers too, its boards are thickened by the map's
error, and the hand may be within them. ``free``: nothing, whatever is known.
"""

OpeningWorlds: TypeAlias = "dict[tuple[Pose2D | None, float, Touching], CollisionWorld]"
"""Collision worlds at a door, by base placement, door position and allowed contacts."""

UNKNOWN_ARTICULATION = {"unknown_articulation": "name a door or drawer of the map, as furniture/name"}


@dataclass(frozen=True, eq=False)
class FurnitureArticulation:
    """A door or drawer; ``name``: ``furniture/name``."""

    name: str
    furniture: MapFurniture
    articulation: MapArticulation

    def bodies(self) -> list[str]:
        """Return the names of the bodies in the planning scene that the hand works at."""
        return [self.furniture.name, *(f"{self.furniture.name}/{door.name}" for door in self.furniture.articulations)]

    def front(self, position: float) -> Pose:
        """Return the pose of the front board's centre in the map frame, with the furniture's axes, at an opening of
        ``position``.
        """
        return self.furniture.pose.to_pose() @ self.articulation.moved(position) @ self.articulation.shapes[0].pose

    def axis(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return a point on the axis and its direction, (3,) each, in the map frame; a positive motion opens the
        joint.
        """
        frame = self.furniture.pose.to_pose()
        return frame.apply(np.array([self.articulation.origin]))[0], frame.rotation @ np.array(self.articulation.axis)

    def check_opening(self, port: str, opening: float) -> None:
        """Raise SkillFailure (``bad_input``) if the door cannot be open by ``opening``, radians or metres."""
        upper, unit = self.articulation.upper, "rad" if self.articulation.kind == "revolute" else "m"
        if not 0.0 <= opening <= upper:
            raise SkillFailure("bad_input", f"{port} is {opening}; {self.name} opens by 0 to {upper:.2f} {unit}")

    def lever(self, position: NDArray[np.float64]) -> float:
        """Return the metres that a point (3,) of the map moves per unit of the joint: the distance from the hinge, or
        1.
        """
        if self.articulation.kind == "prismatic":
            return 1.0
        point, axis = self.axis()
        return float(np.linalg.norm(np.cross(axis, position - point)))


def find_articulation(skills: SkillContext, articulation: str) -> FurnitureArticulation:
    """Return the door or drawer ``furniture/name`` of the map. Raises SkillFailure listing the known ones."""
    known = skills.world.map.furniture
    name, _, part = articulation.partition("/")
    door = next((door for door in known[name].articulations if door.name == part), None) if name in known else None
    if door is None:
        there = ", ".join(f"{piece.name}/{one.name}" for piece in known.values() for one in piece.articulations)
        raise SkillFailure("unknown_articulation", f"no door or drawer {articulation!r} in the map; known: {there}")
    return FurnitureArticulation(articulation, known[name], door)


def world_at_opening(
    skills: SkillContext,
    door: FurnitureArticulation,
    position: float,
    touching: Touching,
    stand: Pose2D | None = None,
    ignore: Iterable[str] = (),
    margin: float = 0.0,
    felt: Obstacle | None = None,
) -> CollisionWorld:
    """Return the arm's collision world while the door is open by ``position``, radians or metres.

    ``stand``: the future base pose, None for the current one. ``ignore``: names to leave out. ``margin``: uncertainty
    of the opening. ``felt``: the door as measured by contact, instead of ``position``.
    """
    scene = _scene_at_opening(skills, door, position, touching, stand, ignore, felt)
    if margin > 0.0:
        others = [_scene_at_opening(skills, door, position + off, touching, stand, ignore) for off in (-margin, margin)]
        may_be = [o for other in (scene, *others) for o in other.obstacles if o.name == door.name]
        if may_be:
            scene = scene.adding(replace(may_be[0], shapes=tuple(s for body in may_be for s in body.shapes)))
    return skills.arm_world(scene)


def _scene_at_opening(
    skills: SkillContext,
    door: FurnitureArticulation,
    position: float,
    touching: Touching,
    stand: Pose2D | None,
    ignore: Iterable[str],
    felt: Obstacle | None = None,
) -> PlanningScene:
    from bestman_bt.manipulation.collision.scene_from_world_model import (
        finger_contacts,
        planning_scene_from_world_model,
    )

    world = replace(skills.world, articulations={**skills.world.articulations, door.name: position})
    if felt is not None:
        world = replace(world, obstacles={**world.obstacles, felt.name: felt})
    if stand is not None:
        world = replace(world, base=BasePose(stand, 0.0, 0.0, skills.clock.now()))
    allowed: list[tuple[str, str]] = []
    if touching == "hand" or (touching != "free" and door.furniture.position_error > MEASURED):
        allowed = hand_contacts(skills, *door.bodies())
    elif touching == "fingers":
        allowed = list(finger_contacts(skills.robot, door.name, skills.arm.name))
    return planning_scene_from_world_model(
        world,
        skills.robot,
        skills.joints.positions(),
        skills.arm.name,
        ignore=ignore,
        hollow=[door.furniture.name],
        explained=[_seen_with(skills.world, door, world.base.pose.to_pose().inverse())],
    ).allowing(*allowed)


def _seen_with(world: WorldModel, door: FurnitureArticulation, base_from_map: Pose) -> PlacedShape:
    """Return a box, base frame, around the believed door and its contents, which move along."""
    opened = base_from_map @ door.furniture.pose.to_pose() @ world.opening_of(door.furniture, door.articulation)
    return PlacedShape(door.articulation.hull.shape, opened @ door.articulation.hull.pose)


def free_along(
    skills: SkillContext,
    door: FurnitureArticulation,
    positions: Sequence[float],
    touching: Touching,
    stand: Pose2D | None = None,
    skip: int = 0,
    worlds: OpeningWorlds | None = None,
) -> IsFreeAt:
    """Return a function that checks whether the arm is free at each station while the door is at ``positions``.

    ``skip``: stations at the start that belong to the first position, such as the one before a grasp. ``worlds``: a
    cache for other paths of this door in the same surroundings; new worlds are added.
    """
    known: OpeningWorlds = {} if worlds is None else worlds

    def is_free(joints: NDArray[np.float64], station: int) -> bool:
        position = positions[max(0, station - skip)]
        around = known.get((stand, position, touching))
        if around is None:
            around = known[stand, position, touching] = world_at_opening(skills, door, position, touching, stand)
        return around.is_free(joints)

    return is_free


BATCHES = (slice(0, 6), slice(6, 18))
"""Ranges of the most promising base placements: checked first for all ways, then if none is good."""
ROOM = 0.05
"""Joint margin, as a fraction of half the range, of a way that ends the search."""
ACROSS = np.linspace(-0.5, 0.5, 9)
"""Positions on a front, as fractions of its width, that represent the whole front."""


def room_beside(
    skills: SkillContext, door: FurnitureArticulation, positions: Sequence[float]
) -> Callable[[Pose2D], bool]:
    """Return a function that checks whether the base has room at a placement (map frame) and is clear of the door at
    ``positions``.

    Body and head may be below or above the door; the arm is not checked.
    """
    from bestman_bt.manipulation.kinematics.link_hulls import body_between

    front = door.articulation.shapes[0]
    assert isinstance(front.shape, Box)
    height, thickness = front.shape.size[2], front.shape.size[0]
    low, apart = float(front.pose.position[2]) - height / 2, skills.parameters.furniture.base_clearance
    body = body_between(skills.robot, skills.joints.positions(), skills.arm.name, low - apart, low + height)
    swept = swept_by(door, positions)
    clearance = skills.known_costmap(DRIVEN).clearance_at

    def is_free(stand: Pose2D) -> bool:
        if clearance(stand) <= 0.0:
            return False
        if body is None:
            return True
        local = stand.inverse().apply(swept)
        gap = apart + thickness / 2
        return not bool(((local > body[0] - gap) & (local < body[1] + gap)).all(axis=1).any())

    return is_free


def swept_by(door: FurnitureArticulation, positions: Sequence[float]) -> NDArray[np.float64]:
    """Return the points (N, 2) of the map, metres, over which the front passes."""
    front = door.articulation.shapes[0]
    assert isinstance(front.shape, Box)
    across = np.column_stack([np.zeros(len(ACROSS)), ACROSS * front.shape.size[1], np.zeros(len(ACROSS))])
    return np.concatenate([door.front(position).apply(across)[:, :2] for position in positions])


@dataclass(frozen=True, eq=False)
class ArticulationPath:
    """A candidate motion of a door: the arm follows ``stations`` from one of ``stands``, both in the map frame.

    ``positions``: of the door at the stations. ``touching``, ``skip``: as in ``free_along``.
    """

    stands: Sequence[Pose2D]
    stations: Stations
    positions: Sequence[float]
    touching: Touching
    skip: int = 0


def find_stands(
    skills: SkillContext, door: FurnitureArticulation, ways: Iterable[ArticulationPath]
) -> list[PathPlacement]:
    """Return the base placements from which the arm follows the whole of one of ``ways``, best first; may be empty.

    The arm's reachability map limits the candidates, so that few searches fail.
    """
    kinematics, current = skills.kinematics, skills.world.base.pose
    reachability = _reachability(skills)
    found: list[PathPlacement] = []
    promising: list[ArticulationPath] = []
    worlds: OpeningWorlds = {}
    for batch in BATCHES:
        for way in promising or ways:
            if batch is BATCHES[0]:
                stands = way.stands
                if reachability is not None:
                    stands = skills.path_placement.promising(stands, way.stations, kinematics, reachability, current)
                way = replace(way, stands=stands)
                promising.append(way)
            these = replace(way, stands=way.stands[batch])
            found += stands_along_opening(skills, door, these, worlds, skills.path_placement, reachability)
            if any(stand.arc.margin >= ROOM for stand in found):
                return sorted(found, key=lambda stand: -stand.score)
    return sorted(found, key=lambda stand: -stand.score)


def stands_along_opening(
    skills: SkillContext,
    door: FurnitureArticulation,
    way: ArticulationPath,
    worlds: OpeningWorlds,
    search: PathPlacementPlanner,
    reachability: ReachabilityMap | None = None,
) -> tuple[PathPlacement, ...]:
    """Return the base placements of ``way``, best first, from which the arm follows it while the door moves.

    ``worlds``: as in ``free_along``.
    """
    return search.rank(
        way.stands,
        way.stations,
        skills.reaching_arm(reachability),
        is_free_at=lambda stand: free_along(skills, door, way.positions, way.touching, stand, way.skip, worlds),
        current=skills.world.base.pose,
    )


def _reachability(skills: SkillContext) -> ReachabilityMap | None:
    """Return the arm's map, from the disk, or None if the kinematics in use has none."""
    from bestman_bt.manipulation.kinematics.reachability_map import reachability_map

    return reachability_map(skills.kinematics, skills.arm_model) if skills.kinematics.fingerprint else None
