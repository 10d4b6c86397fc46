"""What may be asked of an apartment."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated

from bestman_bt.configuration.quantity import (
    Area,
    PositiveLength,
    PositiveWholeNumber,
    Share,
    SmallerFirst,
    WholeNumber,
)
from bestman_bt.messages import Pose2D
from bestman_bt.scene.plane_geometry import Points, rectangle
from bestman_bt.scene.scene import FurnitureModel

# A piece of furniture where it shall stand.


@dataclass(frozen=True)
class ApartmentPiece:
    """``open``: how far its doors are open, radians by their names."""

    name: str
    model: FurnitureModel
    at: Pose2D
    open: Mapping[str, float] = field(default_factory=dict)

    @property
    def outline(self) -> Points:
        """Corners of the footprint, (4, 2)."""
        return rectangle(self.at, self.model.footprint)


@dataclass(frozen=True)
class ApartmentOptions:
    """Of each pair of limits, the seed draws what lies between.

    ``rooms``: how many. ``area``: square metres within the outer walls; a room gets 14 to 24 of it. ``doorway``: clear
    width of the openings between rooms. ``loops``: the chance of a doorway that is not needed to get everywhere.
    ``moved_chairs``: the chance of a chair to have been moved by up to 60 cm each way since the map was made.
    ``doors``: the chance of a doorway to have a door; its leaf stands open, or half open (66° to 80°) with the chance
    ``half_open``. ``moved_doors``: the chance of a door to have been opened otherwise since the map was made.
    ``seed``: always this apartment; None: the seed of the world draws one.
    """

    rooms: Annotated[tuple[PositiveWholeNumber, PositiveWholeNumber], SmallerFirst] = (3, 6)
    area: Annotated[tuple[Area, Area], SmallerFirst] = (60.0, 110.0)
    doorway: Annotated[tuple[PositiveLength, PositiveLength], SmallerFirst] = (0.8, 0.9)
    loops: Share = 0.3
    moved_chairs: Share = 0.0
    doors: Share = 0.0
    half_open: Share = 0.3
    moved_doors: Share = 0.0
    wall_height: PositiveLength = 2.0
    wall_thickness: PositiveLength = 0.1
    seed: WholeNumber | None = None
