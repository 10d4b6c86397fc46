from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from bestman_bt.configuration.run import load_run
from bestman_bt.facts.goals.placed import Placed
from bestman_bt.messages import Pose
from bestman_bt.runtime.resolved_config import prepare
from bestman_bt.runtime.robot_session import RobotSession
from tests.facts.scripted import ScriptedEnd, shifted, turned
from tests.facts.staged import NOTHING, Staged, judged

SET_TABLE = {
    "scene": "set_table",
    "goals": [
        {"placed": {"at": f"place_{name}", "object": name, "source": "counter", "surface": "table"}}
        for name in ("plate", "mug", "fork")
    ],
    "predicate": "placed",
    "tolerances": {"position": "2 cm", "yaw": "10 deg"},
}


def laid(**off: tuple[float, float]) -> Staged:
    """Everything at its goal, but for what is off by (metres, radians)."""

    def at_goal(name: str) -> Callable[[RobotSession], Pose]:
        metres, turn = off.get(name, (0.0, 0.0))

        def where(session: RobotSession) -> Pose:
            goal = next(goal for goal in session.setup.goals if goal.object == name)
            return Pose(np.array([0.0, metres, 1e-4])) @ goal.pose @ Pose.from_xyz_rpy((0, 0, 0), (0, 0, turn))

        return where

    return Staged(moved={name: at_goal(name) for name in ("plate", "mug", "fork")})


@pytest.mark.slow
def test_a_laid_table_is_a_success_and_each_things_error_is_reported(tmp_path: Path) -> None:
    result = judged(tmp_path, SET_TABLE, laid(plate=(0.012, 0.0), fork=(0.0, math.pi)))
    assert result.predicate is True
    assert result.metrics["place_error_mm_plate"] == pytest.approx(12.0, abs=0.5)
    assert result.metrics["place_error_mm"] == result.metrics["place_error_mm_plate"]
    assert result.metrics["yaw_error_deg_fork"] == pytest.approx(0.0, abs=0.5)
    assert "yaw_error_deg_plate" not in result.metrics


def test_of_several_objects_the_seed_chooses_one_that_is_there(tmp_path: Path) -> None:
    (tmp_path / "nothing.xml").write_text(NOTHING)
    goal = "{object: [cup, can, box, soup_can], at: place, source: table, surface: table}"
    (tmp_path / "task.yaml").write_text(
        f"tree: {tmp_path}/nothing.xml\nrobot: diff_panda\nscene: pick_place_table\n"
        f"goals: [{{placed: {goal}}}]\npredicate: placed\n"
    )
    chosen = []
    for seed in range(8):
        setup = prepare(load_run(tmp_path / "task.yaml", seed=seed))
        (goal_of_seed,) = setup.goals
        chosen.append(goal_of_seed.object)
        assert goal_of_seed.object in {thing.name for thing in setup.world.objects}
        model = setup.world_model.models[goal_of_seed.object]
        assert goal_of_seed.pose.position[2] == pytest.approx(0.75 + float(model.size[2]) / 2)
    again = prepare(load_run(tmp_path / "task.yaml", seed=7)).goals[0]
    assert again.object == chosen[7]
    assert len(set(chosen)) >= 3


@pytest.fixture(scope="module")
def prepared() -> ScriptedEnd:
    return ScriptedEnd("set_table")


@pytest.fixture
def laid_table(prepared: ScriptedEnd) -> ScriptedEnd:
    """Each thing exactly at its goal."""
    for goal in prepared.setup.goals:
        prepared.put(goal.object, goal.pose, "table")
    prepared.truth.touched.clear()
    return prepared


def off(end: ScriptedEnd, name: str, change: Callable[[Pose], Pose]) -> tuple[str, dict[str, float]]:
    """What the judge says with one thing changed, and what it measures."""
    end.truth.poses[name] = change(end.truth.poses[name])
    verdict = end.verdict("placed")
    assert verdict.holds is (verdict.why == "")
    return verdict.why, verdict.metrics


@pytest.mark.parametrize("name", ["plate", "mug", "fork"])
@pytest.mark.parametrize("direction", [0.0, 2.5, -1.0])
def test_the_tolerance_of_position_is_that_of_the_task(laid_table: ScriptedEnd, name: str, direction: float) -> None:
    for distance, words in ((0.0198, ""), (0.0202 - 0.0198, f"the {name} is 20 mm from the goal")):
        way = distance * np.array([math.cos(direction), math.sin(direction)])
        told, metrics = off(laid_table, name, lambda pose, way=way: shifted(pose, float(way[0]), float(way[1])))
        assert told == words
    assert metrics[f"place_error_mm_{name}"] == pytest.approx(20.2)
    assert metrics["place_error_mm"] == pytest.approx(20.2), "the largest of all"
    assert min(metrics[f"place_error_mm_{other}"] for other in ("plate", "mug", "fork")) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("sign", [-1.0, 1.0])
@pytest.mark.parametrize(("degrees", "fork", "mug"), [(9.9, True, True), (10.1, False, False), (175.0, True, False)])
def test_the_turn_is_measured_to_the_nearest_pose_that_looks_the_same(
    laid_table: ScriptedEnd, sign: float, degrees: float, fork: bool, mug: bool
) -> None:
    for name, holds, order in (("fork", fork, 2), ("mug", mug, 1)):
        stood = laid_table.truth.poses[name]
        told, metrics = off(laid_table, name, lambda pose: turned(pose, sign * math.radians(degrees)))
        error = min(degrees % (360 / order), 360 / order - degrees % (360 / order))
        assert metrics[f"yaw_error_deg_{name}"] == pytest.approx(error)
        assert (told == "") is holds
        laid_table.truth.poses[name] = stood
    assert off(laid_table, "plate", lambda pose: turned(pose, 1.0))[0] == "", "a plate is the same from all sides"


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_the_turn_is_the_one_from_the_heading_that_is_asked(sign: float) -> None:
    asked = Pose.from_xyz_rpy((1.0, 2.0, 0.7), (0.0, 0.0, 3.0))
    for order, degrees, error in ((1, 25.0, 25.0), (2, 175.0, 5.0), (4, 50.0, 40.0)):
        off = Placed.errors(turned(asked, sign * math.radians(degrees)), asked, order)["yaw_error_deg"]
        assert off == pytest.approx(error)


def test_a_thing_that_is_held_or_tilted_or_gone_is_not_placed_and_the_others_do_not_make_up_for_it(
    laid_table: ScriptedEnd,
) -> None:
    laid_table.truth.touched.add("mug")
    assert laid_table.verdict("placed").why == "the mug is not let go"
    laid_table.truth.touched.clear()
    laid_table.truth.on["fork"] = ("counter", "plate")
    assert laid_table.verdict("placed").why == "the fork is not standing on the table"
    laid_table.truth.on["fork"] = ("table", "plate")
    tilted = Pose.from_xyz_rpy((0.0, 0.0, 0.0), (math.radians(11), 0.0, 0.0))
    told, metrics = off(laid_table, "plate", lambda pose: pose @ tilted)
    assert told == "the plate is tilted by 11°"
    assert metrics["tilt_deg"] == pytest.approx(11.0)
    stood = laid_table.truth.poses.pop("plate")
    assert laid_table.verdict("placed").why == "there is no plate in the scene"
    laid_table.truth.poses["plate"] = stood


@pytest.mark.parametrize("error", [0.0, 0.03])
def test_in_an_open_drawer_of_a_chest_that_stands_askew_the_goal_has_gone_with_the_drawer(error: float) -> None:
    end = ScriptedEnd("put_away", "scene.furniture.drawer_chest.at=[1.4, 0.3, 115 deg]")
    (goal,) = end.setup.goals
    end.truth.opened["drawer_chest/drawer_3"] = 0.2
    piece = next(piece for piece in end.setup.world.furniture if piece.name == "drawer_chest")
    out = -piece.pose.rotation[:, 0]
    end.put("cup", Pose(goal.pose.position + (0.2 - error) * out, goal.pose.quaternion), "drawer_chest")
    verdict = end.verdict("placed")
    assert verdict.metrics["place_error_mm"] == pytest.approx(1e3 * error, abs=1e-6)
    assert set(verdict.metrics) <= set(Placed.measures["placed"])  # of a single goal none has the object's name
    assert verdict.holds is (error == 0.0)
