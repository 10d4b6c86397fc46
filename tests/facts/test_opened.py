from __future__ import annotations

import math
from pathlib import Path

import pytest

from tests.facts.scripted import ScriptedEnd
from tests.facts.staged import Staged, judged, why

DRAWER = {
    "scene": "chest_room",
    "predicate": "opened",
    "goals": [{"opened": {"articulation": "drawer_chest/drawer_3", "at_least": "20 cm"}}],
}


def test_a_drawer_that_nobody_touched_is_not_open(tmp_path: Path) -> None:
    result = judged(tmp_path, DRAWER, Staged())
    assert result.tree_status == "SUCCESS"
    assert not result.success
    assert why(result) == "the drawer_chest/drawer_3 is open by 0.0 mm, at least 200 mm are required"
    assert result.metrics == {"opening_mm": pytest.approx(0.0, abs=0.1)}


def test_another_drawer_does_not_count_and_an_open_one_may_be_asked_to_be_shut() -> None:
    end = ScriptedEnd("close_drawer")
    opening = end.setup.asked[0].asked
    other = "drawer_chest/drawer_1" if opening.articulation != "drawer_chest/drawer_1" else "drawer_chest/drawer_2"
    end.truth.opened = {other: 0.3}
    assert end.verdict("opened").holds
    end.truth.opened = {opening.articulation: 0.3}
    assert not end.verdict("opened").holds


@pytest.mark.parametrize(
    ("task", "asked", "unit", "metric"),
    [
        ("open_drawer", "[20 cm, 25 cm]", 1e-3, "opening_mm"),
        ("open_fridge", "[60 deg, 80 deg]", math.radians(1.0), "angle_deg"),
    ],
)
def test_an_opening_between_two_limits_is_held_to_both(task: str, asked: str, unit: float, metric: str) -> None:
    least, most = asked.strip("[]").split(", ")
    end = ScriptedEnd(task, f"goals.0.opened.at_least={least}", f"goals.0.opened.at_most={most}")
    opening = end.setup.asked[0].asked
    assert opening.at_least is not None
    assert opening.at_most is not None
    for position, words in (
        (opening.at_least - unit / 2, "at least"),
        (opening.at_least + unit / 2, ""),
        (opening.at_most - unit / 2, ""),
        (opening.at_most + unit / 2, "at most"),
    ):
        end.truth.opened = {opening.articulation: position}
        verdict = end.verdict("opened")
        assert verdict.holds is (words == "")
        assert words in verdict.why
        assert verdict.metrics == {metric: pytest.approx(position / unit)}
