"""Look at a piece of furniture: the pose of the robot, the tree to run, and the resulting beliefs as marks."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from behaviours.context import SkillContext
from behaviours.failure import NodeFailure
from behaviours.manipulation.grasp_candidates import grasp_candidates, handle_grasp_candidates
from behaviours.perception.surfaces import SLAB_GROWTH
from bestman_bt.configuration.errors import Problem
from bestman_bt.configuration.run import RunConfig, RunRequest, run_of_options
from bestman_bt.control.rgbd import RGBDView
from bestman_bt.messages import Box, Pose, Pose2D
from bestman_bt.runtime.resolved_config import ResolvedConfig
from bestman_bt.runtime.robot_session import open_session
from bestman_bt.scene.draw import SceneError, draw_world
from bestman_bt.scene.load import load_scene
from bestman_bt.scene.map_of_world import semantic_map
from bestman_bt.scene.plane_geometry import distance_to_polygon, rectangle, wall_rectangle
from bestman_bt.scene.scene import Wall
from bestman_bt.visualization.marks import GraspMark, HandleMark, ObjectMark, SceneMarks, SurfaceMark
from bestman_bt.world_model.semantic_map import MapFurniture

STAND_OFFS = (0.90, 1.05, 0.75, 1.20, 0.60, 1.40)
"""Metres between the middle of the base and the front of the furniture; the first one with room is used."""
STAND_OFFS_AT_TABLES = (0.60, 0.75, 0.90, 1.05, 1.20, 1.40)
"""The same for furniture that consists of a top on legs, such as a table; nearer is better."""
ROOM = 0.38
"""Metres, clearance of the middle of the base from obstacles."""
FRONT_STEP = 1.25
"""Height of a front that one view covers, metres; higher fronts need several views."""
TREE = "look"


@dataclass(frozen=True, eq=False)
class LookResult:
    """The result of one stand in front of ``furniture``: views in order, all marks in the map frame, failures."""

    furniture: str
    views: tuple[RGBDView, ...]
    marks: SceneMarks
    failures: tuple[NodeFailure, ...]


def furniture_to_look_at(asked: RunRequest) -> dict[str, MapFurniture]:
    """Return the furniture on the robot's map of a scene, by name; raises the errors of ``load_scene`` and
    ``draw_world``.
    """
    config = run_of_options(replace(asked, tree=TREE, robot="diff_panda"))
    return dict(semantic_map(draw_world(load_scene(config.task.scene, config.scene_settings), asked.seed)).furniture)


def look_at(furniture: MapFurniture, stand: RunConfig | ResolvedConfig, views: int = 1) -> LookResult:
    """Run the tree ``look`` on a robot in front of the furniture (see ``run_in_front_of``). Raises the errors of
    ``prepare``.
    """
    with open_session(stand) as session:
        under = session.skills.world.map.standing_under(furniture.name)
        seen: list[RGBDView] = []
        if session.skills.has("camera"):  # else the tree is refused, with the reason
            session.skills.camera.subscribe(seen.append)
        still = [surface for surface in furniture.surfaces if surface.drawer is None]
        heights = {f"{furniture.name}/{s.name}": float(s.pose.position[2]) for s in still}
        highest = max(heights.values(), default=0.0)
        session.entries |= {
            "furniture": furniture.name,
            "top": [name for name, height in heights.items() if height == highest],
            "inside": [name for name, height in heights.items() if height < highest],
            "fronts": _fronts(furniture, under.height if under is not None else 0.0),
            "views": views,
        }
        session.run(TREE)
        return LookResult(furniture.name, tuple(seen), scene_marks(session.skills), tuple(session.skills.failures))


def unseen(furniture: str, code: str, why: Exception) -> LookResult:
    """Return the result for furniture that could not be looked at."""
    return LookResult(furniture, (), SceneMarks(), (NodeFailure("", code, str(why)),))


def run_in_front_of(furniture: MapFurniture, asked: RunRequest) -> RunConfig:
    """Return a run whose robot starts centred in front of the furniture, at the best distance with enough free space.

    Raises SceneError if there is none, else as ``run_of_options`` and ``load_scene`` do.
    """
    asked = replace(asked, tree=TREE)
    config = run_of_options(asked)
    world = draw_world(load_scene(config.task.scene, config.scene_settings), asked.seed)
    obstacles = [wall_rectangle(wall) for wall in world.walls]
    obstacles += [rectangle(piece.actual, piece.model.footprint) for piece in world.furniture]
    front = furniture.pose @ Pose2D(-furniture.footprint[0] / 2, 0.0, 0.0)
    distances = STAND_OFFS if furniture.articulations or len(furniture.surfaces) > 1 else STAND_OFFS_AT_TABLES
    for distance in distances:
        stand = front @ Pose2D(-distance, 0.0, 0.0)
        if any(_apart(wall, stand, front) for wall in world.walls):
            continue
        if min(distance_to_polygon(obstacle, stand.xy) for obstacle in obstacles) >= ROOM:
            start = {"x": stand.x, "y": stand.y, "yaw": stand.theta}
            placed = [f"scene.robot_start.{axis}=[{value}, {value}]" for axis, value in start.items()]
            placed.append(f"scene.start_clearance={ROOM}")
            return run_of_options(replace(asked, settings=[*placed, *(asked.settings or ())]))
    message = (
        f"no room for the robot in front of the {furniture.name}: it needs {ROOM} m on all sides "
        f"at a distance of {min(distances)} to {max(distances)} m"
    )
    raise SceneError([Problem(str(asked.scene), None, "", message)])


def _apart(wall: Wall, one: Pose2D, other: Pose2D) -> bool:
    """Return whether a wall is between two places."""

    def left(a: NDArray[np.float64], b: NDArray[np.float64], point: NDArray[np.float64]) -> bool:
        along, to = b - a, point - a
        return bool(along[0] * to[1] > along[1] * to[0])

    start, end = np.array(wall.start), np.array(wall.end)
    return left(start, end, one.xy) != left(start, end, other.xy) and left(one.xy, other.xy, start) != left(
        one.xy, other.xy, end
    )


def scene_marks(skills: SkillContext) -> SceneMarks:
    """Return all beliefs about the surroundings, with the best grasp of each object, in the map frame."""
    world = skills.world
    return SceneMarks(
        objects=object_marks(skills),
        handles=tuple(HandleMark(name, belief.handle) for name, belief in world.handles.items()),
        grasps=tuple(_best_grasps(skills)),
        surfaces=tuple(_surfaces(skills)),
    )


def object_marks(skills: SkillContext) -> tuple[ObjectMark, ...]:
    """Return the believed objects with their measured points, in the map frame."""
    marks = []
    for name, belief in skills.world.objects.items():
        seen = [observation.cluster.points for observation in skills.observations.get(name, ())]
        points = np.concatenate(seen) if seen else np.empty((0, 3))
        marks.append(
            ObjectMark(
                name,
                belief.model,
                belief.pose,
                belief.confidence,
                belief.position_std,
                belief.yaw_set,
                points,
                belief.recognised,
            )
        )
    return tuple(marks)


def _best_grasps(skills: SkillContext) -> Iterable[GraspMark]:
    """Return the first grasp that is proposed for each believed object and handle; reachability is not checked."""
    if not skills.has("arm") or not skills.has("gripper"):
        return
    depth = skills.gripper_model.part.finger_depth
    targets = {name: grasp_candidates(skills, belief) for name, belief in skills.world.objects.items()}
    targets |= {name: handle_grasp_candidates(skills, belief) for name, belief in skills.world.handles.items()}
    for name, candidates in targets.items():
        for candidate in candidates[:1]:
            pose = skills.map_from_base @ candidate.grasp
            yield GraspMark(name, pose, candidate.width, depth, candidate.quality)


def _surfaces(skills: SkillContext) -> Iterable[SurfaceMark]:
    for name, obstacle in skills.world.obstacles.items():
        surface, _, what = name.rpartition("/")
        slab = obstacle.shapes[0]
        if what == "surface" and isinstance(slab.shape, Box):
            x, y, thickness = slab.shape.size
            top = slab.pose @ Pose(np.array([0.0, 0.0, thickness / 2]))
            yield SurfaceMark(surface, top, (x - 2 * SLAB_GROWTH, y - 2 * SLAB_GROWTH))


def _fronts(furniture: MapFurniture, floor: float) -> list[str]:
    """Return points on the front from bottom to top, ``x;y;z`` in the map frame; ``floor``: height of its support,
    metres.
    """
    rise = furniture.height - floor
    count = math.ceil(rise / FRONT_STEP)
    middles = [(-furniture.footprint[0] / 2, 0.0, floor + rise * (i + 0.5) / count) for i in range(count)]
    return [";".join(f"{x:.3f}" for x in point) for point in furniture.pose.to_pose().apply(np.array(middles))]
