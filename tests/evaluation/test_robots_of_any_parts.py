"""Robots that are no mobile manipulators: a base with a lidar drives, an arm on a stand picks and places."""

from __future__ import annotations

import pytest

from bestman_bt.configuration import load_run
from bestman_bt.evaluation.episode import run_episode


def test_a_base_with_a_lidar_and_nothing_else_drives() -> None:
    result = run_episode(load_run("navigate_kitchen", robot="turtle", seed=31000))
    assert result.success
    assert result.metrics["final_error_mm"] < 20


@pytest.mark.slow
def test_an_arm_on_a_stand_moves_a_thing_on_its_table() -> None:
    result = run_episode(load_run("pick_bench", seed=32000))
    assert result.success
    assert result.metrics["place_error_mm"] < 20
