"""Kinematics where the base frame is not the root, and an arm lists its joints from tip to root."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bestman_bt.manipulation.kinematics.damped_least_squares import DampedLeastSquares
from bestman_bt.manipulation.kinematics.link_hulls import ArmBodies, ForwardKinematics
from bestman_bt.messages import Box, ObjectModel, PlacedShape, Pose
from bestman_bt.robot_model.model import ArmModel, RobotModel
from bestman_bt.world_model.world_model import HeldObject
from tests.manipulation.two_arms import BASE, BASE_YAW, JOINTS, home, two_arms
from tests.robot_models import USUAL_LIMITS, arm_model

SIDES = ("left", "right")


@pytest.fixture(scope="module")
def robot() -> RobotModel:
    return two_arms()


@pytest.fixture(scope="module")
def forward(robot) -> ForwardKinematics:
    return ForwardKinematics(robot)


@pytest.fixture(scope="module", params=SIDES)
def arm(request, robot) -> DampedLeastSquares:
    return DampedLeastSquares(robot, request.param)


def named(arm: DampedLeastSquares, positions: np.ndarray) -> dict[str, float]:
    return dict(zip(arm.joint_names, positions.tolist(), strict=True))


def side_of(arm: DampedLeastSquares) -> str:
    return arm.arm_model.tool_frame.removesuffix("_tool")


def samples(arm: DampedLeastSquares, rng: np.random.Generator, count: int = 10) -> np.ndarray:
    return rng.uniform(arm.arm_model.lower, arm.arm_model.upper, (count, 7))


def same(a: Pose, b: Pose, tolerance: float = 1e-9) -> bool:
    return np.allclose(a.matrix, b.matrix, atol=tolerance)


def test_poses_are_given_in_the_base_frame(robot, forward) -> None:
    root_from_base = Pose.from_xyz_rpy(BASE, (0.0, 0.0, BASE_YAW))
    assert same(forward.pose("root", {}), root_from_base.inverse())
    assert same(forward.pose("base_link", {}, reference="root"), root_from_base)


def test_the_tool_is_where_forward_kinematics_by_name_has_it(arm, forward, rng) -> None:
    for q in samples(arm, rng):
        expected = forward.pose(arm.arm_model.tool_frame, named(arm, q))
        assert same(arm.tool_pose(q), expected)
        axis = np.array([0.6, 0.0, 0.8])
        assert np.allclose(arm.tool_direction(q, axis), expected.rotation @ axis)


def test_poses_of_the_base_frame_are_solved_and_tracked(arm, robot, rng) -> None:
    start = home(robot, side_of(arm))
    wanted = start + rng.uniform(-0.1, 0.1, 7) * np.where(["lift" in name for name in arm.joint_names], 0.3, 1.0)
    result = arm.solve(arm.tool_pose(wanted), start, rng)
    assert same(arm.tool_pose(result.best), arm.tool_pose(wanted), 1e-4)
    followed = arm.track(arm.tool_pose(wanted), start)
    assert followed is not None
    assert same(arm.tool_pose(followed), arm.tool_pose(wanted), 1e-4)
    assert np.abs(followed - start).max() < 0.2


def test_columns_of_the_jacobian_are_in_the_order_of_the_joints(arm, robot) -> None:
    q = home(robot, side_of(arm)) + np.linspace(-0.1, 0.1, 7)
    jacobian = arm.jacobian(q)
    for joint in range(7):
        moved = arm.tool_pose(q).inverse() @ arm.tool_pose(q + 1e-6 * np.eye(7)[joint])
        assert np.allclose(moved.position, 1e-6 * jacobian[:3, joint], atol=1e-10)
        assert np.allclose(2 * moved.quaternion[:3], 1e-6 * jacobian[3:, joint], atol=1e-10)


def test_the_reach_is_that_of_the_stretched_arm_from_its_shoulder_in_the_base_frame(arm, forward) -> None:
    side = side_of(arm)
    straight = np.array([0.2 if "lift" in name else 0.0 for name in arm.joint_names])
    shoulder, reach = arm.reach
    assert np.allclose(shoulder, forward.pose(f"{side}_lift_link", {}).position)
    assert 0.0 < reach - np.linalg.norm(arm.tool_pose(straight).position - shoulder) < 1e-4
    beyond = Pose(shoulder + np.array([0.0, 0.0, reach + 1e-3]))
    assert arm.solve(beyond, straight, np.random.default_rng(0)).attempts == 0


def test_a_joint_that_carries_the_arm_stands_where_it_is_reported(robot, forward) -> None:
    lifted, low = (DampedLeastSquares(without_lift(robot), "left", fixed=f) for f in ({"left_lift": 0.15}, {}))
    q = home(robot, "left")[1:]
    assert same(lifted.tool_pose(q), forward.pose("left_tool", {**named(lifted, q), "left_lift": 0.15}))
    assert lifted.tool_pose(q).position[2] == pytest.approx(low.tool_pose(q).position[2] + 0.15)


def without_lift(robot: RobotModel) -> RobotModel:
    """The left arm is one of the joints above its lift."""
    whole = robot.of(ArmModel)["left"]
    limits = {name: getattr(whole, name)[1:] for name in USUAL_LIMITS}
    return replace(robot, parts={"left": arm_model(whole.joint_names[1:], "root", "left_tool", **limits)})


@pytest.mark.parametrize("side", SIDES)
def test_the_bodies_of_an_arm_are_its_own_in_the_base_frame(robot, forward, side) -> None:
    positions = {**robot.postures["home"], f"{side}_pan": 0.4, f"{side}_slide1": 0.03}
    box = ObjectModel("box", (1, 0, 0), 0.2, 0.8, (PlacedShape(Box((0.02, 0.04, 0.06)), Pose()),))
    held = HeldObject("box", box, Pose(np.array([0.0, 0.0, 0.1])), 0.04)
    *bodies, in_hand = ArmBodies(robot, side).at(positions, held)
    links = [f"{side}_{joint}_link" for joint in JOINTS] + [f"{side}_{part}" for part in ("palm", "finger1", "finger2")]
    assert len(bodies) == len(links)
    middles = np.array([body.mean(axis=0) for body in bodies])
    for link in links:
        offset = {"palm": (0, 0, 0), "finger1": (0, 0.005, 0), "finger2": (0, -0.005, 0)}.get(
            link.removeprefix(f"{side}_"), (0, 0, 0.02)
        )
        expected = forward.pose(link, positions).apply(np.array([offset], dtype=float))
        assert np.linalg.norm(middles - expected, axis=1).min() < 1e-9
    tool = forward.pose(f"{side}_tool", positions)
    assert np.allclose(in_hand.mean(axis=0), (tool @ held.tool_from_object).position)
    assert np.ptp((tool @ held.tool_from_object).inverse().apply(in_hand), axis=0) == pytest.approx((0.02, 0.04, 0.06))
