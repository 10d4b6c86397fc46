"""Where the furniture of a scene stands: each piece on the floor or on a surface of one named above it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from bestman_bt.messages import Pose2D
from bestman_bt.scene.scene import PlacedFurniture, Surface

if TYPE_CHECKING:
    from bestman_bt.scene.load import SceneConfig


def standing_furniture(
    scene: SceneConfig, shares: Callable[[str], Sequence[float]] = lambda piece: (0.0, 0.0, 0.0)
) -> tuple[PlacedFurniture, ...]:
    """The furniture in the order of the file, really standing beside where the map has it.

    ``shares``: by a piece's name the shares, each from -1 to 1, of its ``offset`` along x and y and of its ``turn``.
    """
    pieces: list[PlacedFurniture] = []
    for name, placement in scene.file.furniture.items():
        nominal = Pose2D(*placement.at)
        dx, dy, turn = shares(name)
        actual = Pose2D(
            nominal.x + placement.offset * float(dx),
            nominal.y + placement.offset * float(dy),
            nominal.theta + placement.turn * float(turn),
        )
        elevation, on = 0.0, None
        if placement.on is not None:
            below, surface = surface_of(scene, placement.on, pieces)
            in_furniture = surface.pose.to_pose2d()
            nominal, actual = below.nominal @ in_furniture @ nominal, below.actual @ in_furniture @ actual
            elevation, on = below.elevation + float(surface.pose.position[2]), below.name
        piece = PlacedFurniture(name, scene.furniture[name], nominal, actual, elevation, on, placement.open)
        pieces.append(replace(piece, mapped_open=placement.mapped_open))
    return tuple(pieces)


def surface_of(
    scene: SceneConfig, surface_name: str, furniture: Sequence[PlacedFurniture]
) -> tuple[PlacedFurniture, Surface]:
    """The piece that bears the surface called ``furniture`` or ``furniture/surface``, and that surface."""
    name, surface = scene.surface(surface_name)
    return next(piece for piece in furniture if piece.name == name), surface
