from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from bestman_bt.messages import Pose
from bestman_bt.runtime.robot_session import RobotSession
from tests.facts.scripted import ScriptedEnd
from tests.facts.staged import Staged, judged

PUT_AWAY = {
    "scene": "put_away",
    "goals": [
        {"placed": {"object": "cup", "at": "place", "source": "table", "surface": "drawer_chest/drawer_3"}},
        {"opened": {"articulation": "drawer_chest/drawer_3", "at_most": "2 cm"}},
    ],
    "predicate": ["inside", "opened"],
}
DRAWER = "drawer_chest/drawer_3"
IN_THE_MIDDLE = Pose(np.array([0.0, 0.0, 0.05]))


@pytest.fixture(scope="module")
def prepared() -> ScriptedEnd:
    """A chest that stands askew in the room."""
    return ScriptedEnd("put_away", "scene.furniture.drawer_chest.at=[1.4, 0.3, 115 deg]")


@pytest.fixture
def chest(prepared: ScriptedEnd) -> ScriptedEnd:
    prepared.truth.opened, prepared.truth.touched = {}, set()
    prepared.put("cup", prepared.surface(DRAWER) @ IN_THE_MIDDLE, "drawer_chest")
    return prepared


def opened_by(chest: ScriptedEnd, metres: float) -> Pose:
    """How the map sees what an open drawer has done to what is in it."""
    piece = next(piece for piece in chest.setup.world.furniture if piece.name == "drawer_chest")
    return Pose(-metres * piece.pose.rotation[:, 0])


def test_a_cup_in_the_closed_drawer_is_put_away_and_in_the_open_one_it_is_not(tmp_path: Path) -> None:
    """In physics, by both predicates of the task."""

    def in_the_drawer(session: RobotSession) -> Pose:
        chest = next(p for p in session.setup.world.furniture if p.name == "drawer_chest")
        surface = next(s for s in chest.model.all_surfaces if s.name == "drawer_3")
        return chest.pose @ surface.pose @ Pose(np.array([0.0, 0.0, 0.0501]))

    assert judged(tmp_path, PUT_AWAY, Staged(moved={"cup": in_the_drawer})).predicate is True


def test_a_cup_that_is_still_on_the_table_is_not(chest: ScriptedEnd) -> None:
    chest.put("cup", chest.surface("table/top") @ IN_THE_MIDDLE, "table")
    assert chest.verdict("inside").why == f"the cup is not inside {DRAWER}, not standing on the drawer_chest"


@pytest.mark.parametrize("opened", [0.0, 0.25])
def test_an_open_drawer_is_where_it_is_and_not_where_it_was(chest: ScriptedEnd, opened: float) -> None:
    chest.truth.opened[DRAWER] = 0.25
    moved = opened_by(chest, opened)
    chest.truth.poses["cup"] = Pose(chest.truth.poses["cup"].position + moved.position)
    assert chest.verdict("inside").holds is (opened == 0.25)


def test_in_a_drawer_a_cup_may_lie(chest: ScriptedEnd) -> None:
    lying = chest.truth.poses["cup"] @ Pose.from_xyz_rpy((0.0, 0.0, 0.0), (1.5, 0.0, 0.0))
    chest.truth.poses["cup"] = lying
    verdict = chest.verdict("inside")
    assert (verdict.holds, verdict.why) == (True, "")
    chest.truth.touched.add("cup")
    assert chest.verdict("inside").why == "the cup is not let go"


def test_a_cup_that_is_not_there_is_in_no_drawer(chest: ScriptedEnd) -> None:
    verdict = chest.verdict("inside", dataclasses.replace(chest.evidence(), before={}))
    assert (verdict.holds, verdict.why) == (False, "there is no cup in the scene")


@pytest.mark.parametrize("other", ["drawer_2", "top"])
def test_another_drawer_or_the_top_is_not_the_drawer(chest: ScriptedEnd, other: str) -> None:
    chest.put("cup", chest.surface(f"drawer_chest/{other}") @ IN_THE_MIDDLE, "drawer_chest")
    assert chest.verdict("inside").why == f"the cup is not inside {DRAWER}"
