"""Draws worlds from scenes: objects, poses, start, goals and routes of people follow from the seed.

So do changes since the map was made: moved furniture, and unmapped furniture.
"""

from __future__ import annotations

import math
import zlib
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from bestman_bt.configuration.errors import ConfigurationError
from bestman_bt.errors import Error
from bestman_bt.messages import Pose, Pose2D
from bestman_bt.scene.apartment_generator.generate import ApartmentError, generate_apartment
from bestman_bt.scene.floor_grid import FloorGrid
from bestman_bt.scene.placing import (
    articulation_outlines,
    body_outlines,
    gap_to_furniture,
    gap_to_objects,
    planar_radius,
    standing_furniture,
    standing_on,
    standing_outlines,
    surface_of,
)
from bestman_bt.scene.plane_geometry import (
    Points,
    depth_inside,
    distance_to_polygon,
    polygons_overlap,
    rectangle,
    wall_rectangle,
)
from bestman_bt.scene.scene import (
    FurnitureModel,
    MovingDoor,
    PlacedFurniture,
    PlacedObject,
    Surface,
    Walker,
    Wall,
    World,
)
from bestman_bt.scene.scene_config import (
    FurniturePlacement,
    GoalPlacement,
    ObjectPlacement,
    RegionConfig,
    SceneConfig,
    WalkersConfig,
    WallsConfig,
)

if TYPE_CHECKING:
    from bestman_bt.scene.scene_config import RegionConfig, SceneConfig

_MOVED = 0.6  # metres each way


def with_apartment(scene: SceneConfig, seed: int) -> SceneConfig:
    """Return the scene with the seed's apartment; a scene without a generator is unchanged.

    The robot may start anywhere with enough room, unless the file says where. Raises ApartmentError.
    """
    if scene.file.generator is None:
        return scene
    options = scene.file.generator.apartment
    apartment = generate_apartment(options, seed if options.seed is None else options.seed, scene.file.passage)
    rng = np.random.default_rng([seed, 6])
    corners = [room.x + room.y for room in apartment.rooms]
    whole = RegionConfig(
        x=(min(c[0] for c in corners), max(c[1] for c in corners)),
        y=(min(c[2] for c in corners), max(c[3] for c in corners)),
    )
    file = replace(
        scene.file,
        walls=WallsConfig(options.wall_height, options.wall_thickness, apartment.walls),
        furniture={
            piece.name: FurniturePlacement(
                piece.model.name,
                (piece.at.x, piece.at.y, piece.at.theta),
                moved=_MOVED if piece.model.name == "chair" and rng.random() < options.moved_chairs else 0.0,
            )
            for piece in apartment.furniture
        }
        | {
            # built into walls, which are exact
            door.name: FurniturePlacement(
                door.model.name,
                (door.at.x, door.at.y, door.at.theta),
                offset=0.0,
                turn=0.0,
                open=now.open,
                mapped_open=door.open,
            )
            for door, now in zip(apartment.doors, apartment.doors_now, strict=True)
        },
        robot_start=scene.file.robot_start or whole,
    )
    pieces = (*apartment.furniture, *apartment.doors)
    return replace(scene, file=file, furniture={piece.name: piece.model for piece in pieces})


_ATTEMPTS = 300  # whole draws
_TRIES = 100  # places tried for one thing in one draw
_NEAR = 0.3
"""Distance, metres, within which an error message names the things that left no room for another one."""


class SceneError(ConfigurationError):
    """No world could be drawn: the scene's regions leave too little room."""


def draw_world(scene: SceneConfig, seed: int) -> World:
    """Draw the world of a seed; deterministic. Raises SceneError if no placement satisfies the scene.

    Each entity has its own stream of random numbers: removing one object moves another only if they competed for space.
    """
    try:
        scene = with_apartment(scene, seed)
    except ApartmentError as error:
        raise SceneError([scene.document.problem(("generator", "apartment"), str(error))]) from error
    layout = scene.file.walls
    assert layout is not None
    walls = tuple(Wall(start, end, layout.height, layout.thickness) for start, end in layout.lines)
    furniture = standing_furniture(scene, lambda piece: _shares(seed, piece))
    furniture += exactly_placed(scene, partial(_generator, seed, 0, "changes"))
    why: _NoRoomError | None = None
    for attempt in range(_ATTEMPTS):
        try:
            objects = _objects(scene, seed, attempt, furniture)
            goals = {name: _goal(scene, seed, attempt, name, furniture, objects) for name in scene.file.goals}
            start = _start(scene, seed, attempt, walls, furniture)
            standing, walkers = _changed(scene, seed, attempt, walls, furniture, start)
        except _NoRoomError as error:
            why = error
            continue
        return World(
            scene=scene.name,
            seed=seed,
            walls=walls,
            furniture=standing,
            objects=objects,
            robot_start=start,
            goals=goals,
            finger_friction=scene.file.finger_friction,
            goal_heights={name: float(model.size[2]) for name, model in scene.goal_models.items()},
            goal_surfaces={name: goal.surface for name, goal in scene.file.goals.items()},
            walkers=walkers,
            moving_doors=_moving_doors(scene, standing),
        )
    assert why is not None
    message = f"{why} in any of {_ATTEMPTS} draws (scene {scene.name!r}, seed {seed}); {why.remedy}"
    raise SceneError([scene.document.problem(why.field, message)]) from why


class _NoRoomError(Error):
    """``field``: the field of the scene file that leaves no room."""

    def __init__(self, field: tuple[str, ...], what: str, remedy: str) -> None:
        super().__init__(f"no room for {what}")
        self.field, self.remedy = field, remedy


def _generator(seed: int, attempt: int, *names: str) -> np.random.Generator:
    return np.random.default_rng([seed, attempt, zlib.crc32("/".join(names).encode())])


def _shares(seed: int, piece: str) -> list[float]:
    """Return the pose error of a piece along x, along y and in its heading, each as a fraction of its bound, -1 to
    1.
    """
    shares: list[float] = _generator(seed, 0, "furniture", piece).uniform(-1.0, 1.0, 3).tolist()
    return shares


def _sample(generator: np.random.Generator, region: RegionConfig) -> Pose2D:
    x, y, yaw = (float(generator.uniform(*limits)) for limits in (region.x, region.y, region.yaw))
    return Pose2D(x, y, yaw)


def _objects(
    scene: SceneConfig, seed: int, attempt: int, furniture: tuple[PlacedFurniture, ...]
) -> tuple[PlacedObject, ...]:
    placed: list[PlacedObject] = []
    for name, placement in scene.file.objects.items():
        if float(_generator(seed, 0, "presence", name).random()) >= placement.presence:
            continue
        generator = _generator(seed, attempt, "objects", name)
        placed.append(_object(scene, name, placement, generator, furniture, placed))
    return tuple(placed)


def _object(
    scene: SceneConfig,
    name: str,
    placement: ObjectPlacement,
    generator: np.random.Generator,
    furniture: tuple[PlacedFurniture, ...],
    others: list[PlacedObject],
) -> PlacedObject:
    model = scene.models[name]
    piece, surface = surface_of(scene, placement.surface, furniture)
    if placement.at is not None:
        return PlacedObject(name, model, standing_on(piece.surface_pose(surface), Pose2D(*placement.at), model))
    assert placement.region is not None
    for _ in range(_TRIES):
        on_surface = _sample(generator, placement.region)
        pose = standing_on(piece.surface_pose(surface), on_surface, model)
        inside = depth_inside(rectangle(Pose2D(), surface.size), on_surface.xy) >= planar_radius(model)
        room = min(gap_to_objects(pose, model, others), gap_to_furniture(pose, model, piece, furniture))
        if inside and room >= scene.file.clearance:
            return PlacedObject(name, model, pose)
    around = [other.name for other in others if abs(other.pose.position - pose.position).max() < _NEAR]
    beside = f" beside {', '.join(around)}" if around else ""
    raise _NoRoomError(
        ("objects", name, "region", "x"),
        f"{name!r} on {placement.surface}{beside}",
        f"widen the region within {_size(surface)}, or lower 'clearance' ({scene.file.clearance:g} m)",
    )


def _goal(
    scene: SceneConfig,
    seed: int,
    attempt: int,
    name: str,
    furniture: tuple[PlacedFurniture, ...],
    objects: tuple[PlacedObject, ...],
) -> Pose:
    """Return whether the goal keeps its margin from the edges of the surface at its true and at its mapped pose."""
    goal: GoalPlacement = scene.file.goals[name]
    model = scene.goal_models[name]
    generator = _generator(seed, attempt, "goals", name)
    piece, surface = surface_of(scene, goal.surface, furniture)
    in_furniture = surface.pose.to_pose2d()
    outlines = [rectangle(pose @ in_furniture, surface.size) for pose in (piece.nominal, piece.actual)]
    for _ in range(_TRIES):
        planar = piece.nominal @ in_furniture @ _sample(generator, goal.region)
        pose = planar.to_pose(piece.elevation + float(surface.pose.position[2]) + float(model.size[2]) / 2)
        if min(depth_inside(outline, planar.xy) for outline in outlines) < goal.margin:
            continue
        if gap_to_furniture(pose, model, piece, furniture) < (goal.clearance or 0.0):
            continue
        if goal.clearance is None or gap_to_objects(pose, model, objects) >= goal.clearance:
            return pose
    raise _NoRoomError(
        ("goals", name, "region", "x"),
        f"the goal {name!r} on {goal.surface}",
        f"widen the region within {_size(surface)}, or lower its 'margin' ({goal.margin:g} m) or 'clearance'",
    )


def _size(surface: Surface) -> str:
    return f"the surface's {surface.size[0]:g} m × {surface.size[1]:g} m"


def _start(
    scene: SceneConfig, seed: int, attempt: int, walls: tuple[Wall, ...], furniture: tuple[PlacedFurniture, ...]
) -> Pose2D:
    generator = _generator(seed, attempt, "robot_start")
    region = scene.file.robot_start
    assert region is not None
    obstacles = standing_outlines(walls, furniture)
    floor = FloorGrid.of(obstacles) if scene.file.generator is not None else None
    reachable = floor.largest_area(scene.file.passage) if floor is not None else None
    for _ in range(_TRIES):
        pose = _sample(generator, region)
        if floor is not None and reachable is not None and not reachable[floor.cells(pose.xy)]:
            continue
        if min(distance_to_polygon(obstacle, pose.xy) for obstacle in obstacles) >= scene.file.start_clearance:
            return pose
    raise _NoRoomError(
        ("robot_start", "x"),
        "the robot's start",
        f"choose a region that is free, or lower 'start_clearance' ({scene.file.start_clearance:g} m)",
    )


def _changed(
    scene: SceneConfig,
    seed: int,
    attempt: int,
    walls: tuple[Wall, ...],
    furniture: tuple[PlacedFurniture, ...],
    start: Pose2D,
) -> tuple[tuple[PlacedFurniture, ...], tuple[Walker, ...]]:
    """Return the furniture with the changes since the map was made, and the pedestrians between it."""
    fixed = [wall_rectangle(wall) for wall in walls] + [
        line for piece in furniture for line in articulation_outlines(piece)
    ]
    standing = draw_changes(scene, furniture, fixed, start, partial(_generator, seed, attempt, "changes"))
    if standing is None:
        what = "furniture that was moved or that the map does not have"
        raise _NoRoomError(
            ("unmapped",) if scene.file.unmapped else (), what, "widen its regions, or request fewer pieces"
        )
    asked = scene.file.walkers
    if asked is None:
        return standing, ()
    outlines = standing_outlines(walls, standing)
    walkers = draw_walkers(asked, outlines, start, partial(_generator, seed, attempt, "walkers"))
    if walkers is None:
        raise _NoRoomError(("walkers",), f"{asked.count} walkers", "request fewer")
    return standing, walkers


def _moving_doors(scene: SceneConfig, furniture: Iterable[PlacedFurniture]) -> tuple[MovingDoor, ...]:
    """Return the moving doors whose furniture is present: an unmapped piece may be absent."""
    there = {f"{piece.name}/{door.name}": door for piece in furniture for door in piece.model.articulations}
    return tuple(
        MovingDoor(name, min(asked.to, there[name].upper), asked.within, asked.speed, asked.torque)
        for name, asked in scene.file.moving_doors.items()
        if name in there
    )


_STEP = 4  # cells of the floor's grid
_ROOM = 0.06  # metres beside a walker
_FROM_ROBOT = 1.2  # metres between the middles of robot and walker at the start
_FROM_EACH_OTHER = 0.8
_KEEP_AWAY = (2.0, 0.2)  # cost beside obstacles, metres within which it fades: people walk in the middle of doorways
_ROUTE_TRIES = 200


def draw_walkers(
    asked: WalkersConfig, outlines: Sequence[Points], robot: Pose2D, generator: Callable[[str], np.random.Generator]
) -> tuple[Walker, ...] | None:
    """Return ``asked.count`` walkers on the floor between ``outlines``, or None without enough room.

    ``robot``: start pose. ``generator``: random numbers by the walker's name.
    """
    floor = FloorGrid.of(outlines).every(_STEP)
    walkers: list[Walker] = []
    for number in range(1, asked.count + 1):
        name = f"walker_{number}"
        rng = generator(name)
        radius, speed = float(rng.uniform(*asked.radius)), float(rng.uniform(*asked.speed))
        free = floor.largest_area(radius + _ROOM)
        points = _way_points(asked, floor, free, robot, walkers, rng)
        route = _round(floor, free, points) if points is not None else None
        if route is None:
            return None
        walkers.append(Walker(name, radius, asked.height, asked.mass, speed, route, asked.considerate))
    return tuple(walkers)


def _way_points(
    asked: WalkersConfig,
    floor: FloorGrid,
    free: NDArray[np.bool_],
    robot: Pose2D,
    others: Sequence[Walker],
    rng: np.random.Generator,
) -> Points | None:
    """Return points (N, 2) to walk between; the first one is not near the robot or another walker."""
    if asked.way_points is not None:
        return np.array(asked.way_points)
    rows, columns = np.nonzero(free)
    for _ in range(_ROUTE_TRIES if len(rows) else 0):
        chosen = rng.integers(len(rows), size=asked.stops)
        points = floor.points(rows[chosen], columns[chosen])
        near = [math.dist(points[0], other.route[0]) < _FROM_EACH_OTHER for other in others]
        if math.dist(points[0], robot.xy) >= _FROM_ROBOT and not any(near):
            return points
    return None


def _round(floor: FloorGrid, free: NDArray[np.bool_], points: Points) -> tuple[tuple[float, float], ...] | None:
    """Return the shortest paths from each of ``points`` to the next one and back to the first, or None if one is cut
    off.
    """
    rows, columns = floor.cells(points)
    numbers = np.full(free.shape, -1)
    numbers[free] = np.arange(int(free.sum()))
    stops = numbers[rows, columns]
    if np.any(stops < 0):
        return None
    lengths, before = dijkstra(_steps(floor, numbers), directed=False, indices=stops, return_predecessors=True)
    cells = np.argwhere(free)
    route: list[tuple[float, float]] = []
    for index, stop in enumerate(np.roll(stops, -1)):
        if not np.isfinite(lengths[index, stop]):
            return None
        way = [int(stop)]
        while way[-1] != stops[index]:
            way.append(int(before[index, way[-1]]))
        route += [(float(x), float(y)) for x, y in floor.points(*cells[way[:0:-1]].T)]
    return tuple(route) or None


def _steps(floor: FloorGrid, numbers: NDArray[np.intp]) -> coo_array:
    """Return the graph of the free cells, each with its eight neighbours; weights are lengths, greater beside
    obstacles.
    """
    most, fades = _KEEP_AWAY
    cost = 1.0 + most * np.exp(-floor.room / fades)
    rows, columns = numbers.shape
    starts, ends, weights = [], [], []
    for down, right in ((0, 1), (1, 0), (1, 1), (1, -1)):
        here = (slice(0, rows - down), slice(max(0, -right), columns - max(0, right)))
        there = (slice(down, rows), slice(max(0, right), columns + min(0, right)))
        both = (numbers[here] >= 0) & (numbers[there] >= 0)
        starts.append(numbers[here][both])
        ends.append(numbers[there][both])
        weights.append(math.hypot(down, right) * floor.resolution * (cost[here] + cost[there])[both] / 2)
    count = int(numbers.max()) + 1
    return coo_array((np.concatenate(weights), (np.concatenate(starts), np.concatenate(ends))), shape=(count, count))


_APART = 0.05
_AROUND_ROBOT = 1.0  # side of the square that stays free at its start, metres
_TRIES = 200


def exactly_placed(scene: SceneConfig, generator: Callable[[str], np.random.Generator]) -> tuple[PlacedFurniture, ...]:
    """Return the present unmapped furniture with an exact place. ``generator``: random numbers by a piece's name."""
    return tuple(
        _unmapped(scene, name, Pose2D(*asked.at))
        for name, asked in scene.file.unmapped.items()
        if asked.at is not None and float(generator(name).random()) < asked.presence
    )


def draw_changes(
    scene: SceneConfig,
    furniture: Sequence[PlacedFurniture],
    standing: Sequence[Points],
    robot: Pose2D,
    generator: Callable[[str], np.random.Generator],
) -> tuple[PlacedFurniture, ...] | None:
    """Return the furniture with the moved and unmapped pieces, or None if one of them cannot be placed.

    Such a piece may be an obstacle, but must not cut off floor that a disc of the scene's ``passage`` could reach,
    except the floor that it covers. A moved piece without such a place must not cut off more floor than at its old
    place. ``standing``: outlines of walls and open doors. ``robot``: start pose. ``generator``: random numbers by a
    piece's name.
    """
    pieces = list(furniture)
    for index, piece in enumerate(furniture):
        far = scene.file.furniture[piece.name].moved if piece.mapped else 0.0
        if far > 0.0:
            rest = [*standing, *(line for other in pieces if other is not piece for line in body_outlines(other))]
            spans = [(c - far, c + far) for c in piece.nominal.xy]
            floor = _Floor(rest, robot, scene.file.passage)
            moved = floor.place(piece.model, (*spans, (-math.pi, math.pi)), generator(piece.name), stood=piece.actual)
            if moved is None:
                return None
            pieces[index] = replace(piece, actual=moved)
    for name, asked in scene.file.unmapped.items():
        region, rng = asked.region or scene.file.robot_start, generator(name)
        assert region is not None
        if asked.at is not None or float(rng.random()) >= asked.presence:
            continue
        rest = [*standing, *(line for other in pieces for line in body_outlines(other))]
        place = _Floor(rest, robot, scene.file.passage).place(scene.unmapped[name], _limits(region), rng)
        if place is None:
            return None
        pieces.append(_unmapped(scene, name, place))
    return tuple(pieces)


def _unmapped(scene: SceneConfig, name: str, place: Pose2D) -> PlacedFurniture:
    opened = scene.file.unmapped[name].open
    return PlacedFurniture(name, scene.unmapped[name], place, place, open=opened, mapped=False)


class _Floor:
    """The floor without the piece to place: the ``taken`` area, and the part of the rest that a disc reaches."""

    def __init__(self, taken: Sequence[Points], robot: Pose2D, passage: float) -> None:
        kept_free = rectangle(Pose2D(robot.x, robot.y, 0.0), (_AROUND_ROBOT, _AROUND_ROBOT))
        self._taken, self._passage = (*taken, kept_free), passage
        self._grid = FloorGrid.of(taken)
        self._reached = self._grid.largest_area(passage)

    def place(
        self,
        model: FurnitureModel,
        limits: Sequence[tuple[float, float]],
        rng: np.random.Generator,
        stood: Pose2D | None = None,
    ) -> Pose2D | None:
        """Return a pose within the limits of x, y and yaw, outside all occupied areas, that leaves a passage.

        If there is none, one that cuts off no more than the piece did where it ``stood``.
        """
        depth, width = model.footprint
        in_reach = self._in_reach(limits, math.hypot(depth, width) / 2 + 2 * _APART)
        reached_before = None if stood is None else self._beside(stood, model)[0]
        second_best: Pose2D | None = None
        for _ in range(_TRIES):
            x, y, yaw = (float(rng.uniform(*limit)) for limit in limits)
            pose = Pose2D(x, y, yaw)
            grown = rectangle(pose, (depth + 2 * _APART, width + 2 * _APART))
            if any(polygons_overlap(grown, other) for other in in_reach):
                continue
            reached, has_room = self._beside(pose, model)
            cut_off = has_room & ~reached
            if not np.any(self._reached & cut_off):
                return pose
            if second_best is None and reached_before is not None and not np.any(reached_before & cut_off):
                second_best = pose
        return second_best

    def _in_reach(self, limits: Sequence[tuple[float, float]], radius: float) -> list[Points]:
        """Return the occupied outlines that a piece of this radius can touch within the limits."""
        (x_min, x_max), (y_min, y_max) = limits[:2]
        low, high = np.array([x_min, y_min]) - radius, np.array([x_max, y_max]) + radius
        return [line for line in self._taken if np.all(line.max(axis=0) >= low) and np.all(line.min(axis=0) <= high)]

    def _beside(self, pose: Pose2D, model: FurnitureModel) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Return, each (rows, columns), the cells that the disc can reach with the piece in place, and those in which
        it fits.
        """
        grid = self._grid.beside(rectangle(pose, model.footprint), self._passage)
        return grid.largest_area(self._passage), grid.room > self._passage


def _limits(region: RegionConfig) -> tuple[tuple[float, float], ...]:
    return region.x, region.y, region.yaw
