"""Does the wrist camera tell a full hand from an empty one?"""

from __future__ import annotations

import math

import numpy as np
import pytest

from benchmarks.rendering import Color, render_view
from bestman_bt.messages import Box, Cylinder, PlacedShape, Pose
from bestman_bt.perception.held_object import observe_finger_gap
from bestman_bt.perception.view import View
from tests.robot_models import gripper_model, with_part

GRIPPER = gripper_model(finger_depth=0.1)
GREY: Color = (0.5, 0.5, 0.5)
TOOL = Pose.from_xyz_rpy((0.6, 0.0, 0.9), (math.pi, 0.0, 0.0))
HAND_FROM_CAMERA = Pose.from_xyz_rpy((0.06, 0.0, -0.12), (0.0, -math.radians(26), 0.0)) @ Pose.from_xyz_rpy(
    (0.0, 0.0, 0.0), (0.0, 0.0, math.pi / 2)
)


def hand_view(width: float, held: PlacedShape | None, seed: int = 0) -> View:
    """Fingers ``width`` apart over a table, seen by a camera on the hand; ``held``: in the tool frame."""
    parts: list[tuple[PlacedShape, Color]] = [
        (PlacedShape(Box((1.0, 1.0, 0.04)), Pose.from_xyz_rpy((0.6, 0.0, 0.6))), (0.7, 0.6, 0.4))
    ]
    for side in (-1.0, 1.0):
        finger = Pose.from_xyz_rpy((0.0, side * (width / 2 + 0.008), -0.03))
        parts.append((PlacedShape(Box((0.02, 0.016, 0.08)), TOOL @ finger), GREY))
    if held is not None:
        parts.append((PlacedShape(held.shape, TOOL @ held.pose), (0.2, 0.4, 0.8)))
    return render_view(parts, TOOL @ HAND_FROM_CAMERA, np.random.default_rng(seed))


@pytest.mark.parametrize("seed", range(3))
def test_the_gap_of_an_empty_hand_is_looked_through(seed) -> None:
    gap = observe_finger_gap(hand_view(0.06, None, seed), TOOL, GRIPPER, 0.06)
    assert gap.empty > 0.8
    assert gap.filled < 0.1


@pytest.mark.parametrize(
    "held",
    [
        PlacedShape(Cylinder(0.03, 0.1), Pose.from_xyz_rpy((0.0, 0.0, 0.02))),
        PlacedShape(Box((0.06, 0.06, 0.06)), Pose.from_xyz_rpy((0.0, 0.0, 0.015))),
    ],
)
def test_the_gap_of_a_full_hand_is_filled(held) -> None:
    gap = observe_finger_gap(hand_view(0.06, held), TOOL, GRIPPER, 0.06)
    assert gap.filled > 0.8
    assert gap.empty < 0.05


def test_a_picture_without_depth_says_nothing() -> None:
    view = hand_view(0.06, None)
    blind = View(type(view.image)(view.image.rgb, np.zeros_like(view.image.depth), view.image.intrinsics, 0.0), TOOL)
    gap = observe_finger_gap(blind, TOOL, GRIPPER, 0.06)
    assert (gap.filled, gap.empty, gap.unseen) == (0.0, 0.0, 1.0)


def test_long_and_narrow_pads_are_looked_at_along_their_length() -> None:
    pads = with_part(GRIPPER, pad_size=(0.006, 0.06))
    sheet = PlacedShape(Box((0.012, 0.058, 0.08)), Pose.from_xyz_rpy((0.0, 0.0, 0.0)))
    assert observe_finger_gap(hand_view(0.06, sheet), TOOL, pads, 0.06).filled > 0.9
