"""A planning scene from two sides, with colliding pairs in red."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw
from scipy.spatial import ConvexHull, QhullError

from bestman_bt.messages import MotionObstacle

Body = tuple[str, NDArray[np.float64]]
"""Name and corners (N, 3) of a convex body, metres."""

SIDE = 420
"""Pixels of each of the two views."""
HEAD = 40
TURNS = (-60.0, 30.0)
"""Viewing directions, degrees about the vertical."""
DOWN = math.radians(20.0)
AROUND = 1.3
"""Distance from the robot's centre, metres, beyond which nothing is drawn."""
RED, ROBOT, OTHER, INK = (214, 39, 40), (120, 144, 170), (205, 190, 160), (40, 40, 40)


def scene_picture(bodies: Sequence[Body], robot: Collection[str], obstacle: MotionObstacle) -> NDArray[np.uint8]:
    """Return an image (H, W, 3) uint8 of the ``bodies`` around the robot, whose links have the names ``robot``, with a
    caption."""
    red = {name for pair in obstacle.pairs[:1] for name in pair}
    centre, size = _window([corners for name, corners in bodies if name in robot])
    near = [body for body in bodies if _is_near(body[1], centre, size)]
    picture = Image.new("RGB", (2 * SIDE, SIDE + HEAD), "white")
    for column, turn in enumerate(TURNS):
        picture.paste(_view(near, robot, red, centre, size, math.radians(turn)), (column * SIDE, HEAD))
    ImageDraw.Draw(picture).text((8, 8), str(obstacle), fill=RED if red else INK, font_size=15)
    return np.asarray(picture, dtype=np.uint8)


def _window(links: Sequence[NDArray[np.float64]]) -> tuple[NDArray[np.float64], float]:
    """Return the middle (3,) of the scene to show, and the distance from there to each edge, metres."""
    corners = np.concatenate(links) if links else np.zeros((1, 3))
    low, high = corners.min(axis=0), corners.max(axis=0)
    return (low + high) / 2, min(AROUND, 0.35 + float((high - low).max()) / 2)


def _is_near(corners: NDArray[np.float64], centre: NDArray[np.float64], size: float) -> bool:
    low, high = corners.min(axis=0), corners.max(axis=0)
    return bool((low < centre + size).all() and (high > centre - size).all())


def _view(
    bodies: Sequence[Body],
    robot: Collection[str],
    red: Collection[str],
    centre: NDArray[np.float64],
    size: float,
    turn: float,
) -> Image.Image:
    right = np.array([-math.sin(turn), math.cos(turn), 0.0])
    back = np.array([-math.cos(turn) * math.cos(DOWN), -math.sin(turn) * math.cos(DOWN), -math.sin(DOWN)])
    up = np.cross(right, back)
    up *= np.sign(up[2])
    view = Image.new("RGB", (SIDE, SIDE), "white")
    # Far ones first; what is large goes behind what stands on it, and the pair before all.
    order = sorted(
        bodies, key=lambda body: (body[0] in red, np.ptp(body[1], axis=0).max() < 2 * size, -_depth(body, back))
    )
    for name, corners in order:
        seen = np.clip(corners, centre - 2 * size, centre + 2 * size) - centre
        flat = np.stack([seen @ right, -(seen @ up)], axis=1) * (SIDE / 2 / size) + SIDE / 2
        try:
            outline = flat[ConvexHull(flat).vertices]
        except QhullError:  # seen exactly from its edge
            continue
        colour, opaque = (RED, 170) if name in red else (ROBOT, 200) if name in robot else (OTHER, 110)
        layer = Image.new("RGBA", view.size)
        points = [(float(x), float(y)) for x, y in outline]
        ImageDraw.Draw(layer).polygon(points, fill=(*colour, opaque), outline=(*(c // 2 for c in colour), 255))
        view.paste(layer, (0, 0), layer)
    ImageDraw.Draw(view).rectangle((0, 0, SIDE - 1, SIDE - 1), outline=(200, 200, 200))
    return view


def _depth(body: Body, back: NDArray[np.float64]) -> float:
    return float((body[1] @ back).mean())
