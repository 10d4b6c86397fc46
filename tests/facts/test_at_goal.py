from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bestman_bt.configuration.errors import ConfigurationError
from bestman_bt.configuration.run import load_run
from bestman_bt.evaluation.episode import prepare_episode, run_episode
from bestman_bt.facts.goals.at_goal import AtGoal, AtGoalFields, base_footprint, drive_goal, true_costmap
from bestman_bt.messages import Pose2D, wrap_angle
from bestman_bt.navigation.global_planning.costmap import Costmap
from bestman_bt.robot_model.compose import load_robot_model
from bestman_bt.runtime.resolved_config import ResolvedConfig, prepare
from bestman_bt.scene.draw import SceneError, draw_world
from bestman_bt.scene.load import load_scene
from bestman_bt.scene.map_of_world import semantic_map
from tests.facts.scripted import ScriptedEnd
from tests.facts.staged import Staged, judged, why

DRIVE = {"scene": "kitchen", "predicate": "at_goal", "goals": [{"at_goal": {"distance": "2 m"}}]}


@pytest.fixture(scope="module")
def setups() -> list[ResolvedConfig]:
    return [prepare(load_run("navigate_kitchen", seed=seed)) for seed in range(16)]


def goal_of(setup: ResolvedConfig) -> Pose2D:
    return next(goal.pose for goal in setup.asked if isinstance(goal, AtGoal))


def test_a_base_that_stayed_where_it_was_is_reported_by_how_much_it_is_off(tmp_path: Path) -> None:
    result = judged(tmp_path, DRIVE, Staged())
    assert result.metrics["final_error_mm"] > 2000
    assert "mm from the goal" in why(result)
    assert "path_ratio" not in result.metrics


@pytest.mark.parametrize("seed", [2, 5, 9])
@pytest.mark.parametrize("share", [0.99, 1.01])
@pytest.mark.parametrize("direction", [0.0, 2.0, -2.0])
def test_the_tolerance_of_position_is_that_of_the_task(seed: int, share: float, direction: float) -> None:
    end = ScriptedEnd("navigate_kitchen", seed=seed)
    goal, tolerance = goal_of(end.setup), end.setup.config.task.tolerances.position
    off = share * tolerance
    end.truth.base = Pose2D(goal.x + off * math.cos(direction), goal.y + off * math.sin(direction), goal.theta)
    verdict = end.verdict("at_goal")
    assert verdict.metrics["final_error_mm"] == pytest.approx(1e3 * off)
    assert verdict.metrics["final_yaw_deg"] == pytest.approx(0.0, abs=1e-9)
    assert verdict.holds is (share < 1.0)
    assert verdict.why == ("" if share < 1.0 else f"the base is {1e3 * off:.0f} mm from the goal")


@pytest.mark.parametrize("sign", [-1.0, 1.0])
@pytest.mark.parametrize("turns", [0, 1])
@pytest.mark.parametrize("share", [0.99, 1.01])
def test_the_tolerance_of_yaw_holds_both_ways_round(sign: float, turns: int, share: float) -> None:
    end = ScriptedEnd("navigate_kitchen", seed=2)
    goal, tolerance = goal_of(end.setup), end.setup.config.task.tolerances.yaw
    assert tolerance is not None
    off = share * tolerance
    end.truth.base = Pose2D(goal.x, goal.y, wrap_angle(goal.theta + sign * off) - turns * 2 * math.pi * sign)
    verdict = end.verdict("at_goal")
    assert verdict.metrics["final_yaw_deg"] == pytest.approx(math.degrees(off))
    assert verdict.holds is (share < 1.0)
    assert verdict.why == ("" if share < 1.0 else f"the base is turned away by {math.degrees(off):.1f}°")


def test_the_heading_is_asked_for_only_where_the_task_has_a_tolerance_of_yaw() -> None:
    end = ScriptedEnd("navigate_kitchen", "tolerances.yaw=null", seed=2)
    goal = goal_of(end.setup)
    end.truth.base = Pose2D(goal.x, goal.y, goal.theta + 3.0)
    verdict = end.verdict("at_goal")
    assert verdict.holds
    assert verdict.metrics["final_yaw_deg"] == pytest.approx(math.degrees(3.0))


def test_the_way_driven_is_reported_as_a_multiple_of_the_shortest_one() -> None:
    end = ScriptedEnd("navigate_kitchen", seed=2)
    goal, start = goal_of(end.setup), end.setup.world.robot_start
    end.truth.base = goal
    ratio = end.verdict("at_goal", driven=6.0).metrics["path_ratio"]
    assert end.verdict("at_goal", driven=3.0).metrics["path_ratio"] == pytest.approx(ratio / 2)
    assert goal.distance_to(start) <= 6.0 / ratio * (1 + 1e-9)
    assert 6.0 / ratio < 1.5 * goal.distance_to(start)


@pytest.mark.slow
def test_a_drive_is_measured_against_the_shortest_way(tmp_path: Path) -> None:
    result = run_episode(load_run("navigate_kitchen", seed=2))
    assert result.success
    assert result.metrics["final_error_mm"] < 20
    assert 0.9 < result.metrics["path_ratio"] < 1.2


@pytest.mark.slow
def test_half_of_the_goals_are_close_before_furniture_and_the_others_have_room(setups: list[ResolvedConfig]) -> None:
    close = 0
    for setup in setups:
        goal = goal_of(setup)
        believed = Costmap.from_map(setup.world_model.map, base_footprint(setup.robot_model))
        assert goal.distance_to(setup.world.robot_start) >= 1.0
        assert true_costmap(setup.world, setup.robot_model).clearance_at(goal) > 0.0
        assert believed.clearance_at(goal) > 0.0
        close += bool(believed.distance_at(goal.xy) < believed.footprint.circumscribed_radius)
    assert 4 <= close <= 12


@pytest.mark.slow
def test_the_seed_chooses_the_goal(setups: list[ResolvedConfig]) -> None:
    again = goal_of(prepare(load_run("navigate_kitchen", seed=3)))
    assert again == goal_of(setups[3])
    assert len({(goal_of(setup).x, goal_of(setup).y) for setup in setups}) == len(setups)


@pytest.mark.slow
def test_a_goal_that_cannot_be_drawn_is_reported_with_kind_and_reason(tmp_path: Path) -> None:
    scene = tmp_path / "hall.yaml"
    scene.write_text(
        "walls: {height: 2 m, thickness: 10 cm, lines: [[[-1, -2], [5, -2]], [[5, -2], [5, 2]], [[5, 2], [-1, 2]],\n"
        "  [[-1, 2], [-1, -2]], [[2.0, -2], [2.0, 2]]]}\n"
        "furniture: {table: {model: table, at: [3.0, 0, 0]}}\nrobot_start: {x: [0, 0], y: [0, 0]}\n"
    )
    words = {
        "goals.0.at_goal.at_furniture=1": r"none of 1000 poses drawn before furniture \(table\): [a-z].* less at_f",
        "goals.0.at_goal.at_furniture=0": r"none of 1000 poses drawn on open floor: .*no way from the start \(.*more",
    }
    for setting, expected in words.items():
        config = load_run(
            "navigate_kitchen", scene=str(scene), seed=0, settings=[setting, "goals.0.at_goal.distance=2.6"]
        )
        with pytest.raises(SceneError, match=expected):
            goal_of(prepare(config))
    scene.write_text(scene.read_text().replace("{table: {model: table, at: [3.0, 0, 0]}}", "{}"))
    with pytest.raises(SceneError, match="no furniture but passages"):
        goal_of(
            prepare(load_run("navigate_kitchen", scene=str(scene), seed=0, settings=["goals.0.at_goal.at_furniture=1"]))
        )


def test_the_truth_has_furniture_where_it_really_stands(setups: list[ResolvedConfig]) -> None:
    setup = setups[0]
    costmap = true_costmap(setup.world, setup.robot_model)
    table = next(piece for piece in setup.world.furniture if piece.name == "table")
    beyond = table.actual.apply(np.array([[-table.model.footprint[0] / 2 - 0.1, 0.0]]))[0]
    assert costmap.distance_at(beyond) == pytest.approx(0.1, abs=1e-3)


def test_a_task_without_a_drive_cannot_be_judged_by_at_goal() -> None:
    with pytest.raises(ConfigurationError, match="needs an entry {at_goal: …}"):
        prepare_episode(load_run("fetch_cup", settings=["predicate=at_goal"]))


def test_a_goal_for_the_base_and_one_for_an_object_are_too_many(tmp_path: Path) -> None:
    path = tmp_path / "task.yaml"
    path.write_text(
        "{tree: navigate, scene: kitchen, robot: diff_panda, goals: [{at_goal: {}},\n"
        " {placed: {at: place, object: cup, source: table, surface: counter}}]}"
    )
    with pytest.raises(
        ConfigurationError, match=r"yaml:2: goals\[1\].placed: goals\[0\].* both would fill the tree's entry 'goal'"
    ):
        prepare(load_run(path))


@pytest.mark.slow
def test_drawn_headings_go_all_around(setups: list[ResolvedConfig]) -> None:
    assert max(abs(goal_of(setup).theta) for setup in setups) <= math.pi
    assert min(goal_of(setup).theta for setup in setups) < -1.0 < 1.0 < max(goal_of(setup).theta for setup in setups)


def test_the_truth_has_handles_and_furniture_that_the_map_does_not_have() -> None:
    setup = prepare(load_run("navigate_kitchen", scene="kitchen_furnished", seed=0))
    chest = next(piece for piece in setup.world.furniture if piece.name == "drawer_chest")
    handle = chest.model.articulations[0].handle
    costmap = true_costmap(setup.world, setup.robot_model)
    assert costmap.distance_at((chest.pose @ handle.pose).position[:2]) < 0.02
    chair = next(p for p in prepare(load_run("fetch_cup_with_chairs", seed=0)).world.furniture if not p.mapped)
    world = prepare(load_run("fetch_cup_with_chairs", seed=0)).world
    assert true_costmap(world, setup.robot_model).distance_at(chair.actual.xy) < 0.0


def test_the_way_straight_out_from_before_furniture_is_free_by_the_map_too() -> None:
    robot, world = load_robot_model("diff_panda"), draw_world(load_scene("kitchen"), 0)
    known, asked = semantic_map(world), AtGoalFields(at_furniture=1.0, distance=0.0)
    goal = drive_goal(asked, world, known, robot, 1)
    post = (goal @ Pose2D(-0.3, -0.22, 0.0)).xy  # behind the base, and before where it has room to turn
    mapped = replace(known, walls=np.vstack([known.walls, [*post, *(post + 0.01)]]))
    assert Costmap.from_map(mapped, base_footprint(robot)).clearance_at(goal) > 0.0
    assert drive_goal(asked, world, mapped, robot, 1) != goal
