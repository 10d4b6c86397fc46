"""Geometric shapes of bodies: for collision worlds, object models and scenes."""

from __future__ import annotations

import typing
from dataclasses import dataclass
from functools import cache
from itertools import product
from typing import Annotated, Any, TypeAlias

import numpy as np
from annotated_types import Ge, Gt, Le
from numpy.typing import ArrayLike, NDArray

from bestman_bt.errors import Error
from bestman_bt.messages.frozen_array import frozen_array
from bestman_bt.messages.pose import Pose

# Numbers with a range, for the parameters of algorithms: wrong ones are refused where a configuration is read.
# The types say what a value may be and cost nothing at run time. Every number of a configuration has to be finite, so
# no type says that.


Positive = Annotated[float, Gt(0)]
NonNegative = Annotated[float, Ge(0)]
Fraction = Annotated[float, Ge(0), Le(1)]
PositiveFraction = Annotated[float, Gt(0), Le(1)]
NonNegativeInt = Annotated[int, Ge(0)]
Count = Annotated[int, Ge(1)]
Several = Annotated[int, Ge(2)]


@dataclass(frozen=True)
class NotBelow:
    """Annotates a number that must not be smaller than ``field``: ``Annotated[float, NotBelow("least")]``."""

    field: str


class OrderError(Error, ValueError):
    """Two ``fields`` are valid on their own, but contradict each other."""

    def __init__(self, message: str, fields: tuple[str, str]) -> None:
        super().__init__(message)
        self.fields = fields


def check_bounds(parameters: object) -> None:
    """Raise OrderError if a field of a dataclass is smaller than the field that its ``NotBelow`` names."""
    kind: Any = type(parameters)  # mypy takes the types of dataclasses for unhashable
    for field, name in _ordered_fields(kind):
        least, value = getattr(parameters, field), getattr(parameters, name)
        if least > value:
            message = f"{field} ({least:g}) should not be larger than {name} ({value:g})"
            raise OrderError(message, (field, name))


@cache
def _ordered_fields(dataclass_type: Any) -> tuple[tuple[str, str], ...]:
    """Return pairs of fields of which the second must not be smaller; cached, as evaluating annotations takes most of a
    millisecond.
    """
    hints = typing.get_type_hints(dataclass_type, include_extras=True)
    marks = ((mark, name) for name, hint in hints.items() for mark in getattr(hint, "__metadata__", ()))
    return tuple((mark.field, name) for mark, name in marks if isinstance(mark, NotBelow))


@dataclass(frozen=True)
class Box:
    """A box centred on its frame; ``size``: full extents (x, y, z) in metres."""

    size: tuple[float, float, float]


@dataclass(frozen=True)
class Cylinder:
    """A cylinder along z, centred on its frame; ``radius``, ``length``: metres."""

    radius: float
    length: float


@dataclass(frozen=True)
class Sphere:
    """A sphere centred on its frame; ``radius``: metres."""

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
        """Return the volume inside a closed surface, m³; negative if its faces point inwards."""
        a, b, c = (self.vertices[self.faces[:, corner]] for corner in range(3))
        return float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum()) / 6.0


Shape: TypeAlias = Box | Cylinder | Sphere | Mesh


@dataclass(frozen=True)
class PlacedShape:
    """A shape at ``pose`` in the frame of its body."""

    shape: Shape
    pose: Pose


def box_corners(half: ArrayLike) -> NDArray[np.float64]:
    """Return the corners (8, 3) of a box around the origin; ``half``: half extents, (3,) or one value for all."""
    corners: NDArray[np.float64] = np.array(list(product((-1.0, 1.0), repeat=3))) * np.asarray(half, dtype=float)
    return corners


def bounding_corners(shape: Shape) -> NDArray[np.float64]:
    """Return the corners (8, 3) of the bounding box of a shape in its own frame; for a mesh, its vertices (N, 3)."""
    match shape:
        case Box():
            return box_corners(np.array(shape.size) / 2)
        case Cylinder():
            return box_corners([shape.radius, shape.radius, shape.length / 2])
        case Sphere():
            return box_corners(shape.radius)
        case Mesh():
            return shape.vertices


def distance_to_shape(points: NDArray[np.float64], placed: PlacedShape) -> NDArray[np.float64]:
    """Return the distances (N,) of points (N, 3) from a solid shape, metres, 0 inside; a mesh counts as its bounding
    box.
    """
    local = placed.pose.inverse().apply(points)
    shape = placed.shape
    match shape:
        case Sphere():
            outside: NDArray[np.float64] = np.maximum(np.linalg.norm(local, axis=1) - shape.radius, 0.0)
            return outside
        case Cylinder():
            radial = np.hypot(local[:, 0], local[:, 1]) - shape.radius
            along = np.abs(local[:, 2]) - shape.length / 2
            beyond: NDArray[np.float64] = np.hypot(np.maximum(radial, 0.0), np.maximum(along, 0.0))
            return beyond
        case Box():
            half = np.array(shape.size) / 2
        case Mesh():
            lower, upper = shape.vertices.min(axis=0), shape.vertices.max(axis=0)
            local, half = local - (lower + upper) / 2, (upper - lower) / 2
    distances: NDArray[np.float64] = np.linalg.norm(np.maximum(np.abs(local) - half, 0.0), axis=1)
    return distances
