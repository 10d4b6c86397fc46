"""The body of generated furniture: an open box of boards, and how a model is put together from all parts."""

from __future__ import annotations

from collections.abc import Sequence

from bestman_bt.messages import Pose
from bestman_bt.scene.furniture_generator.solid import Color, Solid, block
from bestman_bt.scene.scene import Articulation, FurnitureModel, Surface


def carcass(
    front: float, back: float, width: float, bottom: float, top: float, board: float, color: Color
) -> list[Solid]:
    """Sides, back, bottom and top, open to the front: x from ``front`` to ``back``, z from ``bottom`` to ``top``."""
    half = width / 2
    return [
        block((front, -half, bottom), (back, -half + board, top), color),
        block((front, half - board, bottom), (back, half, top), color),
        block((back - board, -half + board, bottom), (back, half - board, top), color),
        block((front, -half + board, bottom), (back - board, half - board, bottom + board), color),
        block((front, -half + board, top - board), (back - board, half - board, top), color),
    ]


def surface(name: str, x: tuple[float, float], y: tuple[float, float], z: float) -> Surface:
    """A horizontal rectangle at height ``z``."""
    return Surface(name, Pose.from_xyz_rpy(((x[0] + x[1]) / 2, (y[0] + y[1]) / 2, z)), (x[1] - x[0], y[1] - y[0]))


def model(
    name: str,
    footprint: tuple[float, float],
    solids: Sequence[Solid],
    surfaces: Sequence[Surface],
    articulations: Sequence[Articulation] = (),
) -> FurnitureModel:
    """The piece of furniture made of all these."""
    return FurnitureModel(
        name=name,
        footprint=footprint,
        parts=tuple(solid.placed for solid in solids),
        colors=tuple(solid.rgba for solid in solids),
        surfaces=tuple(surfaces),
        articulations=tuple(articulations),
    )
