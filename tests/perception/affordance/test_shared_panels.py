"""Handles beside or above each other have panels of their own, whatever was seen of the seams between them."""

from __future__ import annotations

import numpy as np

from bestman_bt.perception.affordance.front_handles import clipped_at_handles
from bestman_bt.perception.affordance.protrusions import HandleOnFront
from bestman_bt.perception.affordance.rectified import PanelBorders

WHOLE = PanelBorders(-0.4, 0.4, 0.0, 0.75)
"""A chest without visible seams."""


def bar(x: float, y: float) -> HandleOnFront:
    return HandleOnFront("bar", np.array([x, y, 0.04]), 0.0, 0.006, 0.2, 0.9, 0.002)


def test_the_panel_of_a_middle_drawer_ends_halfway_to_those_above_and_below() -> None:
    borders = clipped_at_handles(WHOLE, bar(0.0, 0.375), [bar(0.0, 0.625), bar(0.02, 0.125)])
    assert borders == PanelBorders(-0.4, 0.4, 0.25, 0.5)


def test_of_several_handles_on_one_side_the_nearest_counts_in_any_order() -> None:
    others = [bar(0.0, 0.375), bar(0.0, 0.625)]
    assert clipped_at_handles(WHOLE, bar(0.0, 0.125), others) == clipped_at_handles(
        WHOLE, bar(0.0, 0.125), others[::-1]
    )
    assert clipped_at_handles(WHOLE, bar(0.0, 0.125), others).top == 0.25


def test_doors_side_by_side_are_parted_between_their_handles() -> None:
    assert clipped_at_handles(WHOLE, bar(-0.05, 0.4), [bar(0.05, 0.42)]) == PanelBorders(-0.4, 0.0, 0.0, 0.75)


def test_a_border_that_was_seen_before_the_other_handle_stays() -> None:
    seen = PanelBorders(-0.4, 0.4, 0.0, 0.22)
    assert clipped_at_handles(seen, bar(0.0, 0.125), [bar(0.0, 0.375)]) == seen


def test_a_border_that_was_not_seen_is_halfway() -> None:
    assert clipped_at_handles(PanelBorders(), bar(0.0, 0.125), [bar(0.0, 0.375)]) == PanelBorders(top=0.25)


def test_handles_in_another_row_and_column_part_nothing() -> None:
    assert clipped_at_handles(WHOLE, bar(-0.2, 0.125), [bar(0.2, 0.5)]) == WHOLE
