"""Models of movable objects, for perception and grasping."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages.pose import Pose, wrap_angle
from bestman_bt.messages.shapes import PlacedShape, bounding_corners


@dataclass(frozen=True)
class YawSet:
    """A set of yaw angles. ``arcs``: (middle, half width) pairs in radians about z of the frame, disjoint, the most
    probable first.

    The set is empty for a body of revolution, which has no yaw.
    """

    arcs: tuple[tuple[float, float], ...] = ()

    @property
    def width(self) -> float:
        """Sum of the full widths of the arcs, radians; 0 to 2π."""
        return min(2.0 * math.pi, sum(2.0 * half for _, half in self.arcs))

    def contains(self, yaw: float) -> bool:
        """Return whether ``yaw``, radians, lies in one of the arcs; the empty set contains every yaw."""
        return not self.arcs or any(abs(wrap_angle(yaw - middle)) <= half for middle, half in self.arcs)

    def turned(self, angle: float) -> YawSet:
        """Return the set after the frame's content is turned by ``angle`` radians about z."""
        return YawSet(tuple((wrap_angle(middle + angle), half) for middle, half in self.arcs))


@dataclass(frozen=True, eq=False)
class ObjectGrasp:
    """A precomputed grasp.

    ``object_from_tool``: z points out of the hand, y is the closing direction. ``width``: metres between the fingers at
    contact. ``quality``: 0 to 1.
    """

    object_from_tool: Pose
    width: float
    quality: float


@dataclass(frozen=True)
class ObjectModel:
    """A rigid object; frame: z up when the object stands upright, origin at the centre of its bounding box.

    ``color``: rgb, each 0 to 1. ``mass``: kg. ``friction``: lateral coefficient. ``collision``: solid parts;
    ``visual``: shapes that a camera sees (empty: the collision shapes). ``symmetry_order``: number of rotations about z
    that look the same: 1 none, 2 half turns, 4 quarter turns, n turns by 2π/n, 0 any angle (a body of revolution).
    ``visual_colors``: rgb of each visual shape; empty: all have ``color``. ``grasps``: precomputed antipodal grasps,
    best first; may be empty.
    """

    name: str
    color: tuple[float, float, float]
    mass: float
    friction: float
    collision: tuple[PlacedShape, ...]
    visual: tuple[PlacedShape, ...] = ()
    symmetry_order: int = 1
    visual_colors: tuple[tuple[float, float, float], ...] = ()
    grasps: tuple[ObjectGrasp, ...] = field(default=(), compare=False)

    @property
    def appearance(self) -> tuple[tuple[PlacedShape, tuple[float, float, float]], ...]:
        """The visible shapes, each with its rgb colour, 0 to 1."""
        seen = self.visual or self.collision
        return tuple(zip(seen, self.visual_colors or (self.color,) * len(seen), strict=True))

    def bounds(self) -> NDArray[np.float64]:
        """Return the bounding box of the collision shapes in the object frame: (2, 3), lower and upper corner,
        metres.
        """
        corners = np.concatenate([placed.pose.apply(bounding_corners(placed.shape)) for placed in self.collision])
        return np.stack([corners.min(axis=0), corners.max(axis=0)])

    @property
    def size(self) -> NDArray[np.float64]:
        """Extents of the bounding box, (3,) metres."""
        lower, upper = self.bounds()
        extents: NDArray[np.float64] = upper - lower
        return extents
