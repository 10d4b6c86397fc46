"""How a surface ends on each side of its rectangle: at a rim, at a wall, behind something, or with the picture."""

from __future__ import annotations

from collections import Counter

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import Pose
from bestman_bt.perception.segmentation.base import Side
from bestman_bt.perception.view import View

_STEP, _REACH, _LEVEL = 0.03, 0.07, 0.012
_PIXELS = 2


def surface_sides(view: View, frame_from_plane: Pose, size: tuple[float, float]) -> tuple[Side, ...]:
    """What most points just beyond -x, +x, -y, +y of the rectangle show."""
    half_x, half_y = size[0] / 2, size[1] / 2
    along = np.linspace(-0.9, 0.9, 19)
    sides: list[Side] = []
    for outward, start in (
        ((-1, 0), (-half_x, 0)),
        ((1, 0), (half_x, 0)),
        ((0, -1), (0, -half_y)),
        ((0, 1), (0, half_y)),
    ):
        reach = half_y if outward[0] else half_x
        tangent = np.array([outward[1], outward[0]]) * reach
        points = np.array(start) + along[:, None] * tangent
        sides.append(edge_kind(view, frame_from_plane, points, np.array(outward, dtype=float)))
    return tuple(sides)


def edge_kind(view: View, frame_from_plane: Pose, edge: NDArray[np.float64], outward: NDArray[np.float64]) -> Side:
    """How the surface ends along ``edge``, (N, 2) metres in the plane's frame; ``outward``: (2,), a unit vector."""
    votes: Counter[Side] = Counter()
    plane_from_frame = frame_from_plane.inverse()
    beyond = np.zeros((len(edge), 3))
    beyond[:, :2] = edge + _STEP * outward
    k = view.image.intrinsics
    pixels, expected = view.project(frame_from_plane.apply(beyond))
    shown = np.isfinite(pixels).all(axis=1)
    inside = np.zeros(len(edge), dtype=bool)
    inside[shown] = ((pixels[shown] >= _PIXELS) & (pixels[shown] < np.array([k.width, k.height]) - _PIXELS)).all(axis=1)
    votes["cut"] = int((~inside).sum())
    depth = np.full(len(edge), np.nan)
    # The camera often knows nothing right at an edge: the nearest pixel around that it does know is asked.
    for du, dv in _AROUND:
        unknown = inside & np.isnan(depth)
        if not unknown.any():
            break
        depth[unknown] = view.measured_depth(pixels[unknown] + (du, dv))
    known = inside & np.isfinite(depth)
    rays = np.column_stack([(pixels[known] - (k.cx, k.cy)) / (k.fx, k.fy), np.ones(int(known.sum()))])
    measured = plane_from_frame.apply(view.frame_from_camera.apply(rays * depth[known][:, None]))
    behind = depth[known] - expected[known]
    beside = np.linalg.norm(measured[:, :2] - edge[known], axis=1) < _REACH
    votes["rim"] = int((behind > _LEVEL).sum())
    votes["wall"] = int(((behind < -_LEVEL) & beside).sum())
    votes["hidden"] = len(edge) - sum(votes.values())
    return max(votes, key=lambda side: votes[side])


_AROUND = sorted(
    ((du, dv) for du in range(-_PIXELS, _PIXELS + 1) for dv in range(-_PIXELS, _PIXELS + 1)),
    key=lambda step: step[0] ** 2 + step[1] ** 2,
)
