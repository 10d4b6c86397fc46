"""What the map tells of a piece's structure: its boards, and its doors and drawers without their handles."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import Box, PlacedShape, Pose
from bestman_bt.scene.scene import Articulation, FurnitureModel
from bestman_bt.world_model import MapLeaf

_ON_THE_FACE = 0.002
"""Metres behind the face of a front within which its own pieces begin."""


def boards(model: FurnitureModel, elevation: float) -> tuple[PlacedShape, ...]:
    """The boxes of the body of furniture that opens, raised by ``elevation``; nothing of furniture that does not."""
    return _raised(_boxes(model.parts), elevation) if model.articulations else ()


def leaves(model: FurnitureModel, elevation: float, opened: Mapping[str, float]) -> tuple[MapLeaf, ...]:
    """Doors and drawers as slabs, those of drawers with the boards behind them; grooves and handles are left out.

    ``opened``: how far the map has them open, by their names.
    """
    return tuple(
        MapLeaf(
            name=leaf.name,
            kind=leaf.kind,
            origin=(leaf.origin[0], leaf.origin[1], leaf.origin[2] + elevation),
            axis=leaf.axis,
            upper=leaf.upper,
            shapes=_raised(_plain_boards(leaf), elevation),
            position=opened.get(leaf.name, 0.0),
        )
        for leaf in model.articulations
    )


def _plain_boards(leaf: Articulation) -> list[PlacedShape]:
    """The front as one slab as large as its panel, and what lies behind it."""
    boxes = _boxes(leaf.parts)
    panel = leaf.handle.panel
    if panel is None or not boxes:
        return boxes
    face = float(panel.position[0])
    extents = [_extent(box) for box in boxes]
    front = [extent for extent in extents if extent[0][0] <= face + _ON_THE_FACE]
    if not front:
        return boxes
    lower = np.min([extent[0] for extent in front], axis=0)
    upper = np.max([extent[1] for extent in front], axis=0)
    x, y, z = (float(size) for size in upper - lower)
    slab = PlacedShape(Box((x, y, z)), Pose((lower + upper) / 2))
    behind = [
        box
        for box, extent in zip(boxes, extents, strict=True)
        if extent[0][0] > face + _ON_THE_FACE and np.any(extent[1] > upper + 1e-9)
    ]
    return [slab, *behind]


def _boxes(parts: Sequence[PlacedShape]) -> list[PlacedShape]:
    """Handles of bars and knobs are round, boards are not."""
    return [part for part in parts if isinstance(part.shape, Box)]


def _extent(placed: PlacedShape) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Lower and upper corner of the bounding box, (3,) each."""
    assert isinstance(placed.shape, Box)
    half = np.abs(placed.pose.rotation) @ np.array(placed.shape.size) / 2
    return placed.pose.position - half, placed.pose.position + half


def _raised(shapes: Sequence[PlacedShape], elevation: float) -> tuple[PlacedShape, ...]:
    lift = Pose.from_xyz_rpy((0.0, 0.0, elevation))
    return tuple(PlacedShape(placed.shape, lift @ placed.pose) for placed in shapes)
