"""The semantic map of a world for the robot: exact walls, furniture at nominal poses."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import Box, PlacedShape, Pose
from bestman_bt.scene.plane_geometry import segment_outside, wall_rectangle
from bestman_bt.scene.scene import Articulation, FurnitureModel, Surface, World
from bestman_bt.world_model.semantic_map import MapArticulation, MapFurniture, MapSurface, SemanticMap

_ON_THE_FACE = 0.002
"""Distance behind the face of a front within which its own boards begin, metres."""


def boards(model: FurnitureModel, elevation: float) -> tuple[PlacedShape, ...]:
    """Return the boards of furniture with doors or drawers, raised by ``elevation`` metres; empty for other pieces."""
    return _raised(_boxes(model.parts), elevation) if model.articulations else ()


def map_articulations(
    model: FurnitureModel, elevation: float, opened: Mapping[str, float]
) -> tuple[MapArticulation, ...]:
    """Return doors and drawers as slabs, drawers with their inner boards, without grooves; of handles only the depth.

    ``opened``: their mapped openings, by name.
    """
    return tuple(
        MapArticulation(
            name=door.name,
            kind=door.kind,
            origin=(door.origin[0], door.origin[1], door.origin[2] + elevation),
            axis=door.axis,
            upper=door.upper,
            shapes=_raised(_plain_boards(door), elevation),
            position=opened.get(door.name, 0.0),
            handle_depth=0.0 if door.handle.kind == "edge" else door.handle.standoff + door.handle.radius,
        )
        for door in model.articulations
    )


def _plain_boards(door: Articulation) -> list[PlacedShape]:
    """Return the front as one slab as large as its panel, and the boards behind it."""
    boxes = _boxes(door.parts)
    panel = door.handle.panel
    if panel is None or not boxes:
        return boxes
    face = float(panel.position[0])
    extents = [_extent(box) for box in boxes]
    front = [extent for extent in extents if extent[0][0] <= face + _ON_THE_FACE]
    if not front:
        return boxes
    lower = np.min([extent[0] for extent in front], axis=0)
    upper = np.max([extent[1] for extent in front], axis=0)
    x, y, z = (float(size) for size in upper - lower)
    slab = PlacedShape(Box((x, y, z)), Pose((lower + upper) / 2))
    behind = [
        box
        for box, extent in zip(boxes, extents, strict=True)
        if extent[0][0] > face + _ON_THE_FACE and np.any(extent[1] > upper + 1e-9)
    ]
    return [slab, *behind]


def _boxes(parts: Sequence[PlacedShape]) -> list[PlacedShape]:
    """Return the boards, which are boxes; bars and knobs of handles are round and are omitted."""
    return [part for part in parts if isinstance(part.shape, Box)]


def _extent(placed: PlacedShape) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Lower and upper corner of the bounding box, (3,) each."""
    assert isinstance(placed.shape, Box)
    half = np.abs(placed.pose.rotation) @ np.array(placed.shape.size) / 2
    return placed.pose.position - half, placed.pose.position + half


def _raised(shapes: Sequence[PlacedShape], elevation: float) -> tuple[PlacedShape, ...]:
    lift = Pose.from_xyz_rpy((0.0, 0.0, elevation))
    return tuple(PlacedShape(placed.shape, lift @ placed.pose) for placed in shapes)


_SCAN_BAND = (0.2, 0.3)  # heights between which lidars of mobile bases look, metres


def semantic_map(world: World) -> SemanticMap:
    """Return the robot's map: no objects, furniture at its nominal pose."""
    furniture = {
        piece.name: MapFurniture(
            name=piece.name,
            pose=piece.nominal,
            footprint=piece.model.footprint,
            height=piece.elevation + _height(piece.model),
            surfaces=tuple(
                MapSurface(s.name, Pose.from_xyz_rpy((0.0, 0.0, piece.elevation)) @ s.pose, s.size, door)
                for door, s in _surfaces(piece.model)
            ),
            solid_at_lidar=piece.elevation == 0.0 and _fills_scan_band(piece.model),
            shapes=boards(piece.model, piece.elevation),
            articulations=map_articulations(piece.model, piece.elevation, piece.mapped_open),
            is_passage=piece.model.is_passage,
            # doors stand in walls, which are exact
            position_error=0.0 if piece.model.is_passage else MapFurniture.position_error,
            heading_error=0.0 if piece.model.is_passage else MapFurniture.heading_error,
        )
        for piece in world.furniture
        if piece.mapped
    }
    return SemanticMap(walls=_wall_faces(world), furniture=furniture)


def _surfaces(model: FurnitureModel) -> Iterator[tuple[str | None, Surface]]:
    """Yield surfaces and the drawers that they move with; fixed ones come first."""
    for surface in model.all_surfaces:
        door = model.drawer_of(surface.name)
        yield (door.name if door is not None else None), surface


def _wall_faces(world: World) -> NDArray[np.float64]:
    """Return segments (N, 4): faces of the walls without the parts that other walls cover and without the building's
    outside.
    """
    outlines = [wall_rectangle(wall) for wall in world.walls]
    ends = np.array([point for wall in world.walls for point in (wall.start, wall.end)])
    lower, upper = ends.min(axis=0), ends.max(axis=0)
    faces: list[NDArray[np.float64]] = []
    for index, outline in enumerate(outlines):
        for start, end in zip(outline, np.roll(outline, -1, axis=0), strict=True):
            middle = (start + end) / 2
            if np.any(middle < lower) or np.any(middle > upper):
                continue
            pieces = [np.array([start, end])]
            for other in outlines[:index] + outlines[index + 1 :]:
                pieces = [rest for piece in pieces for rest in segment_outside(piece, other)]
            faces += pieces
    return np.array([face.ravel() for face in faces]).reshape(-1, 4)


def _height(model: FurnitureModel) -> float:
    tops = [float(surface.pose.position[2]) for surface in model.surfaces]
    tops.extend(
        float(part.pose.position[2]) + part.shape.size[2] / 2 for part in model.parts if isinstance(part.shape, Box)
    )
    return max(tops, default=0.0)


def _fills_scan_band(model: FurnitureModel) -> bool:
    """Return whether one box of the furniture covers its footprint, to 2 cm, over the whole scan band."""
    for part in model.parts:
        if isinstance(part.shape, Box):
            half, centre = np.array(part.shape.size) / 2, part.pose.position
            spans = centre[2] - half[2] <= _SCAN_BAND[0] and centre[2] + half[2] >= _SCAN_BAND[1]
            missing = np.array(model.footprint) / 2 - (half[:2] - np.abs(centre[:2]))
            if spans and np.all(missing <= 0.02):
                return True
    return False
