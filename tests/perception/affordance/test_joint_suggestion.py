from __future__ import annotations

import numpy as np
import pytest

from bestman_bt.perception.affordance.front_handles import JointRules
from bestman_bt.perception.affordance.rectified import PanelBorders

RULES = JointRules()
SEEN = (np.array([-1.0, -1.0]), np.array([1.0, 1.0]))


@pytest.mark.parametrize(
    ("kind", "upright", "centre", "size", "joint", "hinge_side"),
    [
        ("bar", False, (0.0, 0.05), (0.80, 0.20), "prismatic", None),
        ("knob", False, (0.0, 0.00), (0.60, 0.18), "prismatic", None),
        ("edge", False, (0.0, 0.10), (0.60, 0.25), "prismatic", None),
        ("bar", True, (0.25, 0.1), (0.60, 1.20), "revolute", "left"),
        ("bar", True, (-0.25, 0.1), (0.60, 1.20), "revolute", "right"),
        ("knob", False, (-0.20, 0.2), (0.50, 0.70), "revolute", "right"),
        ("edge", True, (0.16, 0.0), (0.40, 0.80), "revolute", "left"),
        ("bar", False, (0.0, 0.31), (0.60, 0.70), "revolute", "bottom"),
        ("bar", False, (0.0, -0.31), (0.80, 0.70), "revolute", "top"),
    ],
)
def test_form_of_the_panel_and_place_of_the_handle_report_the_joint(
    kind: str, upright: bool, centre: tuple[float, float], size: tuple[float, float], joint: str, hinge_side: str | None
) -> None:
    borders = PanelBorders(-size[0] / 2, size[0] / 2, -size[1] / 2, size[1] / 2)
    suggested = RULES.suggest(kind, upright, np.array([*centre, 0.04]), borders, SEEN)  # type: ignore[arg-type] # one of its literals
    assert (suggested.joint, suggested.hinge_side) == (joint, hinge_side)
    assert suggested.confidence >= 0.7


def test_without_borders_the_suggestion_is_less_sure() -> None:
    known = PanelBorders(-0.3, 0.3, -0.6, 0.6)
    sure = RULES.suggest("bar", True, np.array([0.25, 0.0, 0.04]), known, SEEN)
    unsure = RULES.suggest("bar", True, np.array([0.25, 0.0, 0.04]), PanelBorders(), SEEN)
    assert unsure.joint == sure.joint
    assert unsure.confidence < sure.confidence


@pytest.mark.parametrize("side", ["left", "right", "bottom", "top"])
def test_a_positive_turn_about_the_hinge_moves_the_far_border_out_of_the_front(side: str) -> None:
    borders = PanelBorders(-0.2, 0.3, -0.4, 0.5)
    line = RULES.hinge_line(side, "bar", borders)  # type: ignore[arg-type] # one of its literals
    assert line is not None
    point, direction = line
    far = {"left": (0.3, 0.0), "right": (-0.2, 0.0), "bottom": (0.0, 0.5), "top": (0.0, -0.4)}[side]
    moved = np.cross(direction, np.array([*far, 0.0]) - point)
    assert moved[2] > 0.3


def test_a_hinge_on_a_border_that_was_not_seen_is_unknown() -> None:
    assert RULES.hinge_line("left", "bar", PanelBorders(right=0.3)) is None
