"""The perceived scene as marks for pictures and recordings; everything in one frame."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import Handle, ObjectModel, PlacedShape, Pose, YawSet


@dataclass(frozen=True, eq=False)
class ObjectMark:
    """An object: pose, confidence and its measured points ((N, 3) metres, may be empty).

    ``recognised``: False for an object without a model; ``model`` is then its box.
    """

    name: str
    model: ObjectModel
    pose: Pose
    confidence: float
    position_std: float
    yaw_set: YawSet
    points: NDArray[np.float64]
    recognised: bool = True


@dataclass(frozen=True, eq=False)
class GraspMark:
    """A grasp: ``pose`` of the tool (z leaves the hand, y closes), metres between the fingers, depth of the fingers."""

    target: str
    pose: Pose
    width: float
    finger_depth: float
    quality: float


@dataclass(frozen=True)
class HandleMark:
    """A named handle."""

    name: str
    handle: Handle


@dataclass(frozen=True)
class SurfaceMark:
    """A measured support surface: ``pose`` of its middle, z up, and its (x, y) extents in metres."""

    name: str
    pose: Pose
    size: tuple[float, float]


@dataclass(frozen=True)
class SceneMarks:
    """The perceived scene. ``obstacles``: other believed solid shapes."""

    objects: tuple[ObjectMark, ...] = ()
    handles: tuple[HandleMark, ...] = ()
    grasps: tuple[GraspMark, ...] = ()
    surfaces: tuple[SurfaceMark, ...] = ()
    obstacles: tuple[PlacedShape, ...] = ()


Color = tuple[int, int, int]
"""Red, green, blue, 0 to 255."""

AXES: tuple[Color, Color, Color] = ((230, 70, 70), (80, 200, 90), (80, 130, 255))
SURFACE_COLOR: Color = (120, 220, 220)
GRASP_COLOR: Color = (255, 255, 255)
HANDLE_COLOR: Color = (255, 60, 200)
OPENING_COLOR: Color = (255, 230, 80)
PALETTE: tuple[Color, ...] = (
    (66, 133, 244),
    (234, 88, 62),
    (52, 168, 83),
    (250, 187, 5),
    (171, 71, 188),
    (0, 172, 193),
    (255, 112, 167),
    (158, 157, 36),
)
"""Colours of objects, in the order in which they were found."""


def object_color(index: int) -> Color:
    """Return the colour, rgb, of the object at ``index``."""
    return PALETTE[index % len(PALETTE)]


def box_edges(pose: Pose, lower: NDArray[np.float64], upper: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the 12 edges of a box, (12, 2, 3) metres, in the frame of ``pose``."""
    corners = pose.apply(
        np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)]) * (upper - lower) + lower
    )
    pairs = [(a, b) for a in range(8) for b in range(a + 1, 8) if bin(a ^ b).count("1") == 1]
    return np.array([[corners[a], corners[b]] for a, b in pairs])


def grasp_lines(grasp: GraspMark) -> NDArray[np.float64]:
    """Return a hand as lines: two fingers, the palm, and a wrist; (4, 2, 3) metres."""
    half, depth = grasp.width / 2, grasp.finger_depth
    points = np.array(
        [
            [[0, -half, 0], [0, -half, -depth]],
            [[0, half, 0], [0, half, -depth]],
            [[0, -half, -depth], [0, half, -depth]],
            [[0, 0, -depth], [0, 0, -depth - 0.04]],
        ]
    )
    lines: NDArray[np.float64] = grasp.pose.apply(points.reshape(-1, 3)).reshape(-1, 2, 3)
    return lines
