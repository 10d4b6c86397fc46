from __future__ import annotations

import math

import numpy as np
import pytest

from bestman_bt.perception.affordance.protrusions import HandleOnFront
from bestman_bt.perception.affordance.rectified import PanelBorders

PANEL = PanelBorders(-0.4, 0.4, -0.1, 0.1)


def bar(x: float, length: float, angle: float = 0.0, end_hidden: bool = True) -> HandleOnFront:
    return HandleOnFront("bar", np.array([x, 0.0, 0.04]), angle, 0.006, length, 0.9, 0.003, end_hidden=end_hidden)


def test_a_level_bar_with_a_hidden_end_is_supplemented_about_the_middle_of_its_panel() -> None:
    whole = bar(-0.05, 0.2).completed(PANEL, 0.015)
    assert whole.centre[0] == pytest.approx(0.0)
    assert whole.length == pytest.approx(0.3)
    assert whole.position_std == 0.015


@pytest.mark.parametrize("x", [-0.05, 0.05])
def test_a_bar_that_leans_is_supplemented_along_its_own_axis(x: float) -> None:
    whole = bar(x, 0.2, angle=0.2).completed(PANEL, 0.015)
    assert whole.centre.tolist() == pytest.approx([0.0, -x * math.tan(0.2), 0.04])


@pytest.mark.parametrize(
    "seen",
    [bar(-0.05, 0.2, end_hidden=False), bar(-0.05, 0.2, angle=math.pi / 2), bar(0.35, 0.1)],
    ids=["whole", "upright", "too far from the middle"],
)
def test_other_bars_stay_as_they_were_seen(seen: HandleOnFront) -> None:
    assert seen.completed(PANEL, 0.015) is seen


def test_without_the_borders_nothing_is_supplemented() -> None:
    seen = bar(-0.05, 0.2)
    assert seen.completed(PanelBorders(left=-0.4), 0.015) is seen


def test_the_rectangle_of_an_upright_bar_is_high_and_narrow() -> None:
    low, high = bar(0.1, 0.2, angle=math.pi / 2).rectangle
    np.testing.assert_allclose(high - low, [0.012, 0.2], atol=1e-9)


def edge(x: float, length: float, end_hidden: bool = False) -> HandleOnFront:
    return HandleOnFront("edge", np.array([x, 0.08, -0.01]), 0.0, 0.008, length, 0.9, 0.004, end_hidden=end_hidden)


def test_an_edge_that_comes_near_the_borders_of_its_panel_goes_up_to_them() -> None:
    whole = edge(0.01, 0.72).completed(PANEL, 0.015)
    assert whole.centre[0] == pytest.approx(0.0)
    assert whole.length == pytest.approx(0.8)


def test_an_edge_from_a_border_to_what_hides_it_goes_along_the_whole_panel() -> None:
    whole = edge(-0.17, 0.4, end_hidden=True).completed(PANEL, 0.015)
    assert whole.centre[0] == pytest.approx(0.0)
    assert whole.length == pytest.approx(0.8)


def test_an_edge_amid_its_panel_stays_as_it_was_seen() -> None:
    seen = edge(0.0, 0.2)
    assert seen.completed(PANEL, 0.015) is seen
