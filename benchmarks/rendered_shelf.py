"""Rendered shelves with known truth: boards at several heights, things on them, a room behind."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from benchmarks.rendering import Color, render_view
from bestman_bt.messages import Box, PlacedShape, Pose
from bestman_bt.perception.view import View

WOOD: Color = (0.7, 0.5, 0.3)


@dataclass(frozen=True, eq=False)
class RenderedShelf:
    """``shelf``: pose of its foot's centre, x into the shelf. ``size``: (depth, width) of a board, metres.

    ``things``: poses of the centres of boxes that stand on the boards, with their sizes.
    """

    view: View
    shelf: Pose
    size: tuple[float, float]
    heights: tuple[float, ...]
    things: tuple[tuple[Pose, tuple[float, float, float]], ...]


def camera_pose(x: float, y: float, pitch: float, yaw: float = 0.0, height: float = 1.65) -> Pose:
    """A head camera that looks ``pitch`` radians down."""
    mast_from_camera = Pose.from_matrix(
        np.array([[0.0, 0.0, 1.0, 0.0], [-1.0, 0.0, 0.0, 0.0], [0.0, -1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
    )
    return Pose.from_xyz_rpy((x, y, height), (0.0, pitch, yaw)) @ mast_from_camera


def random_shelf(
    seed: int,
    distance: float | None = None,
    heights: Sequence[float] = (0.3, 0.7, 1.1, 1.4),
    per_board: int = 2,
    back: bool | None = None,
) -> RenderedShelf:
    """A shelf 0.8 to 2 m away, turned by up to 30°, seen so that its boards are in the picture."""
    rng = np.random.default_rng(seed)
    distance = float(rng.uniform(1.1, 2.0)) if distance is None else distance
    back = bool(rng.random() < 0.5) if back is None else back
    depth, width, thick = 0.3, 0.8, 0.025
    shelf = Pose.from_xyz_rpy((distance + depth / 2, 0.0, 0.0), (0.0, 0.0, rng.uniform(-0.5, 0.5)))

    def board(size: tuple[float, float, float], x: float, y: float, z: float) -> tuple[PlacedShape, Color]:
        return PlacedShape(Box(size), shelf @ Pose.from_xyz_rpy((x, y, z))), WOOD

    parts: list[tuple[PlacedShape, Color]] = [
        (PlacedShape(Box((6.0, 6.0, 0.02)), Pose.from_xyz_rpy((2.0, 0.0, -0.01))), (0.5, 0.5, 0.5)),
        (PlacedShape(Box((0.1, 6.0, 3.0)), Pose.from_xyz_rpy((3.5, 0.0, 1.5))), (0.8, 0.8, 0.75)),
    ]
    parts += [board((depth, width, thick), 0.0, 0.0, height - thick / 2) for height in heights]
    parts += [board((depth, 0.02, 1.8), 0.0, side * (width / 2 + 0.01), 0.9) for side in (-1, 1)]
    if back:
        parts.append(board((0.01, width + 0.04, 1.8), depth / 2 + 0.005, 0.0, 0.9))
    things = []
    for height in heights:
        for number in range(per_board):
            x, y, z = (float(extent) for extent in rng.uniform([0.04, 0.04, 0.06], [0.08, 0.08, 0.15]))
            middle = (number + 0.5) / per_board - 0.5
            across = width * (middle + rng.uniform(-0.25, 0.25) / per_board) * 0.85
            pose = shelf @ Pose.from_xyz_rpy(
                (rng.uniform(-0.07, 0.07), across, height + z / 2), (0.0, 0.0, rng.uniform(0.0, math.pi))
            )
            parts.append((PlacedShape(Box((x, y, z)), pose), tuple(rng.uniform(0.2, 0.9, 3))))
            things.append((pose, (x, y, z)))
    # The middle of the shelf in the middle of the picture.
    pitch = math.atan2(1.65 - (heights[0] + heights[-1]) / 2, distance)
    view = render_view(parts, camera_pose(0.0, float(rng.uniform(-0.2, 0.2)), pitch), rng)
    return RenderedShelf(view, shelf, (depth, width), tuple(heights), tuple(things))
