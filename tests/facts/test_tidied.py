from __future__ import annotations

import dataclasses
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bestman_bt.facts.standing import surface_pose
from bestman_bt.messages import Pose
from bestman_bt.runtime.robot_session import RobotSession
from bestman_bt.scene.draw import draw_world
from bestman_bt.scene.load import load_scene
from tests.facts.scripted import ScriptedEnd
from tests.facts.staged import Staged, judged, why

NAMES = ("cup", "can", "box", "soup_can")
TIDY = {
    "scene": "untidy_table",
    "goals": [
        {
            "tidied": {
                "objects": list(NAMES),
                "source": "table",
                "surface": "counter/top",
                "x": ["-25 cm", "0 cm"],
                "y": ["-60 cm", "60 cm"],
            }
        }
    ],
    "predicate": "tidied",
}
SEED = 2


def on_counter(name: str, x: float, y: float) -> Callable[[RobotSession], Pose]:
    def where(session: RobotSession) -> Pose:
        height = float(session.setup.world_model.models[name].size[2])
        counter = next(p for p in session.setup.world.furniture if p.name == "counter")
        return counter.pose @ counter.model.surfaces[0].pose @ Pose(np.array([x, y, height / 2 + 1e-4]))

    return where


def brought(*names: str, x: float = -0.12) -> Staged:
    return Staged(moved={name: on_counter(name, x, -0.4 + 0.25 * NAMES.index(name)) for name in names})


@pytest.fixture(scope="module")
def present() -> tuple[str, ...]:
    return tuple(thing.name for thing in draw_world(load_scene("untidy_table"), SEED).objects)


def test_all_things_in_the_region_are_tidy(tmp_path: Path, present: tuple[str, ...]) -> None:
    result = judged(tmp_path, TIDY, brought(*present), SEED)
    assert result.failure is None or result.failure.node == "audit", result.failure
    assert result.predicate is True
    assert result.metrics == {"outside_mm": 0.0, "tidied_share": 1.0}


def test_one_that_was_left_on_the_table_is_named(tmp_path: Path, present: tuple[str, ...]) -> None:
    result = judged(tmp_path, TIDY, brought(*(name for name in present if name != "cup")), SEED)
    assert why(result).startswith("the cup is ")
    assert "not standing on the counter" in why(result)
    assert result.metrics["tidied_share"] == pytest.approx(1 - 1 / len(present), abs=1e-3)


@pytest.fixture(scope="module")
def counter() -> ScriptedEnd:
    """A task whose region lies askew in the room: x -25 to 0 cm and y -60 to 60 cm of the counter's top."""
    return ScriptedEnd("tidy_table", "goals.0.tidied.x=[-25 cm, -5 cm]", "goals.0.tidied.y=[-60 cm, 40 cm]")


def stand(end: ScriptedEnd, name: str, x: float, y: float, z: float = 0.05) -> None:
    end.put(name, end.surface("counter/top") @ Pose(np.array([x, y, z])), "counter")


@pytest.mark.parametrize(
    ("x", "y", "outside"),
    [
        (-0.249, -0.599, 0.0),
        (-0.051, 0.399, 0.0),
        (-0.251, 0.0, 1.0),
        (-0.049, 0.0, 1.0),
        (-0.1, 0.401, 1.0),
        (-0.1, -0.601, 1.0),
        (-0.02, 0.44, 50.0),
    ],
)
def test_a_thing_is_tidy_just_within_every_side_of_the_region_and_untidy_just_outside(
    counter: ScriptedEnd, x: float, y: float, outside: float
) -> None:
    names = list(counter.truth.poses)
    for name in names[1:]:
        stand(counter, name, -0.1, 0.2)
    stand(counter, names[0], x, y)
    verdict = counter.verdict("tidied")
    assert verdict.holds is (outside == 0.0)
    assert verdict.metrics["outside_mm"] == pytest.approx(outside, abs=1e-6)
    assert verdict.metrics["tidied_share"] == pytest.approx(1.0 if outside == 0.0 else 1 - 1 / len(names))


def test_the_worst_of_several_things_is_reported_and_all_that_are_wrong_are_named(counter: ScriptedEnd) -> None:
    first, second, third = counter.truth.poses
    stand(counter, first, -0.1, 0.5)
    stand(counter, second, -0.1, 0.45)
    stand(counter, third, -0.1, 0.0)
    verdict = counter.verdict("tidied")
    assert verdict.metrics == {"outside_mm": pytest.approx(100.0), "tidied_share": pytest.approx(1 / 3)}
    assert verdict.why == (f"the {first} is 100 mm outside the region; the {second} is 50 mm outside the region")
    stand(counter, first, -0.1, 0.0, z=-0.05)
    stand(counter, second, -0.1, 0.1)
    counter.truth.touched.add(second)
    try:
        assert counter.verdict("tidied").why == f"the {first} is not above counter/top; the {second} is not let go"
    finally:
        counter.truth.touched.clear()


@pytest.mark.parametrize(("z", "tidy"), [(0.299, True), (0.301, False)])
def test_what_stands_on_the_next_board_above_is_not_tidy(
    counter: ScriptedEnd, monkeypatch: pytest.MonkeyPatch, z: float, tidy: bool
) -> None:
    def under_a_board(*asked: Any) -> tuple[Any, ...]:
        return (*surface_pose(*asked)[:3], 0.3)

    monkeypatch.setattr("bestman_bt.facts.goals.tidied.surface_pose", under_a_board)
    for name in counter.truth.poses:
        stand(counter, name, -0.1, 0.2, z)
    assert counter.verdict("tidied").holds is tidy


def test_where_none_of_the_things_is_there_nothing_is_tidy(counter: ScriptedEnd) -> None:
    nothing = dataclasses.replace(counter.evidence(), before={})
    assert counter.verdict("tidied", nothing).why == "none of cup, can, box, soup_can is in the scene"
