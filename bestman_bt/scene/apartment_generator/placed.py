"""A piece of furniture where it shall stand."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from bestman_bt.messages import Pose2D
from bestman_bt.scene.plane_geometry import Points, rectangle
from bestman_bt.scene.scene import FurnitureModel


@dataclass(frozen=True)
class Placed:
    """``open``: how far its doors are open, radians by their names."""

    name: str
    model: FurnitureModel
    at: Pose2D
    open: Mapping[str, float] = field(default_factory=dict)

    @property
    def outline(self) -> Points:
        """Corners of the footprint, (4, 2)."""
        return rectangle(self.at, self.model.footprint)
