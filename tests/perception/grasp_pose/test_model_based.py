from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.rendered_table import known_models, solid, tumbler
from bestman_bt.messages import Box, Cylinder, ObjectGrasp, ObjectModel, PlacedShape, Pose, Sphere
from bestman_bt.perception.errors import PerceptionError
from bestman_bt.perception.grasp_pose.base import GraspCandidate, GraspTarget
from bestman_bt.perception.grasp_pose.model_based import ModelBased
from tests.robot_models import gripper_model

GRIPPER = gripper_model(finger_depth=0.045, pad_size=(0.02, 0.02))
SUPPORT = 0.75
CUP, CAN, BOX, TIN, CUBE = known_models(0)
BALL = solid("ball", Sphere(0.03), (1, 1, 1), 0)
TUB = ObjectModel("tub", (1, 1, 1), 0.1, 0.8, (PlacedShape(tumbler(0.03), Pose()),))


def standing(model: ObjectModel, yaw: float = 0.3) -> Pose:
    return Pose.from_xyz_rpy((0.6, 0.1, SUPPORT + model.size[2] / 2), (0.0, 0.0, yaw))


def plan(model: ObjectModel, pose: Pose | None = None) -> tuple[GraspCandidate, ...]:
    return ModelBased().plan(GraspTarget.of_model(model, pose or standing(model)), GRIPPER, SUPPORT)


@pytest.mark.parametrize("model", [CUP, CAN, BOX, TIN, CUBE, BALL], ids=lambda m: m.name)
def test_each_grasp_keeps_the_rules_of_the_hand(model: ObjectModel) -> None:
    candidates = plan(model)
    assert candidates
    top = SUPPORT + model.size[2]
    for candidate in candidates:
        rotation, position = candidate.grasp.rotation, candidate.grasp.position
        assert np.linalg.det(rotation) == pytest.approx(1.0)
        assert abs(rotation[2, 1]) < 1e-9, "the fingers close horizontally"
        assert candidate.width < candidate.opening <= GRIPPER.max_width
        np.testing.assert_allclose(
            candidate.grasp.position - candidate.pre_grasp.position, 0.1 * rotation[:, 2], atol=1e-9
        )
        np.testing.assert_allclose(candidate.lift.position - position, [0.0, 0.0, 0.12], atol=1e-9)
        if candidate.approach == "top":
            np.testing.assert_allclose(rotation[:, 2], [0.0, 0.0, -1.0], atol=1e-9)
            assert top - position[2] <= 0.0305, "deeper, and the palm hits the top"
            assert position[2] - GRIPPER.part.pad_size[1] / 2 > SUPPORT + 0.005
        else:
            assert abs(rotation[2, 2]) < 1e-9
            assert position[2] > SUPPORT + 0.035
    qualities = [candidate.quality for candidate in candidates]
    assert qualities == sorted(qualities, reverse=True)
    assert all(0.0 <= quality <= 1.0 for quality in qualities)


def test_from_the_side_the_hand_keeps_room_below_it_for_camera_and_wrist_where_the_object_is_that_tall() -> None:
    heights = {
        model.name: min(c.grasp.position[2] for c in plan(model) if c.approach == "side") - SUPPORT
        for model in (
            CUP,
            solid("bottle", Cylinder(0.03, 0.24), (1, 1, 1), 0),
            solid("low", Cylinder(0.03, 0.07), (1, 1, 1), 0),
        )
    }
    assert heights["cup"] == pytest.approx(min(ModelBased().room_below, CUP.size[2] - 0.01))
    assert heights["bottle"] == pytest.approx(0.12), "its middle"
    assert heights["low"] == pytest.approx(0.06), "a pad's half width below its top"


@pytest.mark.quick_cases(2)
@pytest.mark.parametrize("model", [CUP, BOX, TIN, CUBE, BALL, TUB], ids=lambda m: m.name)
def test_both_pads_touch_the_object_when_the_hand_closes(model: ObjectModel) -> None:
    pose = standing(model)
    candidates = plan(model, pose)
    assert len(candidates) >= 4
    for candidate in candidates:
        closing = candidate.grasp.rotation[:, 1]
        for side in (-1.0, 1.0):
            contact = pose.inverse().apply(candidate.grasp.position + side * candidate.width / 2 * closing)
            assert surface_distance(model, contact) < 0.004


def surface_distance(model: ObjectModel, point: np.ndarray) -> float:
    shape = model.collision[0].shape
    match shape:
        case Box():
            return abs(float((np.abs(point) - np.array(shape.size) / 2).max()))
        case Sphere():
            return abs(float(np.linalg.norm(point)) - shape.radius)
        case Cylinder():
            return abs(math.hypot(point[0], point[1]) - shape.radius)
    radius = math.hypot(point[0], point[1])
    return min(abs(radius - 0.03), abs(radius - 0.027))


@pytest.mark.slow
def test_an_open_tub_is_taken_across_and_by_its_wall_at_most_thirty_millimetres_deep() -> None:
    candidates = plan(TUB)
    assert min(candidate.width for candidate in candidates) < 0.005 < 0.058 < max(c.width for c in candidates)
    for candidate in candidates:
        assert abs(candidate.grasp.rotation[:, 1] @ candidate.grasp.rotation[:, 2]) < 1e-9
        if candidate.approach == "top" and candidate.grasp.rotation[2, 2] < -0.99:
            assert SUPPORT + TUB.size[2] - candidate.grasp.position[2] <= 0.032, "deeper, and the palm hits the rim"
        assert candidate.clearance >= 0.006, "the hand stays above the table"


def test_a_body_of_revolution_is_grasped_from_above_in_all_directions() -> None:
    yaws = sorted(math.atan2(c.grasp.rotation[1, 1], c.grasp.rotation[0, 1]) for c in plan(CUP) if c.approach == "top")
    assert len(yaws) == 12
    np.testing.assert_allclose(np.diff(yaws), math.radians(30.0), atol=1e-9)


def test_a_box_is_grasped_across_its_smaller_side_first_and_across_both() -> None:
    candidates = plan(BOX)
    assert candidates[0].width == pytest.approx(0.04)
    assert {round(candidate.width, 3) for candidate in candidates} == {0.04, 0.06}


def test_a_side_too_wide_for_the_gripper_is_left_out() -> None:
    assert {round(candidate.width, 3) for candidate in plan(TIN)} == {0.055}
    crate = solid("crate", Box((0.22, 0.32, 0.16)), (1, 1, 1), 2)
    assert plan(crate) == ()


def test_things_close_by_leave_only_grasps_with_room_around_the_hand() -> None:
    pose = standing(BOX)
    wall = pose.apply(
        np.array([[x, 0.05, z] for x in np.linspace(-0.1, 0.1, 41) for z in np.linspace(-0.05, 0.06, 23)])
    )
    target = replace(GraspTarget.of_model(BOX, pose), surroundings=wall)
    candidates = ModelBased().plan(target, GRIPPER, SUPPORT)
    assert candidates
    for candidate in candidates:
        assert candidate.clearance >= 0.004
        half = candidate.opening / 2
        fingers = candidate.grasp.apply(
            np.array([[0, sign * (half + out), 0.0] for sign in (-1, 1) for out in (0, 0.02)])
        )
        assert pose.inverse().apply(fingers)[:, 1].max() < 0.046


@pytest.mark.slow
def test_where_the_straight_grasps_of_a_box_are_blocked_others_are_found() -> None:
    pose = standing(BOX)
    # Posts where the fingers of the straight grasps would stand; between them there is room for tilted hands.
    posts = [[x, y, 0.07] for x, y in ((0.034, 0), (-0.034, 0), (0, 0.044), (0, -0.044), (0.034, 0.02), (0.034, -0.02))]
    blocked = replace(GraspTarget.of_model(BOX, pose), surroundings=pose.apply(np.array(posts)))
    straight = plan(BOX, pose)
    candidates = ModelBased().plan(blocked, GRIPPER, SUPPORT)
    assert candidates
    known = {tuple(np.round(candidate.grasp.matrix, 6).ravel()) for candidate in straight}
    assert not any(tuple(np.round(candidate.grasp.matrix, 6).ravel()) in known for candidate in candidates)


def test_grasps_that_come_with_a_model_are_used() -> None:
    tool = Pose.from_xyz_rpy((0.0, 0.0, 0.02), (math.pi, 0.0, 0.5))
    below = Pose.from_xyz_rpy((0.0, 0.0, -0.02), (0.0, 0.0, 0.5))
    model = replace(TUB, grasps=(ObjectGrasp(tool, 0.06, 0.9), ObjectGrasp(below, 0.06, 0.8)))
    (candidate,) = plan(model)
    np.testing.assert_allclose(candidate.grasp.matrix, (standing(TUB) @ tool).matrix, atol=1e-9)
    assert candidate.quality == pytest.approx(0.9, abs=0.01)


def test_a_flat_thing_has_no_grasp() -> None:
    assert plan(solid("coaster", Cylinder(0.03, 0.008), (1, 1, 1), 0)) == ()


def test_a_lying_can_is_taken_across_its_axis() -> None:
    pose = Pose.from_xyz_rpy((0.6, 0.1, SUPPORT + 0.033), (math.pi / 2, 0.0, 0.4))
    candidates = plan(CAN, pose)
    assert candidates
    for candidate in candidates:
        assert abs(candidate.grasp.rotation[:, 1] @ pose.rotation[:, 2]) < 1e-6


def test_a_target_without_a_model_is_refused() -> None:
    with pytest.raises(PerceptionError, match="use AntipodalCloud"):
        ModelBased().plan(GraspTarget(PlacedShape(Box((0.05, 0.05, 0.1)), Pose())), GRIPPER, 0.0)


@pytest.mark.slow
def test_equal_input_gives_equal_output() -> None:
    for one, other in zip(plan(TUB), plan(TUB), strict=True):
        np.testing.assert_array_equal(one.grasp.matrix, other.grasp.matrix)
