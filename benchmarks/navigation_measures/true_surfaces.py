"""What truly stands in the plane of a lidar."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import Box, Cylinder, PlacedShape, Pose
from bestman_bt.scene.map_of_world import semantic_map
from bestman_bt.scene.scene import World

SPACING = 0.01
"""Metres between the points that outlines are made of."""


class TrueSurfaces:
    """The outlines of all that stands at a height: ``segments`` (N, 4) and ``points`` (M, 2) on them, metres."""

    def __init__(self, world: World, height: float) -> None:
        segments = [semantic_map(world).walls]
        for piece in world.furniture:
            shapes = list(piece.model.parts)
            for door in piece.model.articulations:
                moved = door.moved(piece.open.get(door.name, 0.0))
                shapes += [PlacedShape(part.shape, moved @ part.pose) for part in door.parts]
            segments.extend(_slice(placed.shape, piece.pose @ placed.pose, height) for placed in shapes)
        self.segments = np.concatenate(segments)
        lengths = np.linalg.norm(self.segments[:, 2:] - self.segments[:, :2], axis=1)
        self.points = np.concatenate(
            [
                s[:2] + (s[2:] - s[:2]) * np.linspace(0.0, 1.0, max(2, math.ceil(length / SPACING)))[:, None]
                for s, length in zip(self.segments, lengths, strict=True)
            ]
        )


def _slice(shape: Any, pose: Pose, height: float) -> NDArray[np.float64]:
    """Outline (N, 4) of an upright shape at a height, none where it does not reach there."""
    z = float(pose.position[2])
    if isinstance(shape, Box) and abs(height - z) < shape.size[2] / 2:
        x, y = shape.size[0] / 2, shape.size[1] / 2
        corners = pose.to_pose2d().apply(np.array([[-x, -y], [x, -y], [x, y], [-x, y]]))
    elif isinstance(shape, Cylinder) and abs(height - z) < shape.length / 2:
        turn = np.arange(24) * (2.0 * math.pi / 24)
        corners = pose.position[:2] + shape.radius * np.column_stack([np.cos(turn), np.sin(turn)])
    else:
        return np.zeros((0, 4))
    return np.hstack([corners, np.roll(corners, -1, axis=0)])
