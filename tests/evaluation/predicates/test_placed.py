from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from bestman_bt.configuration import load_run
from bestman_bt.messages import Pose
from bestman_bt.runtime import Session, prepare
from tests.evaluation.predicates.staged import NOTHING, Staged, judged, why

SET_TABLE = {
    "scene": "set_table",
    "goals": [
        {"name": f"place_{name}", "object": name, "source": "counter", "surface": "table"}
        for name in ("plate", "mug", "fork")
    ],
    "predicate": "placed",
    "tolerances": {"position": "2 cm", "yaw": "10 deg"},
}
IN_DRAWER = {
    "scene": "put_away",
    "goal": {"name": "place", "object": "cup", "source": "table", "surface": "drawer_chest/drawer_3"},
    "predicate": "placed",
}


def laid(**off: tuple[float, float]) -> Staged:
    """Everything at its goal, but for what is off by (metres, radians)."""

    def at_goal(name: str) -> Callable[[Session], Pose]:
        metres, turn = off.get(name, (0.0, 0.0))

        def where(session: Session) -> Pose:
            goal = next(goal for goal in session.setup.goals if goal.object == name)
            return Pose(np.array([0.0, metres, 1e-4])) @ goal.pose @ Pose.from_xyz_rpy((0, 0, 0), (0, 0, turn))

        return where

    return Staged(moved={name: at_goal(name) for name in ("plate", "mug", "fork")})


def test_a_laid_table_is_a_success_and_each_things_error_is_told(tmp_path: Path) -> None:
    result = judged(tmp_path, SET_TABLE, laid(plate=(0.012, 0.0), fork=(0.0, math.pi)))
    assert result.predicate is True
    assert result.metrics["place_error_mm_plate"] == pytest.approx(12.0, abs=0.5)
    assert result.metrics["place_error_mm"] == result.metrics["place_error_mm_plate"]
    assert result.metrics["yaw_error_deg_fork"] == pytest.approx(0.0, abs=0.5)
    assert "yaw_error_deg_plate" not in result.metrics


@pytest.mark.parametrize(
    ("off", "message"),
    [
        ({"mug": (0.025, 0.0)}, "the mug is 25 mm from the goal"),
        ({"fork": (0.0, math.radians(20))}, "the fork is turned by 20°"),
        ({"mug": (0.0, math.pi)}, "the mug is turned by 180°"),
    ],
)
def test_one_thing_that_is_off_spoils_it(tmp_path: Path, off: dict, message: str) -> None:
    assert why(judged(tmp_path, SET_TABLE, laid(**off))) == message


def test_a_table_that_nobody_laid_is_none(tmp_path: Path) -> None:
    told = why(judged(tmp_path, SET_TABLE, Staged()))
    assert told.count("not standing on the table") == 3


@pytest.mark.parametrize(("left_behind", "holds"), [(0.0, True), (0.03, False)])
def test_a_goal_in_a_drawer_goes_with_the_drawer(tmp_path: Path, left_behind: float, holds: bool) -> None:
    def where(session: Session) -> Pose:
        chest = next(p for p in session.setup.world.furniture if p.name == "drawer_chest")
        along = chest.pose.rotation @ np.array([-0.25 + left_behind, 0.0, 0.0])
        return Pose(session.setup.goals[0].pose.position + along + np.array([0.0, 0.0, 1e-4]))

    result = judged(tmp_path, IN_DRAWER, Staged({"drawer_chest/drawer_3": 0.25}, {"cup": where}))
    assert result.predicate is holds
    assert result.metrics["place_error_mm"] == pytest.approx(1e3 * left_behind, abs=0.6)


def test_of_several_objects_the_seed_chooses_one_that_is_there(tmp_path: Path) -> None:
    (tmp_path / "nothing.xml").write_text(NOTHING)
    goal = "{name: place, object: [cup, can, box, soup_can], source: table, surface: table}"
    (tmp_path / "task.yaml").write_text(
        f"tree: {tmp_path}/nothing.xml\nrobot: diff_panda\nscene: pick_place_table\ngoal: {goal}\npredicate: placed\n"
    )
    chosen = []
    for seed in range(12):
        setup = prepare(load_run(tmp_path / "task.yaml", seed=seed))
        (goal_of_seed,) = setup.goals
        chosen.append(goal_of_seed.object)
        assert goal_of_seed.object in {thing.name for thing in setup.world.objects}
        model = setup.world_model.models[goal_of_seed.object]
        assert goal_of_seed.pose.position[2] == pytest.approx(0.75 + float(model.size[2]) / 2)
        again = prepare(load_run(tmp_path / "task.yaml", seed=seed)).goals[0]
        assert again.object == goal_of_seed.object
    assert len(set(chosen)) >= 3
