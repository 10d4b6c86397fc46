"""Where the mass of doors and drawers lies."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray

from bestman_bt.messages import Box, Cylinder, PlacedShape, Sphere


def mass_distribution(parts: Sequence[PlacedShape], mass: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Centre of mass (3,) in the frame of the parts and inertia (3, 3) about it, kg m²; the parts are equally dense."""
    solids = [_solid(part) for part in parts]
    whole: Any = trimesh.util.concatenate(solids)
    whole.density = mass / sum(part.volume for part in solids)
    return np.asarray(whole.center_mass), np.asarray(whole.moment_inertia)


def _solid(part: PlacedShape) -> trimesh.Trimesh:
    solid: trimesh.Trimesh
    match part.shape:
        case Box():
            solid = trimesh.creation.box(part.shape.size)
        case Cylinder():
            solid = trimesh.creation.cylinder(part.shape.radius, part.shape.length)
        case Sphere():
            solid = trimesh.creation.icosphere(radius=part.shape.radius)
        case _:
            solid = trimesh.Trimesh(part.shape.vertices, part.shape.faces).convex_hull
    solid.apply_transform(part.pose.matrix)
    return solid
