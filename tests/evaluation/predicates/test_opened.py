from __future__ import annotations

import math
from pathlib import Path

import pytest

from tests.evaluation.predicates.staged import Staged, judged, why

DRAWER = {
    "scene": "chest_room",
    "predicate": "opened",
    "opening": {"articulation": "drawer_chest/drawer_3", "at_least": "20 cm"},
}
FRIDGE = {
    "scene": "fridge_room",
    "predicate": "opened",
    "opening": {"articulation": "fridge/upper_door", "at_least": "80 deg"},
}


def test_a_drawer_that_nobody_touched_is_not_open(tmp_path: Path) -> None:
    result = judged(tmp_path, DRAWER, Staged())
    assert result.tree_status == "SUCCESS"
    assert not result.success
    assert why(result) == "the drawer_chest/drawer_3 is open by 0.0 mm, at least 200 mm are asked"
    assert result.metrics == {"opening_mm": pytest.approx(0.0, abs=0.1)}


@pytest.mark.parametrize(("position", "holds"), [(0.19, False), (0.21, True)])
def test_twenty_centimetres_are_enough(tmp_path: Path, position: float, holds: bool) -> None:
    result = judged(tmp_path, DRAWER, Staged(opened={"drawer_chest/drawer_3": position}))
    assert result.predicate is holds
    assert result.metrics["opening_mm"] == pytest.approx(1e3 * position, abs=1.0)


def test_another_drawer_does_not_count(tmp_path: Path) -> None:
    assert judged(tmp_path, DRAWER, Staged(opened={"drawer_chest/drawer_2": 0.3})).predicate is False


@pytest.mark.parametrize(("degrees", "holds"), [(78.0, False), (82.0, True)])
def test_doors_are_judged_in_degrees(tmp_path: Path, degrees: float, holds: bool) -> None:
    result = judged(tmp_path, FRIDGE, Staged(opened={"fridge/upper_door": math.radians(degrees)}))
    assert result.predicate is holds
    assert result.metrics["angle_deg"] == pytest.approx(degrees, abs=0.5)


@pytest.mark.parametrize(("position", "holds"), [(0.0, True), (0.05, False)])
def test_closed_is_asked_as_at_most(tmp_path: Path, position: float, holds: bool) -> None:
    closed = {**DRAWER, "opening": {"articulation": "drawer_chest/drawer_3", "at_most": "2 cm"}}
    result = judged(tmp_path, closed, Staged(opened={"drawer_chest/drawer_3": position}))
    assert result.predicate is holds
