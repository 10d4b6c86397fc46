"""Learned policies by name: shipped ones, or a user's file or class."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path

from behaviours.manipulation.policy import RunPolicy
from bestman_bt.configuration import ConfigurationError, find_data, in_folders
from bestman_bt.configuration import Problem as WrongInput
from bestman_bt.engine import Tree
from bestman_bt.engine.errors import Problem
from bestman_bt.engine.unwritten import problem_at
from bestman_bt.errors import MissingExtraError, WrongResultError
from bestman_bt.manipulation.kinematics import DampedLeastSquares
from bestman_bt.manipulation.policy import (
    PickedObject,
    PickingExpert,
    Policy,
    PolicyError,
    PolicyModelError,
    ReachingExpert,
    load_policy,
)
from bestman_bt.messages import Pose
from bestman_bt.perception.grasp_pose import GraspTarget, ModelBased
from bestman_bt.robot_model import ArmModel, GripperModel, RobotModel
from bestman_bt.runtime.algorithms import class_at, made_of_own, refuse_unfinished, told_by_tree
from bestman_bt.runtime.tree_checks import literals
from bestman_bt.scene.object_file import read_object

# Who demonstrates the shipped policies: our inverse kinematics, and for picking our grasp planner.


def reaching_expert(robot: RobotModel) -> ReachingExpert:
    """For the robot's arm, around its posture ``home``."""
    arm = robot.of(ArmModel)["arm"]
    return ReachingExpert(DampedLeastSquares(robot), arm, robot.posture("home", arm.joint_names))


def picking_expert(robot: RobotModel, name: str) -> PickingExpert:
    """For the robot's arm and a shipped object, with the best grasp from above that the grasp planner finds.

    LookupError where the hand cannot take it from above.
    """
    arm = robot.of(ArmModel)["arm"]
    model = read_object(find_data("object", name))
    middle = Pose.from_xyz_rpy(
        [0.5 * (low + high) for low, high in zip(PickingExpert.lower, PickingExpert.upper, strict=True)]
    )
    support = float(middle.position[2] + model.bounds()[0, 2])
    planner = ModelBased()
    candidates = planner.plan(GraspTarget.of_model(model, middle), robot.of(GripperModel)["gripper"], support)
    best = next((candidate for candidate in candidates if candidate.approach == "top"), None)
    if best is None:
        raise LookupError(f"the hand cannot take the {name} from above")
    picked = PickedObject(name, float(best.grasp.position[2] - middle.position[2]), best.width, best.opening)
    return PickingExpert(DampedLeastSquares(robot), arm, robot.posture("home", arm.joint_names), picked)


def find_policy(name: str, folders: Iterable[Path] = ()) -> Policy:
    """The policy of a bare name (a shipped one), an .onnx or a .yaml file, or the class ``file.py:Class``.

    ``folders``: where a file is looked for first. Raises PolicyModelError, which suggests the closest name.
    """
    if ":" in name:
        return _own_policy(name, tuple(folders))
    try:
        path = find_data("policy", in_folders(name, folders))
    except ConfigurationError as error:
        raise PolicyModelError(error.problems[0].message) from error
    return load_policy(path)


def _own_policy(name: str, folders: tuple[Path, ...]) -> Policy:
    try:
        made_by = class_at(name, folders, lambda message: WrongInput(name, None, "", message))
        refuse_unfinished(made_by, Policy, "")
        policy: Policy = made_of_own(made_by, Policy, "")
    except ConfigurationError as error:
        raise PolicyModelError(told_by_tree(error)) from error
    return policy


def policy_problems(tree: Tree) -> Iterator[Problem]:
    """Policies that a tree names and that are not there, or whose description is wrong, each where the tree says it."""
    told: set[tuple[int, str]] = set()
    for node in tree.nodes:
        if not isinstance(node, RunPolicy) or "policy" not in node.attributes:
            continue
        for place, port, name in literals(node, "policy", tree):
            try:
                _ = find_policy(name, node.folders).specification
            except (PolicyError, MissingExtraError, WrongResultError) as error:
                if (place.uid, port) not in told:
                    told.add((place.uid, port))
                    yield problem_at(place, port, str(error), "")
