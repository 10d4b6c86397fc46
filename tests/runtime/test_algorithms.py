"""Algorithms of a configuration: every wrong parameter of every slot is told before anything starts."""

from __future__ import annotations

import inspect
from dataclasses import dataclass, field, fields, replace
from typing import Any

import pytest

from bestman_bt.configuration.checked import check
from bestman_bt.configuration.document import Document
from bestman_bt.configuration.errors import ConfigurationError
from bestman_bt.configuration.run import load_run
from bestman_bt.engine import load_tree
from bestman_bt.errors import InputError
from bestman_bt.manipulation.motion_planning.base import MotionPlanner
from bestman_bt.manipulation.motion_planning.ompl_planners import BIT_STAR, KPIECE
from bestman_bt.navigation.global_planning.polyline_planner import GridAStar
from bestman_bt.navigation.global_planning.theta_star import ThetaStar
from bestman_bt.navigation.local_planning.critics import CriticWeights
from bestman_bt.navigation.local_planning.dwa import DWA
from bestman_bt.navigation.localization.scan_to_map import ScanToMap
from bestman_bt.navigation.slam.pose_graph_slam import PoseGraphSlam
from bestman_bt.perception.detection.color_shape import ColorShape
from bestman_bt.perception.segmentation.plane_dbscan import PlaneDbscan
from bestman_bt.registry import ALGORITHMS, UnknownNameError, class_and_preset, undone
from bestman_bt.robot_model.compose import load_robot_model
from bestman_bt.runtime.algorithms import (
    SLOTS,
    Algorithms,
    algorithm_by_name,
    algorithms_by_slot,
    make_algorithm,
    nav2_problems,
    parameters_of,
)
from bestman_bt.runtime.plugins import node_registry
from bestman_bt.world_model.semantic_map import SemanticMap
from tests.behaviours.at_the_table import tree_of

WITHOUT_PARAMETERS = ("collision/coal_world", "localization/wheel_odometry")


def faults(*settings: str) -> list[str]:
    model = load_robot_model("diff_panda")
    with pytest.raises(ConfigurationError) as error:
        Algorithms(load_run("navigate_kitchen", settings=[f"algorithms.{s}" for s in settings]), model)
    return [f"{problem.field.removeprefix('algorithms.')}: {problem.message}" for problem in error.value.problems]


@pytest.mark.parametrize(
    ("settings", "fault"),
    [
        (["local_planning.max_speed=-1"], "local_planning.max_speed: should be greater than 0, got -1"),
        (["local_planning.max_speed=nan"], "local_planning.max_speed: should be a finite number, got 'nan'"),
        (["local_planning.max_speed=-.inf"], "local_planning.max_speed: should be a finite number, got -inf"),
        (["costmap.resolution=0"], "costmap.resolution: should be greater than 0, got 0"),
        (
            ["local_planning.algorithm=dwa", "local_planning.max_speed=0"],
            "local_planning.max_speed: should be greater than 0, got 0",
        ),
        (
            ["local_planning.algorithm=mppi", "local_planning.batch=0"],
            "local_planning.batch: should be greater than or equal to 2, got 0",
        ),
        (
            ["global_planning.algorithm=prm"],
            "global_planning.algorithm: 'prm' is a plug-in now: name it as 'examples/plugins/sampled_roads.py:PRM', "
            "a file of bestman-bt's sources",
        ),
        (
            ["local_planning.min_lookahead=0.5"],
            "local_planning.min_lookahead: min_lookahead (0.5) should not be larger than max_lookahead (0.4)",
        ),
        (
            ["motion_planning.max_iterations=0"],
            "motion_planning.max_iterations: should be greater than or equal to 1, got 0",
        ),
        (["motion_planning.wall_limit=0"], "motion_planning.wall_limit: should be greater than 0, got 0"),
        (
            ["motion_planning.algorithm=portfolio", "motion_planning.take=luck"],
            "motion_planning.take: should be 'first' or 'best', got 'luck'",
        ),
        (
            ["motion_planning.algorithm=portfolio", "motion_planning.planners=[kpiece, prm]"],
            "motion_planning.planners[1]: should be 'aorrtc', 'bit_star', 'kpiece', 'rrt_connect' or 'rrt_star', "
            "got 'prm'",
        ),
        (["kinematics.attempts=0"], "kinematics.attempts: should be greater than or equal to 1, got 0"),
        (["trajectory.rate=0"], "trajectory.rate: should be greater than 0, got 0"),
        (["local_planning.algorithm=3"], "local_planning.algorithm: should be the name of an algorithm, got 3"),
        (
            ["global_planning.algorithm=astar"],
            "global_planning.algorithm: unknown algorithm 'astar'; did you mean 'grid_astar'? "
            "(known: grid_astar, hybrid_astar, theta_star)",
        ),
    ],
)
def test_a_wrong_parameter_is_reported_with_what_is_right(settings: list[str], fault: str) -> None:
    assert faults(*settings) == [fault]


def test_parameters_beside_a_wrong_name_are_reported_if_no_algorithm_of_the_slot_has_them() -> None:
    unknown, key = faults(*(f"global_planning.{one}" for one in ("algorithm=astar", "turn_cost=2", "turn_kost=1")))
    assert "unknown algorithm 'astar'" in unknown
    assert key == "global_planning.turn_kost: no algorithm of this slot has it; did you mean 'turn_cost'?"


def test_an_algorithm_without_parameters_refuses_any() -> None:
    assert faults("collision.margin=0.1") == ["collision: coal_world takes no parameters, got margin"]


def test_a_planner_or_follower_that_a_tree_names_is_made_or_refused_with_the_closest() -> None:
    run = load_run("navigate_kitchen", settings=["algorithms.global_planning.turn_cost=7"])
    made = [algorithm_by_name(run, "global_planning", name) for name in ("grid_astar", "theta_star")]
    assert made == [GridAStar(turn_cost=7.0), ThetaStar()], "the configured one has what is configured"
    for slot in ("global_planning", "local_planning"):
        with pytest.raises(UnknownNameError, match="unknown algorithm 'astar'"):
            algorithm_by_name(run, slot, "astar")


def test_a_preset_sets_the_parameters_that_are_not_given() -> None:
    settings = ["algorithms.motion_planning.algorithm=kpiece", "algorithms.motion_planning.attempts=9"]
    assert make_algorithm(load_run("fetch_cup", settings=settings), "motion_planning") == replace(KPIECE, attempts=9)
    with undone(ALGORITHMS):
        ALGORITHMS.add("local_planning/slow", DWA(max_speed=0.2, critics=CriticWeights(path=9.0)))
        settings = ["algorithms.local_planning.algorithm=slow", "algorithms.local_planning.horizon=2"]
        slow = make_algorithm(load_run("fetch_cup", settings=settings), "local_planning")
    assert (type(slow), slow.max_speed, slow.critics.path, slow.horizon) == (DWA, 0.2, 9.0, 2.0)


def test_a_field_by_which_a_preset_differs_from_others_of_its_class_is_not_a_parameter() -> None:
    assert faults("motion_planning.algorithm=kpiece", "motion_planning.planner=bit_star") == [
        "motion_planning.planner: the algorithm 'kpiece' fixes it to 'kpiece'; "
        "set algorithms.motion_planning.algorithm instead"
    ]
    config = load_run("fetch_cup", settings=["algorithms.motion_planning.algorithm=bit_star"])
    assert make_algorithm(config, "motion_planning") == BIT_STAR


@dataclass
class Careful(DWA):
    critics: CriticWeights = field(default_factory=lambda: CriticWeights(path=9.0))


@pytest.mark.parametrize("registered", [DWA(critics=CriticWeights(path=9.0)), Careful])
def test_a_parameter_of_a_group_leaves_the_others_of_the_group_as_the_algorithm_has_them(registered: Any) -> None:
    with undone(ALGORITHMS):
        ALGORITHMS.add("local_planning/careful", registered)
        settings = ["algorithms.local_planning.algorithm=careful", "algorithms.local_planning.critics.goal=2"]
        careful = make_algorithm(load_run("fetch_cup", settings=settings), "local_planning")
    assert careful.critics == CriticWeights(path=9.0, goal=2.0)


def test_a_wrong_order_names_the_parameter_that_was_given_and_not_that_of_the_preset() -> None:
    with undone(ALGORITHMS):
        ALGORITHMS.add("slam/dense", PoseGraphSlam(min_hits=30))
        told = faults("slam.algorithm=dense", "slam.min_inlier_ratio=0.1")
    message = "least_inlier_ratio (0.2) should not be larger than min_inlier_ratio (0.1)"
    assert told == [f"slam.min_inlier_ratio: {message}"]


def test_a_preset_of_an_algorithm_that_uses_another_leaves_this_to_the_session() -> None:
    with undone(ALGORITHMS):
        ALGORITHMS.add("detection/few", ColorShape(segmentation=PlaneDbscan(), max_shape=2.5))
        run = load_run("fetch_cup", settings=["algorithms.detection.algorithm=few"])
        other = PlaneDbscan()
        few = make_algorithm(run, "detection", segmentation=other)
        assert (few.max_shape, few.segmentation is other) == (2.5, True)
        ALGORITHMS.add("detection/none", object())
        with pytest.raises(InputError, match="instance of a dataclass"):
            make_algorithm(run, "detection", segmentation=other)


@dataclass
class Labelled(MotionPlanner):
    label: str

    def plan(self, start, goals, world, limits, rng, constraint=None):
        """Nothing is planned here: it is made, and looked at."""


def test_a_preset_keeps_what_it_fixes_and_leaves_to_the_session_what_that_fills() -> None:
    def made(slot: str, *needs: Any) -> Any:
        return make_algorithm(
            load_run("navigate_kitchen", settings=[f"algorithms.{slot}.algorithm=mine"]), slot, *needs
        )

    empty, room = SemanticMap([], {}), SemanticMap([], {})
    with undone(ALGORITHMS):
        ALGORITHMS.add("localization/mine", ScanToMap(empty, iterations=3))
        ALGORITHMS.add("motion_planning/mine", Labelled("all of it"))
        localizer = made("localization", room)
        assert made("motion_planning").label == "all of it"
    assert localizer.planar_map is room
    assert localizer.iterations == 3


def test_faults_of_several_slots_are_reported_at_once() -> None:
    told = faults("costmap.resolution=0", "slam.min_hits=0", "local_planning.max_speed=0", "localization.slip=-1")
    assert len(told) == 4


@pytest.mark.parametrize("name", [name for name in ALGORITHMS.names() if name not in WITHOUT_PARAMETERS])
def test_the_defaults_lie_within_their_own_bounds(name: str) -> None:
    algorithm, preset = class_and_preset(ALGORITHMS.resolve(name))
    slot = next((s for s, found in algorithms_by_slot().items() if (algorithm, preset) in found.values()), "")
    parameters = parameters_of(algorithm, slot, preset)
    assert parameters is not None
    own = {field.name: preset[field.name] for field in fields(parameters) if preset}
    defaults = {k: v for k, v in vars(parameters(**own)).items() if _is_plain(v)}
    assert defaults
    checked = vars(check(Document(defaults), parameters))
    assert {k: checked[k] for k in defaults} == defaults


@pytest.mark.parametrize("slot", SLOTS)
def test_each_slot_has_an_abstract_class_and_what_fills_it_is_one(slot: str) -> None:
    base = SLOTS[slot].base
    assert inspect.isabstract(base)
    assert algorithms_by_slot()[slot]
    assert all(issubclass(algorithm, base) for algorithm, _ in algorithms_by_slot()[slot].values())


def _is_plain(value: object) -> bool:
    return isinstance(value, (bool, int, float, str))


def test_a_task_reports_what_names_of_nav2_mean() -> None:
    settings = ["nav2.planners={Smac: theta_star}", "nav2.controllers={FollowPath: dwa}"]
    config = load_run("navigate_kitchen", settings=settings)
    with undone(ALGORITHMS):
        assert list(nav2_problems(config)) == []
        assert type(algorithm_by_name(config, "global_planning", "Smac")).__name__ == "ThetaStar"
        assert algorithm_by_name(config, "global_planning", "GridBased") is None
        assert type(algorithm_by_name(config, "local_planning", "FollowPath")).__name__ == "DWA"
        assert load_tree(tree_of('<ComputePathToPose goal="0;0;0" planner_id="Smac"/>'), node_registry()).nodes
        (problem,) = nav2_problems(load_run("navigate_kitchen", settings=["nav2.planners={GridBased: theta_stars}"]))
        assert (problem.field, "did you mean 'theta_star'?" in problem.message) == ("nav2.planners.GridBased", True)
