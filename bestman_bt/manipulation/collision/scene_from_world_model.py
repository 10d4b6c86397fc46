"""Conversion of the belief to the arm's planning scene."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from bestman_bt.manipulation.collision.planning_scene import AttachedObject, PlanningScene, SceneObstacle, VoxelObstacle
from bestman_bt.manipulation.errors import ManipulationError
from bestman_bt.messages import VOXEL_OCCUPIED, VOXEL_UNKNOWN, Box, PlacedShape, Pose, VoxelGrid, distance_to_shape
from bestman_bt.robot_model.model import ArmModel, GripperModel, RobotModel
from bestman_bt.world_model.openness import articulation_shapes, handle_shape
from bestman_bt.world_model.semantic_map import WALL_HEIGHT, MapFurniture
from bestman_bt.world_model.world_model import WorldModel

SAME_HEIGHT = 0.006
"""Largest distance between a surface and the upper side of its board, metres."""

_SIGNS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])  # of a box's corners


def hollow_furniture(
    world_model: WorldModel,
    base_from_map: Pose,
    names: Iterable[str],
    *,
    offset: float,
    turn: float,
    reach: float,
) -> list[SceneObstacle]:
    """Return the obstacles ``furniture`` (its boards) and ``furniture/name`` (with its handle if open), base frame.

    ``offset``, ``turn``: largest error of mapped furniture, metres and radians; boards are thickened sideways by it, or
    by the smaller errors of a measured piece; heights are exact. ``reach``: metres from the base beyond which furniture
    is omitted. A board whose surface was measured is omitted, because the measurement is a separate obstacle.
    """
    obstacles = []
    for name in names:
        piece = world_model.map.furniture[name]
        base_from_piece, piece_from_map = base_from_map @ piece.pose.to_pose(), piece.pose.to_pose().inverse()
        if float(np.linalg.norm(base_from_piece.position[:2])) - math.hypot(*piece.footprint) / 2 >= reach:
            continue
        errors = min(offset, piece.position_error), min(turn, piece.heading_error)
        bodies = {name: [_grown_box(shape, piece, errors) for shape in piece.shapes]}
        for door in piece.articulations:
            boards = [_grown_box(shape, piece, errors) for shape in articulation_shapes(world_model, piece, door)]
            if world_model.articulations.get(f"{name}/{door.name}", 0.0) > 0.0:
                seen = [handle_shape(belief.handle) for belief in world_model.handles_of(piece, door)]
                boards += [PlacedShape(bar.shape, piece_from_map @ bar.pose) for bar in seen]
            bodies[f"{name}/{door.name}"] = boards
        measured = _measured_surfaces(world_model, piece)
        for body, shapes in bodies.items():
            if body not in world_model.obstacles:
                unseen = [shape for shape in shapes if not any(_carries(shape, pose) for pose in measured)]
                in_base = tuple(PlacedShape(shape.shape, base_from_piece @ shape.pose) for shape in unseen)
                obstacles.append(SceneObstacle(body, in_base))
    return obstacles


def _measured_surfaces(world_model: WorldModel, piece: MapFurniture) -> list[Pose]:
    """Return poses in the furniture frame of the measured surfaces within a piece."""
    inner = (surface.name for surface in piece.surfaces if piece.is_inside(surface))
    names = [f"{piece.name}/{name}" for name in inner if f"{piece.name}/{name}/surface" in world_model.obstacles]
    return [world_model.surface(name)[1].pose for name in names]


def _carries(board: PlacedShape, surface: Pose) -> bool:
    """Return whether a surface is the upper side of a level board."""
    if not isinstance(board.shape, Box):
        return False
    x, y, z = (float(value) for value in np.abs(board.pose.inverse().apply(surface.position[None])[0]))
    half_x, half_y, half_z = (extent / 2 for extent in board.shape.size)
    inside = x < half_x + SAME_HEIGHT and y < half_y + SAME_HEIGHT and z < half_z + SAME_HEIGHT
    top = float(board.pose.position[2] + np.abs(board.pose.rotation[2]) @ np.array(board.shape.size) / 2)
    return inside and abs(top - float(surface.position[2])) < SAME_HEIGHT


def _grown_box(placed: PlacedShape, piece: MapFurniture, errors: tuple[float, float]) -> PlacedShape:
    """Return a board that covers where it may be: moved by ``offset`` along x and y of the map, turned with its
    piece.
    """
    offset, turn = errors
    if not isinstance(placed.shape, Box):
        return placed
    corners = placed.pose.apply(_SIGNS * np.array(placed.shape.size) / 2)[:, :2]
    axes = placed.pose.rotation[:2]  # (2, 3): how far each of the board's axes lies in the plane, and whereto
    cosine, sine = math.cos(piece.pose.theta), math.sin(piece.pose.theta)
    moved = offset * np.abs(np.array([[cosine, -sine], [sine, cosine]]) @ axes).sum(axis=0)
    sideways = np.abs(np.outer(corners[:, 0], axes[1]) - np.outer(corners[:, 1], axes[0])).max(axis=0)
    inwards = float(np.linalg.norm(corners, axis=1).max()) * np.linalg.norm(axes, axis=0)
    shift = moved + math.sin(turn) * sideways + (1.0 - math.cos(turn)) * inwards
    x, y, z = (float(size + 2 * grow) for size, grow in zip(placed.shape.size, shift, strict=True))
    return PlacedShape(Box((x, y, z)), placed.pose)


OCCUPIED, UNKNOWN = "occupied", "unknown"


def voxel_obstacles(
    grid: VoxelGrid,
    base_from_map: Pose,
    explained: Iterable[PlacedShape],
    *,
    slack: float,
    reach: float,
    unknown: bool,
) -> tuple[VoxelObstacle, ...]:
    """Return the obstacles ``occupied`` and, if ``unknown``, ``unknown``, of the voxels within ``reach`` metres of the
    base.

    ``explained``: shapes in the base frame; voxels within ``slack`` metres of one are omitted.
    """
    base_from_grid = base_from_map @ grid.frame_from_grid
    shapes = tuple(explained)
    obstacles = []
    for name, state in ((OCCUPIED, VOXEL_OCCUPIED), (UNKNOWN, VOXEL_UNKNOWN)):
        if state == VOXEL_UNKNOWN and not unknown:
            continue
        indices = np.argwhere(grid.states == state)
        centres = base_from_grid.apply((indices + 0.5) * grid.resolution)
        wanted = np.hypot(centres[:, 0], centres[:, 1]) < reach
        indices, centres = indices[wanted], centres[wanted]
        for placed in shapes:
            left = distance_to_shape(centres, placed) > slack + math.sqrt(3.0) / 2 * grid.resolution
            indices, centres = indices[left], centres[left]
        if len(indices):
            obstacles.append(VoxelObstacle(name, base_from_grid, indices, grid.resolution))
    return tuple(obstacles)


FLOOR = "floor"


@dataclass(frozen=True)
class SceneMargins:
    """Margins of the scene, and what counts as an obstacle.

    ``padding``: metres from all bodies. ``reach``: metres from the base beyond which bodies are omitted.
    ``furniture_offset``, ``furniture_turn``: largest error of mapped furniture, metres and radians; a measured piece
    has its own (``MapFurniture.position_error``). ``wall_height``, ``wall_thickness``: metres. ``object_deviations``:
    standard deviations of an object's position to add as padding, at most ``max_object_padding`` metres.
    ``unknown_is_obstacle``: whether unseen space is occupied. ``voxel_slack``: metres from a believed body within which
    voxels belong to it.
    """

    padding: float = 0.002
    reach: float = 2.0
    furniture_offset: float = 0.03
    furniture_turn: float = math.radians(2.0)
    wall_height: float = WALL_HEIGHT
    wall_thickness: float = 0.02
    object_deviations: float = 2.0
    max_object_padding: float = 0.01
    unknown_is_obstacle: bool = False
    voxel_slack: float = 0.015


def planning_scene_from_world_model(
    world_model: WorldModel,
    robot: RobotModel,
    positions: Mapping[str, float],
    arm: str = "arm",
    ignore: Iterable[str] = (),
    margins: SceneMargins = SceneMargins(),
    explained: Iterable[PlacedShape] = (),
    hollow: Iterable[str] = (),
) -> PlanningScene:
    """Return the planning scene around the believed base pose.

    Obstacles are: the floor (``floor``), walls (``wall0`` …), furniture by name as a solid box that covers its possible
    poses, measured bodies (``world_model.obstacles``), objects by name. An obstacle with the name of a piece of
    furniture, or ``furniture/…``, is a measurement and replaces its box. The object held by ``arm`` is attached,
    objects of other arms are carried; the holding hand may touch it. ``positions``: of all joints, by name. ``ignore``:
    names to omit.

    ``hollow``: furniture that the arm works in: if the map has its boards, these are the obstacle ``furniture``, and
    each door and drawer at its believed opening is ``furniture/name``, thickened by the map's error; measurements are
    additional obstacles, and replace a door of the same name.

    Voxels of ``world_model.occupancy`` are obstacles (``occupied``, ``unknown``), except those explained by these
    bodies, ignored ones included, or by a shape of ``explained`` (base frame).
    """
    ignored = set(ignore)
    ignored |= {held.name for held in world_model.hands.values()}
    base_from_map = world_model.base.pose.to_pose().inverse()
    within = _with_boards(world_model, hollow)
    bodies = (
        _floor(),
        *_walls(world_model, base_from_map, margins),
        *_furniture(world_model, base_from_map, margins, within),
        *hollow_furniture(
            world_model,
            base_from_map,
            within,
            offset=margins.furniture_offset,
            turn=margins.furniture_turn,
            reach=margins.reach,
        ),
        *_measured(world_model, base_from_map),
        *_objects(world_model, base_from_map, margins),
    )
    obstacles = [body for body in bodies if body.name not in ignored]
    grid = world_model.occupancy
    return PlanningScene(
        positions=dict(positions),
        obstacles=tuple(obstacles),
        attached=held_object(world_model, robot, arm),
        carried=tuple(
            held
            for other in robot.arm_names
            if other != arm and (held := held_object(world_model, robot, other)) is not None
        ),
        padding=margins.padding,
        voxels=()
        if grid is None
        else voxel_obstacles(
            grid,
            base_from_map,
            (*(placed for body in bodies for placed in body.shapes), *explained),
            slack=margins.voxel_slack,
            reach=margins.reach,
            unknown=margins.unknown_is_obstacle,
        ),
    )


def held_object(world_model: WorldModel, robot: RobotModel, arm: str = "arm") -> AttachedObject | None:
    """Return the object held by the arm as an attached object, or None."""
    held = world_model.hands.get(arm)
    if held is None:
        return None
    return AttachedObject(
        name=held.name,
        shapes=held.model.collision,
        tool_frame=robot.of(ArmModel)[arm].tool_frame,
        tool_from_object=held.tool_from_object,
        touch_links=frozenset(hand_links(robot, arm)),
    )


def hand_links(robot: RobotModel, arm: str = "arm") -> tuple[str, ...]:
    """Return the links of the grippers that ``arm`` carries: hand, linkage, fingers."""
    links: list[str] = []
    for name, gripper in robot.of(GripperModel).items():
        if robot.hand_of.get(name) == arm:
            links += [gripper.hand_link, *gripper.linkage, *gripper.part.finger_links]
    return tuple(links)


def finger_contacts(robot: RobotModel, target: str, arm: str = "arm") -> tuple[tuple[str, str], ...]:
    """Return the pairs (finger link, ``target``) to allow while the hand closes around ``target``."""
    return tuple(
        (link, target)
        for name, gripper in robot.of(GripperModel).items()
        if robot.hand_of.get(name) == arm
        for link in gripper.part.finger_links
    )


def _floor() -> SceneObstacle:
    return SceneObstacle(FLOOR, (PlacedShape(Box((6.0, 6.0, 0.1)), Pose(np.array([0.0, 0.0, -0.05]))),))


def _walls(world_model: WorldModel, base_from_map: Pose, margins: SceneMargins) -> list[SceneObstacle]:
    obstacles = []
    for i, (box, placed) in enumerate(world_model.map.wall_boxes(margins.wall_height, margins.wall_thickness)):
        pose = base_from_map @ placed
        if _distance_to_box(pose, box.size) < margins.reach:
            obstacles.append(SceneObstacle(f"wall{i}", (PlacedShape(box, pose),)))
    return obstacles


def _with_boards(world_model: WorldModel, hollow: Iterable[str]) -> list[str]:
    wanted, known = list(hollow), world_model.map.furniture
    unknown = [name for name in wanted if name not in known]
    if unknown:
        message = f"the map has no furniture {', '.join(map(repr, unknown))} to work in"
        raise ManipulationError(f"{message}; there is {', '.join(known) or 'none'}")
    seen_inside = (name for name, piece in known.items() if _open_or_measured_inside(world_model, piece))
    return [name for name in dict.fromkeys([*wanted, *seen_inside]) if known[name].shapes]


def _open_or_measured_inside(world_model: WorldModel, piece: MapFurniture) -> bool:
    opened = any(world_model.articulations.get(f"{piece.name}/{door.name}", 0.0) > 0.0 for door in piece.articulations)
    inner = (f"{piece.name}/{surface.name}/surface" for surface in piece.surfaces if piece.is_inside(surface))
    return opened or any(name in world_model.obstacles for name in inner)


def _furniture(
    world_model: WorldModel, base_from_map: Pose, margins: SceneMargins, hollow: Iterable[str]
) -> list[SceneObstacle]:
    measured = {name.partition("/")[0] for name in world_model.obstacles} | set(hollow)
    obstacles = []
    for furniture in world_model.map.furniture.values():
        size = _grown(furniture, margins)
        pose = base_from_map @ furniture.pose.to_pose(furniture.height / 2)
        if furniture.name not in measured and _distance_to_box(pose, size) < margins.reach:
            obstacles.append(SceneObstacle(furniture.name, (PlacedShape(Box(size), pose),)))
    return obstacles


def _grown(furniture: MapFurniture, margins: SceneMargins) -> tuple[float, float, float]:
    x, y = furniture.footprint
    offset = min(margins.furniture_offset, furniture.position_error)
    turn = math.sin(min(margins.furniture_turn, furniture.heading_error))
    return (
        x + 2 * offset + y * turn,
        y + 2 * offset + x * turn,
        furniture.height,
    )


def _measured(world_model: WorldModel, base_from_map: Pose) -> list[SceneObstacle]:
    return [
        SceneObstacle(obstacle.name, _in_base(obstacle.shapes, base_from_map))
        for obstacle in world_model.obstacles.values()
    ]


def _objects(world_model: WorldModel, base_from_map: Pose, margins: SceneMargins) -> list[SceneObstacle]:
    obstacles = []
    for belief in world_model.objects.values():
        base_from_object = base_from_map @ belief.pose
        if np.linalg.norm(base_from_object.position[:2]) < margins.reach:
            padding = min(margins.object_deviations * belief.position_std, margins.max_object_padding)
            shapes = _in_base(belief.model.collision, base_from_object)
            obstacles.append(SceneObstacle(belief.name, shapes, padding))
    return obstacles


def _in_base(shapes: Iterable[PlacedShape], base_from_body: Pose) -> tuple[PlacedShape, ...]:
    return tuple(PlacedShape(placed.shape, base_from_body @ placed.pose) for placed in shapes)


def _distance_to_box(base_from_box: Pose, size: tuple[float, float, float]) -> float:
    """Return the horizontal distance from the base to a box, metres."""
    base_in_box = base_from_box.inverse().position
    outside = np.maximum(np.abs(base_in_box[:2]) - np.array(size[:2]) / 2, 0.0)
    return float(np.linalg.norm(outside))
