"""Algorithms of a configuration: every wrong parameter of every slot is told before anything starts."""

from __future__ import annotations

from importlib import import_module

import pytest

from bestman_bt.configuration import ConfigurationError, algorithm_parameters, load_run
from bestman_bt.registry import ALGORITHMS
from bestman_bt.robot_model import load_robot_model
from bestman_bt.runtime.algorithms import make_algorithms


def faults(*settings: str) -> list[str]:
    model = load_robot_model("diff_panda")
    with pytest.raises(ConfigurationError) as error:
        make_algorithms(load_run("navigate_kitchen", settings=[f"algorithms.{s}" for s in settings]), model)
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
            ["global_planning.algorithm=prm", "global_planning.samples=-4"],
            "global_planning.samples: should be greater than or equal to 1, got -4",
        ),
        (
            ["local_planning.min_lookahead=0.5"],
            "local_planning.min_lookahead: min_lookahead (0.5) should not be larger than max_lookahead (0.4)",
        ),
        (["local_planning.algorithm=3"], "local_planning.algorithm: should be the name of an algorithm, got 3"),
        (
            ["global_planning.algorithm=astar"],
            "global_planning.algorithm: unknown algorithm 'astar'; did you mean 'theta_star'? "
            "(known: grid_astar, hybrid_astar, prm, rrt_star, theta_star)",
        ),
    ],
)
def test_a_wrong_parameter_is_told_with_what_is_right(settings: list[str], fault: str) -> None:
    assert faults(*settings) == [fault]


def test_faults_of_several_slots_are_told_at_once() -> None:
    told = faults("costmap.resolution=0", "slam.min_hits=0", "local_planning.max_speed=0", "localization.slip=-1")
    assert len(told) == 4


@pytest.mark.parametrize("name", ALGORITHMS.names())
def test_the_defaults_lie_within_their_own_bounds(name: str) -> None:
    algorithm = ALGORITHMS.resolve(name)
    parameters = getattr(import_module(algorithm.__module__), f"{algorithm.__name__}Parameters", None)
    if parameters is not None:
        defaults = {k: v for k, v in vars(algorithm_parameters(name, {}, parameters)).items() if _is_plain(v)}
        algorithm_parameters(name, defaults, parameters)


def _is_plain(value: object) -> bool:
    return isinstance(value, (bool, int, float, str))
