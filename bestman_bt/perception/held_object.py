"""Detection of an object between the fingers by a camera that sees them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bestman_bt.messages import Pose
from bestman_bt.perception.view import View
from bestman_bt.robot_model.model import GripperModel

ROWS = 4
"""Number of samples along each side of the sampled sections of the gap."""


@dataclass(frozen=True)
class GapObservation:
    """Depth measurements in the gap between the fingers, as fractions of the samples in it.

    ``filled``: an object is measured in the gap. ``empty``: the camera measures the background through it. ``unseen``:
    the rest.
    """

    filled: float
    empty: float

    @property
    def unseen(self) -> float:
        """The fraction of samples that were hidden or had no depth."""
        return 1.0 - self.filled - self.empty


def observe_finger_gap(
    view: View, frame_from_tool: Pose, gripper: GripperModel, width: float, margin: float = 0.006
) -> GapObservation:
    """Compare measured depth with the gap between the pads, ``width`` metres wide.

    ``view``: including the robot's own body; ``frame_from_tool``: z points out of the hand, y is the closing direction.
    Rays through samples of the gap are evaluated: a measurement within the gap (enlarged by ``margin`` metres along the
    ray) means filled, behind it empty, in front of it hidden.
    """
    across, along = gripper.part.pad_size
    half = np.array([across / 2, max(width / 2 - margin, 0.001), along / 2])
    steps = np.linspace(-1.0, 1.0, ROWS)
    samples = np.array([[x, y, z] for x in steps for y in steps for z in steps]) * half
    points = frame_from_tool.apply(samples)
    pixels, depth = view.project(points)
    measured = view.measured_depth(pixels)
    # A ray may cross the whole gap, and an object reaches beyond the pads.
    reach = margin + 2.0 * float(half.max())
    seen = np.isfinite(measured) & np.isfinite(depth)
    filled = seen & (np.abs(measured - depth) <= reach)
    empty = seen & (measured > depth + reach)
    return GapObservation(float(filled.mean()), float(empty.mean()))
