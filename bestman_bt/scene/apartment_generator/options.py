"""Options of generated apartments."""

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


@dataclass(frozen=True)
class ApartmentPiece:
    """A piece of furniture at its place. ``open``: openings of its doors, radians by name."""

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
    """Options; from each pair of limits, the seed draws a value in between.

    ``rooms``: number. ``area``: square metres within the outer walls; 14 to 24 per room. ``doorway``: clear width of
    the openings between rooms. ``loops``: probability of a redundant doorway. ``moved_chairs``: probability that a
    chair was moved by up to 60 cm each way since the map was made. ``doors``: probability that a doorway has a door;
    it is open, or half open (66° to 80°) with the probability ``half_open``. ``moved_doors``: probability that a
    door's opening has changed since the map was made. ``seed``: of the apartment; None: drawn from the world's seed.
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
