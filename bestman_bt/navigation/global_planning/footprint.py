"""The outline of a base on the floor, with its overhang above."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages.frozen_array import frozen_array
from bestman_bt.robot_model.model import BaseModel

_ROUNDED = 2e-3
"""Largest simplification error of the outline above, metres; much less than its margin."""
LOOKS_AROUND = 0.10
"""Height above the lidar up to which a body counts as part of the base, whose surroundings the lidar sees, metres."""
DISCS = 0.0125
"""Spacing of the discs on the outline with the overhang, metres."""
_AROUND = np.array([[math.cos(turn), math.sin(turn)] for turn in np.arange(8) * math.pi / 4]) / math.cos(math.pi / 8)


@dataclass(frozen=True, eq=False)
class Overhang:
    """The parts beyond the outline of a base above the floor: an arm and its load.

    ``corners``: (N, 2) metres in the base frame, counter-clockwise around the origin: the convex outline of the base
    and everything above it. ``height``: metres above the floor, of the lowest overhanging point; lower obstacles pass
    below it. ``reach``: metres of the overhang.
    """

    corners: NDArray[np.float64]
    height: float
    reach: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "corners", _outline(self.corners, "Overhang corners"))

    def __str__(self) -> str:
        return f"the arm extends {100 * self.reach:.0f} cm beyond the base, {self.height:.2f} m above the floor"


@dataclass(frozen=True, eq=False)
class UpperBody:
    """The parts of a robot above its lidar, such as a column, which may collide with obstacles that the lidar cannot
    see.

    ``corners``: (N, 2) metres in the base frame, counter-clockwise: convex outline, limited to that of the base.
    ``lidar_height`` and ``top``: metres above the floor.
    """

    corners: NDArray[np.float64]
    lidar_height: float
    top: float


@dataclass(frozen=True, eq=False)
class Footprint:
    """A convex outline around the origin: ``corners`` (N, 2) metres in the base frame, counter-clockwise.

    ``turning_drift``: metres that the origin may move during a turn in place. ``overhang``: outline of the parts above
    the base that extend beyond it, or None. ``upper``: the parts above the lidar within the outline; None if there are
    none, or if unknown.
    """

    corners: NDArray[np.float64]
    turning_drift: float = 0.0
    overhang: Overhang | None = None
    upper: UpperBody | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "corners", _outline(self.corners, "Footprint corners"))

    @classmethod
    def of(cls, base: BaseModel) -> Footprint:
        """Return the outline of a base."""
        return cls(np.array(base.footprint), base.part.turning_drift)

    def carrying(self, bodies: Iterable[NDArray[np.float64]], margin: float) -> Footprint:
        """Return the base with ``bodies`` above it, each the convex hull of points (N, 3), metres in the base frame.

        ``margin``: metres by which the bodies may sway in each direction; smaller overhangs count as part of the base.
        """
        reach, height, outside = 0.0, math.inf, [self.corners]
        for body in bodies:
            beyond = self._beyond(body[:, :2])
            out = beyond.max(axis=1)
            if len(body) == 0 or out.max() <= margin:
                continue
            reach = max(reach, float(out.max()))
            height = min(height, *(_lowest_beyond(side, body[:, 2]) for side in beyond.T))
            outside.append((body[out > margin, None, :2] + margin * _AROUND).reshape(-1, 2))
        if len(outside) == 1:
            return replace(self, overhang=None)
        hull = cv2.convexHull(np.concatenate(outside).astype(np.float32), clockwise=False)
        corners = cv2.approxPolyDP(hull, _ROUNDED, closed=True)[:, 0].astype(float)
        return replace(self, overhang=Overhang(corners, height - margin, reach))

    def reaching_above(self, lidar_height: float, bodies: Iterable[NDArray[np.float64]], margin: float) -> Footprint:
        """Return the footprint with its upper body: the ``bodies`` above ``lidar_height``, metres, which the lidar
        cannot see.

        ``bodies`` and ``margin``: as for ``carrying``. Bodies at the height of the overhang are part of the overhang
        only.
        """
        limit = math.inf if self.overhang is None else self.overhang.height
        high = [body for body in bodies if body[:, 2].max() > lidar_height + LOOKS_AROUND and body[:, 2].min() < limit]
        if not high:
            return replace(self, upper=None)
        points = np.concatenate(high)
        grown = (points[:, None, :2] + margin * _AROUND).reshape(-1, 2)
        hull = cv2.convexHull(grown.astype(np.float32), clockwise=False)
        _, within = cv2.intersectConvexConvex(hull, self.corners.astype(np.float32))
        if within is None:
            return replace(self, upper=None)
        corners = cv2.convexHull(within, clockwise=False)[:, 0].astype(float)
        return replace(self, upper=UpperBody(corners, lidar_height, float(points[:, 2].max())))

    @cached_property
    def above(self) -> Footprint:
        """The outline including the overhang; without an overhang, the outline of the base."""
        return self if self.overhang is None else Footprint(self.overhang.corners, self.turning_drift)

    @cached_property
    def discs_above(self) -> NDArray[np.float64]:
        """Return discs (N, 3) that cover the overhang: x, y and radius, metres.

        Discs on the outline reach half the way to the next one, inner ones leave a gap. No disc is next to the base, so
        that tall obstacles there do not constrain the base more than its own outline does.
        """
        outline = self.above.outline(DISCS)
        low, high = self.above.corners.min(axis=0), self.above.corners.max(axis=0)
        x, y = (np.arange(low[axis], high[axis], DISCS) for axis in (0, 1))
        within = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
        radius = -self.above._beyond(within).max(axis=1) - DISCS
        discs = np.vstack(
            [np.column_stack([outline, np.full(len(outline), DISCS / 2)]), np.column_stack([within, radius])]
        )
        discs = discs[(discs[:, 2] > 0.0) & (self._beyond(discs[:, :2]).max(axis=1) > DISCS)]
        # The larger ones hold most of the others.
        discs = discs[np.argsort(-discs[:, 2], kind="stable")]
        apart = np.linalg.norm(discs[:, None, :2] - discs[None, :, :2], axis=-1)
        held = np.tril(apart + discs[:, None, 2] <= discs[None, :, 2] + _ROUNDED, -1).any(axis=1)
        kept: NDArray[np.float64] = discs[~held]
        return kept

    def _beyond(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the distance (N, sides), metres, of points (N, 2) beyond the line of each side; negative within."""
        edges = np.roll(self.corners, -1, axis=0) - self.corners
        normals = np.column_stack([edges[:, 1], -edges[:, 0]]) / np.linalg.norm(edges, axis=1)[:, None]
        beyond: NDArray[np.float64] = points @ normals.T - np.einsum("ij,ij->i", normals, self.corners)
        return beyond

    @cached_property
    def inscribed_radius(self) -> float:
        """Radius of the largest circle about the origin inside the outline, metres."""
        edges = np.roll(self.corners, -1, axis=0) - self.corners
        cross = edges[:, 0] * -self.corners[:, 1] - edges[:, 1] * -self.corners[:, 0]
        return float(np.min(cross / np.linalg.norm(edges, axis=1)))

    @cached_property
    def circumscribed_radius(self) -> float:
        """Radius of the smallest circle about the origin around the outline, metres."""
        return float(np.linalg.norm(self.corners, axis=1).max())

    @property
    def turning_radius(self) -> float:
        """Radius of the circle about the origin that is swept in a turn in place, metres."""
        return self.circumscribed_radius + self.turning_drift

    def outline(self, spacing: float) -> NDArray[np.float64]:
        """Return points (N, 2) along the outline, metres, at most ``spacing`` metres apart, corners included."""
        return points_along(self.corners, spacing)


def points_along(corners: NDArray[np.float64], spacing: float) -> NDArray[np.float64]:
    """Return points (N, 2) along an outline, metres, at most ``spacing`` metres apart, corners included."""
    pieces = []
    for start, end in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        count = max(1, int(np.ceil(np.linalg.norm(end - start) / spacing)))
        pieces.append(start + (end - start) * (np.arange(count) / count)[:, None])
    return np.concatenate(pieces)


def _outline(corners: NDArray[np.float64], what: str) -> NDArray[np.float64]:
    frozen = frozen_array(corners, (None, 2), what)
    edges = np.roll(frozen, -1, axis=0) - frozen
    if len(frozen) < 3 or np.any(edges[:, 0] * -frozen[:, 1] - edges[:, 1] * -frozen[:, 0] <= 0):
        raise ValueError(f"{what} should go counter-clockwise around the origin but are {frozen.tolist()}")
    return frozen


def _lowest_beyond(beyond: NDArray[np.float64], height: NDArray[np.float64]) -> float:
    """Return the lowest height at which the convex hull of points, (N,) metres ``beyond`` a line and (N,) metres high,
    is beyond it.
    """
    out = beyond > 0.0
    if not out.any():
        return math.inf
    lowest = float(height[out].min())
    # Where the hull's surface crosses the line, it is an edge of the hull seen along the line, from a point inside.
    hull = cv2.convexHull(np.column_stack([beyond, height]).astype(np.float32))[:, 0].astype(float)
    for (x0, z0), (x1, z1) in zip(hull, np.roll(hull, -1, axis=0), strict=True):
        if (x0 > 0.0) != (x1 > 0.0):
            lowest = min(lowest, float(z0 + (z1 - z0) * x0 / (x0 - x1)))
    return lowest


def at_poses(outline: NDArray[np.float64], poses: NDArray[np.float64]) -> NDArray[np.float64]:
    """Transform an outline (M, 2) to each pose (N, 3); returns (N, M, 2), metres."""
    cos, sin = np.cos(poses[:, 2, None]), np.sin(poses[:, 2, None])
    return np.stack(
        [
            poses[:, 0, None] + cos * outline[:, 0] - sin * outline[:, 1],
            poses[:, 1, None] + sin * outline[:, 0] + cos * outline[:, 1],
        ],
        axis=-1,
    )
