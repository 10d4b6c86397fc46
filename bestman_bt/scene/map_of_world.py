"""The semantic map of a world: what the robot is told, walls exact, furniture where it should stand."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import Box, Pose
from bestman_bt.scene.boards_of_furniture import boards, leaves
from bestman_bt.scene.plane_geometry import cut_away, wall_rectangle
from bestman_bt.scene.scene import FurnitureModel, Surface, World
from bestman_bt.world_model import MapFurniture, MapSurface, SemanticMap

_SCAN_BAND = (0.2, 0.3)  # heights between which lidars of mobile bases look, metres


def semantic_map(world: World) -> SemanticMap:
    """The map that the robot gets: no objects, furniture at its nominal pose."""
    furniture = {
        piece.name: MapFurniture(
            name=piece.name,
            pose=piece.nominal,
            footprint=piece.model.footprint,
            height=piece.elevation + _height(piece.model),
            surfaces=tuple(
                MapSurface(s.name, Pose.from_xyz_rpy((0.0, 0.0, piece.elevation)) @ s.pose, s.size, leaf)
                for leaf, s in _surfaces(piece.model)
            ),
            solid_at_lidar=piece.elevation == 0.0 and _fills_scan_band(piece.model),
            shapes=boards(piece.model, piece.elevation),
            leaves=leaves(piece.model, piece.elevation, piece.mapped_open),
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
    """Surfaces and the drawers that they move with; those that stand still come first."""
    for surface in model.all_surfaces:
        leaf = model.leaf_of(surface.name)
        yield (leaf.name if leaf is not None else None), surface


def _wall_faces(world: World) -> NDArray[np.float64]:
    """Segments (N, 4): faces of the walls without what other walls cover and without the building's outside."""
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
                pieces = [rest for piece in pieces for rest in cut_away(piece, other)]
            faces += pieces
    return np.array([face.ravel() for face in faces]).reshape(-1, 4)


def _height(model: FurnitureModel) -> float:
    tops = [float(surface.pose.position[2]) for surface in model.surfaces]
    tops.extend(
        float(part.pose.position[2]) + part.shape.size[2] / 2 for part in model.parts if isinstance(part.shape, Box)
    )
    return max(tops, default=0.0)


def _fills_scan_band(model: FurnitureModel) -> bool:
    """Whether one box of the furniture covers its footprint, to 2 cm, over the whole scan band."""
    for part in model.parts:
        if isinstance(part.shape, Box):
            half, centre = np.array(part.shape.size) / 2, part.pose.position
            spans = centre[2] - half[2] <= _SCAN_BAND[0] and centre[2] + half[2] >= _SCAN_BAND[1]
            missing = np.array(model.footprint) / 2 - (half[:2] - np.abs(centre[:2]))
            if spans and np.all(missing <= 0.02):
                return True
    return False
