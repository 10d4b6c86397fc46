"""Coloured solids, the elements of generated furniture."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bestman_bt.messages import Box, Cylinder, PlacedShape, Pose, Shape, Sphere

Color = tuple[float, float, float]
Point = tuple[float, float, float]

# frame_from_z of cylinders along x, y and z
_ALONG = {
    "x": Pose.from_xyz_rpy((0.0, 0.0, 0.0), (0.0, np.pi / 2, 0.0)),
    "y": Pose.from_xyz_rpy((0.0, 0.0, 0.0), (-np.pi / 2, 0.0, 0.0)),
    "z": Pose(),
}


@dataclass(frozen=True)
class Solid:
    """A coloured shape in the frame of its parent."""

    shape: Shape
    pose: Pose
    color: Color

    def seen_from(self, other_from_frame: Pose) -> Solid:
        """Return the same solid, expressed in another frame."""
        return Solid(self.shape, other_from_frame @ self.pose, self.color)

    @property
    def placed(self) -> PlacedShape:
        """Shape and pose without the colour."""
        return PlacedShape(self.shape, self.pose)

    @property
    def rgba(self) -> tuple[float, float, float, float]:
        """The colour, opaque."""
        return (*self.color, 1.0)

    @property
    def volume(self) -> float:
        """Volume, cubic metres."""
        match self.shape:
            case Box():
                return float(np.prod(self.shape.size))
            case Cylinder():
                return float(np.pi * self.shape.radius**2 * self.shape.length)
            case Sphere():
                return float(4 / 3 * np.pi * self.shape.radius**3)
        raise TypeError(f"generated furniture has no {type(self.shape).__name__}")


def block(lower: Point, upper: Point, color: Color) -> Solid:
    """Return the box between two corners, along the axes."""
    low, high = np.array(lower, dtype=float), np.array(upper, dtype=float)
    size = tuple(float(extent) for extent in high - low)
    return Solid(Box((size[0], size[1], size[2])), Pose((low + high) / 2), color)


def rod(centre: Point, along: str, radius: float, length: float, color: Color) -> Solid:
    """Return a cylinder along ``x``, ``y`` or ``z``."""
    return Solid(Cylinder(radius, length), Pose(np.array(centre, dtype=float), _ALONG[along].quaternion), color)


def ball(centre: Point, radius: float, color: Color) -> Solid:
    """Return a sphere."""
    return Solid(Sphere(radius), Pose(np.array(centre, dtype=float)), color)
