"""Experts that demonstrate for the shipped policies: inverse kinematics, and the grasp planner for picking."""

from __future__ import annotations

from bestman_bt.configuration.data import find_data
from bestman_bt.manipulation.kinematics.damped_least_squares import DampedLeastSquares
from bestman_bt.manipulation.policy.training.picking import PickedObject, PickingExpert
from bestman_bt.manipulation.policy.training.reaching import ReachingExpert
from bestman_bt.messages import Pose
from bestman_bt.perception.grasp_pose.base import GraspTarget
from bestman_bt.perception.grasp_pose.model_based import ModelBased
from bestman_bt.robot_model.model import ArmModel, GripperModel, RobotModel
from bestman_bt.scene.object_file import read_object


def reaching_expert(robot: RobotModel) -> ReachingExpert:
    """Return the expert for the robot's arm, around its posture ``home``."""
    arm = robot.of(ArmModel)["arm"]
    return ReachingExpert(DampedLeastSquares(robot), arm, robot.posture("home", arm.joint_names))


def picking_expert(robot: RobotModel, name: str) -> PickingExpert:
    """Return the expert for the robot's arm and a shipped object, with the best grasp from above.

    Raises LookupError if the hand cannot grasp it from above.
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
