"""Algorithms as the configuration chooses them: slot → class, with checked parameters."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from behaviours.context import Algorithms
from bestman_bt.configuration import ConfigurationError, Problem, RunConfig, algorithm_parameters
from bestman_bt.manipulation.motion_planning import TimedMotionPlanner
from bestman_bt.navigation.local_planning import PathFollower
from bestman_bt.navigation.localization import Localizer
from bestman_bt.perception.detection import ModelRegistration
from bestman_bt.registry import ALGORITHMS, suggestion
from bestman_bt.robot_model import RobotModel
from bestman_bt.world_model import SemanticMap


def make_algorithms(config: RunConfig, model: RobotModel) -> Algorithms:
    """The algorithms that skills ask; raises as ``make_algorithm``."""
    return Algorithms(
        detection=ModelRegistration(
            segmentation=make_algorithm(config, "segmentation"),
            pose_estimator=make_algorithm(config, "pose_estimation"),
        ),
        grasp_pose=make_algorithm(config, "grasp_pose"),
        kinematics=make_algorithm(config, "kinematics", model),
        collision=make_algorithm(config, "collision", model),
        motion_planning=TimedMotionPlanner(
            make_algorithm(config, "motion_planning"), make_algorithm(config, "trajectory")
        ),
        global_planning=make_algorithm(config, "global_planning"),
    )


def make_localizer(config: RunConfig, semantic_map: SemanticMap) -> Localizer:
    """What tells the base controller where the base is; raises as ``make_algorithm``."""
    localizer: Localizer = make_algorithm(config, "localization", semantic_map)
    return localizer


def make_local_planner(config: RunConfig) -> PathFollower:
    """What the base controller follows paths with; raises as ``make_algorithm``."""
    follower: PathFollower = make_algorithm(config, "local_planning")
    return follower


def make_algorithm(config: RunConfig, slot: str, *needs: Any) -> Any:
    """The algorithm in ``slot``, made as ``Class(*needs, parameters=…)``.

    Its parameters are checked against the dataclass ``<Class>Parameters`` of the class's module.
    Raises ConfigurationError that names the slot, the field and what would be right.
    """
    name, values = config.task.algorithm(slot)
    names = [known.removeprefix(f"{slot}/") for known in ALGORITHMS if known.startswith(f"{slot}/")]
    if name not in names:
        message = f"unknown algorithm {name!r}; {suggestion(name, names)}"
        raise ConfigurationError([config.problem(("algorithms", slot, "algorithm"), message)])
    algorithm = ALGORITHMS.resolve(f"{slot}/{name}")
    parameters_type = getattr(import_module(algorithm.__module__), f"{algorithm.__name__}Parameters", None)
    if parameters_type is None:
        if values:
            message = f"{name} takes no parameters, got {', '.join(values)}"
            raise ConfigurationError([config.problem(("algorithms", slot), message)])
        return algorithm(*needs)
    try:
        parameters = algorithm_parameters(slot, values, parameters_type)
    except ConfigurationError as error:
        raise ConfigurationError([_placed(config, slot, problem) for problem in error.problems]) from error
    return algorithm(*needs, parameters=parameters)


def _placed(config: RunConfig, slot: str, problem: Problem) -> Problem:
    """The problem of a parameter, with the place where the run was given it."""
    field = problem.field.split(".") if problem.field else []
    return config.problem(("algorithms", slot, *field), problem.message)
