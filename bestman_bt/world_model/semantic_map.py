"""The semantic map: the given knowledge of the surroundings."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import Box, JointKind, PlacedShape, Pose, Pose2D, joint_motion

AROUND = 0.02
"""Metres around the boards of a door or drawer within which points count as part of it, or of its contents."""

_SIGNS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])  # of a box's corners


@dataclass(frozen=True)
class MapSurface:
    """A surface to put things on; ``pose``: of its centre in the furniture frame; ``size``: (x, y) metres.

    ``drawer``: the one that it moves with, if any; ``pose`` is then that of the closed drawer.
    """

    name: str
    pose: Pose
    size: tuple[float, float]
    drawer: str | None = None


@dataclass(frozen=True, eq=False)
class MapArticulation:
    """A door or drawer of the map, closed, in the furniture frame.

    ``origin``: (3,) metres, a point on the ``axis``, (3,) unit, about or along which it opens. ``shapes``: its boards,
    without its handle. ``upper``: its full range, radians or metres; ``position``: its opening when the map was made.
    ``handle_depth``: metres by which its handle protrudes from its front, ``shapes[0]``; the map does not contain the
    handle's position on the front.
    """

    name: str
    kind: JointKind
    origin: tuple[float, float, float]
    axis: tuple[float, float, float]
    upper: float
    shapes: tuple[PlacedShape, ...]
    position: float = 0.0
    handle_depth: float = 0.0

    @property
    def handle_room(self) -> PlacedShape | None:
        """Return the box in front of the closed front that contains the handle, in the furniture frame; None without a
        handle."""
        front = self.shapes[0]
        if not self.handle_depth or not isinstance(front.shape, Box):
            return None
        thickness, width, height = front.shape.size
        before = Pose(np.array([-(thickness + self.handle_depth) / 2, 0.0, 0.0]))
        return PlacedShape(Box((self.handle_depth, width, height)), front.pose @ before)

    @property
    def hull(self) -> PlacedShape:
        """Return a box around its boards and contents when closed, in the furniture frame."""
        boards = [(placed.pose, placed.shape.size) for placed in self.shapes if isinstance(placed.shape, Box)]
        corners = np.concatenate([pose.apply(_SIGNS * np.array(size) / 2) for pose, size in boards])
        lower, upper = corners.min(axis=0) - AROUND, corners.max(axis=0) + AROUND
        x, y, z = (float(size) for size in upper - lower)
        return PlacedShape(Box((x, y, z)), Pose((lower + upper) / 2))

    def moved(self, position: float) -> Pose:
        """Return furniture_from_closed at ``position``, radians or metres."""
        return joint_motion(self.kind, self.origin, self.axis, position)


@dataclass(frozen=True)
class MapFurniture:
    """A piece of furniture, believed at ``pose``; its front faces -x.

    ``footprint``: (x, y) extents in metres. ``height``: metres. ``solid_at_lidar``: whether a lidar sees its footprint
    (a counter) or only legs (a table). ``shapes``: its boards in the furniture frame, and ``articulations``: its doors
    and drawers; empty if the map has only the outline. ``position_error`` (metres, each way) and ``heading_error``
    (radians): bounds of the error of ``pose``, reduced by measurements. ``is_passage``: whether the robot drives
    through it: a door between rooms.
    """

    name: str
    pose: Pose2D
    footprint: tuple[float, float]
    height: float
    surfaces: tuple[MapSurface, ...]
    solid_at_lidar: bool
    shapes: tuple[PlacedShape, ...] = ()
    articulations: tuple[MapArticulation, ...] = ()
    position_error: float = 0.03
    heading_error: float = math.radians(2.0)
    is_passage: bool = False

    def shapes_in_map(self) -> tuple[PlacedShape, ...]:
        """Return ``shapes`` in the map frame."""
        frame = self.pose.to_pose()
        return tuple(PlacedShape(placed.shape, frame @ placed.pose) for placed in self.shapes)

    def articulation(self, name: str) -> MapArticulation:
        """Return the door or drawer of this name. Raises KeyError if there is none."""
        for door in self.articulations:
            if door.name == name:
                return door
        raise KeyError(f"{self.name} has no door or drawer {name!r}")

    def is_inside(self, surface: MapSurface) -> bool:
        """Return whether a surface lies inside this piece: in a drawer, or behind a door."""
        highest = max(float(other.pose.position[2]) for other in self.surfaces)
        return bool(self.articulations) and float(surface.pose.position[2]) < highest

    def covers(self, point: NDArray[np.float64], margin: float = 0.0) -> bool:
        """Return whether a point (2,) of the map, metres, lies on the footprint, grown by ``margin`` metres on each
        side.
        """
        x, y = np.abs(self.pose.inverse().apply(np.asarray(point)[None])[0])
        return bool(x <= self.footprint[0] / 2 + margin and y <= self.footprint[1] / 2 + margin)

    def corners(self) -> NDArray[np.float64]:
        """Return the corners of the footprint in the map frame, (4, 2) metres, counter-clockwise."""
        x, y = self.footprint[0] / 2, self.footprint[1] / 2
        return self.pose.apply(np.array([[-x, -y], [x, -y], [x, y], [-x, y]]))


WALL_HEIGHT = 2.5
"""Assumed height of walls, metres; the map has only their faces."""
OPEN_FLOOR = 3.0
"""Metres of free floor around the furniture if there are no enclosing walls."""


@dataclass(frozen=True)
class SemanticMap:
    """Walls and furniture in the map frame, metres.

    ``walls``: (N, 4) segments x1, y1, x2, y2, the exact faces that a lidar hits. ``furniture``: by name.
    """

    walls: NDArray[np.float64]
    furniture: Mapping[str, MapFurniture]

    def surface(self, name: str) -> tuple[MapFurniture, MapSurface]:
        """Return the surface named ``furniture`` or ``furniture/surface``. Raises KeyError listing the known names."""
        furniture_name, _, surface_name = name.partition("/")
        furniture = self.furniture.get(furniture_name)
        if furniture is not None:
            for surface in furniture.surfaces:
                if not surface_name or surface.name == surface_name:
                    return furniture, surface
        known = [f"{f.name}/{s.name}" for f in self.furniture.values() for s in f.surfaces]
        raise KeyError(f"no surface {name!r} in the map; known: {', '.join(known)}")

    def wall_boxes(self, height: float = WALL_HEIGHT, thickness: float = 0.0) -> list[tuple[Box, Pose]]:
        """Return the walls as boxes, metres, with their poses in the map frame."""
        boxes = []
        for x1, y1, x2, y2 in self.walls:
            centre = ((x1 + x2) / 2, (y1 + y2) / 2, height / 2)
            pose = Pose.from_xyz_rpy(centre, (0.0, 0.0, math.atan2(y2 - y1, x2 - x1)))
            boxes.append((Box((math.hypot(x2 - x1, y2 - y1) + thickness, thickness, height)), pose))
        return boxes

    def with_furniture(self, piece: MapFurniture) -> SemanticMap:
        """Return the map with the piece of this name replaced."""
        return replace(self, furniture={**self.furniture, piece.name: piece})

    def standing_under(self, name: str) -> MapFurniture | None:
        """Return the piece of furniture on which ``name`` stands, or None if it stands on the floor."""
        upper = self.furniture[name]
        lower = [piece for piece in self.furniture.values() if piece.height < upper.height and piece is not upper]
        return next((piece for piece in lower if piece.covers(upper.pose.xy)), None)

    def lidar_segments(self) -> NDArray[np.float64]:
        """Return the segments (N, 4), metres, that a lidar should see: walls and footprints of solid furniture."""
        segments = [self.walls]
        for furniture in self.furniture.values():
            if furniture.solid_at_lidar:
                corners = furniture.corners()
                segments.append(np.hstack([corners, np.roll(corners, -1, axis=0)]))
        return np.concatenate(segments)

    def bounds(self, margin: float = 0.0) -> tuple[float, float, float, float]:
        """Return the rectangle (x_min, y_min, x_max, y_max) around walls and furniture, grown by ``margin`` metres.

        Without enclosing walls, it also covers the origin and a further ``OPEN_FLOOR`` metres.
        """
        points = np.concatenate([self.walls.reshape(-1, 2), *(piece.corners() for piece in self.furniture.values())])
        if len(np.unique(self.walls[:, :2].round(3), axis=0)) < 3:
            points = np.concatenate([points, [[0.0, 0.0]]])
            margin += OPEN_FLOOR
        (x_min, y_min), (x_max, y_max) = points.min(axis=0) - margin, points.max(axis=0) + margin
        return math.floor(x_min), math.floor(y_min), math.ceil(x_max), math.ceil(y_max)
