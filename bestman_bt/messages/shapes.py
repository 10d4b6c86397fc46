"""Geometric shapes of bodies: for collision worlds, object models and scenes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages.frozen_array import frozen_array
from bestman_bt.messages.pose import Pose


@dataclass(frozen=True)
class Box:
    """A box centred on its frame; ``size``: full extents (x, y, z) in metres."""

    size: tuple[float, float, float]


@dataclass(frozen=True)
class Cylinder:
    """A cylinder along z, centred on its frame; metres."""

    radius: float
    length: float


@dataclass(frozen=True)
class Sphere:
    """A ball centred on its frame; metres."""

    radius: float


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles: ``vertices`` (N, 3) metres, ``faces`` (M, 3) indices."""

    vertices: NDArray[np.float64]
    faces: NDArray[np.int64]

    def __post_init__(self) -> None:
        object.__setattr__(self, "vertices", frozen_array(self.vertices, (None, 3), "Mesh vertices"))
        object.__setattr__(self, "faces", frozen_array(self.faces, (None, 3), "Mesh faces", np.int64))

    @property
    def volume(self) -> float:
        """Cubic metres inside a closed surface; negative where its faces turn inwards."""
        a, b, c = (self.vertices[self.faces[:, corner]] for corner in range(3))
        return float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum()) / 6.0


Shape: TypeAlias = Box | Cylinder | Sphere | Mesh


@dataclass(frozen=True)
class PlacedShape:
    """A shape at ``pose`` in the frame of the body that it belongs to."""

    shape: Shape
    pose: Pose
