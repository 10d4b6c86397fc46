"""Handles of doors and drawers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages.frozen_array import frozen_array
from bestman_bt.messages.pose import Pose

HandleKind = Literal["bar", "knob", "edge"]
JointKind = Literal["revolute", "prismatic"]
HingeSide = Literal["left", "right", "top", "bottom"]


@dataclass(frozen=True, eq=False)
class Handle:
    """A handle of a door or drawer, and its probable motion.

    ``pose``: frame_from_handle; origin in the middle of the gripped part, z out of the front, x along the bar or edge
    (horizontal for a knob). ``radius``: metres, of bar or knob; for an edge, half its thickness. ``length``: metres
    along x. ``standoff``: metres from the front panel to the origin, along z.
    ``panel``: frame_from_panel, the middle of the handle's front panel, z as for the handle and x horizontal;
    ``panel_size``: (horizontal, vertical) metres, or None if its borders were not seen.
    ``joint``: the probable kind of joint, with ``joint_confidence`` from 0.5 (a guess) to 1. ``hinge_side``: seen from
    the front, for a revolute joint. ``hinge``: a point (3,) on its axis, and ``hinge_direction``: (3,) unit, or None if
    unknown.
    ``opening_direction``: (3,) unit, the initial direction of the handle's motion. ``confidence``: 0 to 1 that it is a
    handle. ``position_std``: metres.
    """

    kind: HandleKind
    pose: Pose
    radius: float
    length: float
    standoff: float
    opening_direction: NDArray[np.float64]
    confidence: float
    position_std: float
    joint: JointKind | None = None
    joint_confidence: float = 0.5
    hinge_side: HingeSide | None = None
    hinge: NDArray[np.float64] | None = None
    hinge_direction: NDArray[np.float64] | None = None
    panel: Pose | None = None
    panel_size: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        for name in ("opening_direction", "hinge", "hinge_direction"):
            value = getattr(self, name)
            if value is not None:
                object.__setattr__(self, name, frozen_array(value, (3,), f"Handle {name}"))

    @property
    def axis(self) -> NDArray[np.float64]:
        """Unit direction (3,) along the bar or the edge."""
        return self.pose.rotation[:, 0]

    @property
    def outward(self) -> NDArray[np.float64]:
        """Unit normal (3,) of the front, pointing out of the furniture."""
        return self.pose.rotation[:, 2]

    def seen_from(self, other_from_frame: Pose) -> Handle:
        """Return the same handle, expressed in another frame."""
        turn = other_from_frame.rotation
        return Handle(
            self.kind,
            other_from_frame @ self.pose,
            self.radius,
            self.length,
            self.standoff,
            turn @ self.opening_direction,
            self.confidence,
            self.position_std,
            self.joint,
            self.joint_confidence,
            self.hinge_side,
            None if self.hinge is None else other_from_frame.apply(self.hinge[None])[0],
            None if self.hinge_direction is None else turn @ self.hinge_direction,
            None if self.panel is None else other_from_frame @ self.panel,
            self.panel_size,
        )
