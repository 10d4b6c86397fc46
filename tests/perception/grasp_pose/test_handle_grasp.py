from __future__ import annotations

import math

import numpy as np
import pytest

from bestman_bt.messages import Box, Handle, PlacedShape, Pose
from bestman_bt.messages.handle import HandleKind
from bestman_bt.perception.errors import PerceptionError
from bestman_bt.perception.grasp_pose.base import GraspCandidate, GraspTarget
from bestman_bt.perception.grasp_pose.hand_shape import HandSize
from bestman_bt.perception.grasp_pose.handle_grasp import HandleGrasp
from tests.robot_models import gripper_model, with_part

GRIPPER = gripper_model(finger_depth=0.039, pad_size=(0.02, 0.02))
# A front at x = 1 that faces the robot: z of the handle is -x; x of the handle is up for an upright bar.
LEVEL = np.array([[0.0, 0.0, -1.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
UPRIGHT = np.array([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]])


def handle(
    kind: HandleKind = "bar",
    turn: np.ndarray = LEVEL,
    radius: float = 0.007,
    standoff: float = 0.04,
    length: float = 0.2,
    **more: object,
) -> Handle:
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = turn, [1.0 - standoff, 0.2, 0.9]
    defaults = {"confidence": 1.0, "position_std": 0.003, "joint": "prismatic"}
    return Handle(
        kind, Pose.from_matrix(matrix), radius, length, standoff, np.array([-1.0, 0, 0]), **{**defaults, **more}
    )


def target(of: Handle, surroundings: np.ndarray | None = None) -> GraspTarget:
    box = PlacedShape(Box((0.2, 0.05, 0.05)), of.pose)
    return GraspTarget(box, handle=of, surroundings=surroundings)


def plan(of: Handle, surroundings: np.ndarray | None = None) -> tuple[GraspCandidate, ...]:
    return HandleGrasp().plan(target(of, surroundings), GRIPPER, 0.0)


@pytest.mark.parametrize("turn", [LEVEL, UPRIGHT], ids=["level", "upright"])
def test_the_fingers_close_across_a_bar_with_the_hand_before_the_front(turn: np.ndarray) -> None:
    bar = handle(turn=turn)
    candidates = plan(bar)
    assert candidates[0].grasp.rotation[:, 2] @ bar.outward == pytest.approx(-1.0), "the best comes straight"
    for candidate in candidates:
        assert candidate.approach == "handle"
        assert abs(candidate.grasp.rotation[:, 1] @ bar.axis) < 1e-9
        assert candidate.width == pytest.approx(0.014)
        tips = candidate.grasp.apply(np.array([[0, y, 0.01] for y in (-0.05, 0.05)]))
        assert tips[:, 0].max() < 1.0, "the finger tips stay before the front"


def test_a_bar_is_taken_at_several_places_with_several_tilts_both_ways_round() -> None:
    bar = handle()
    candidates = plan(bar)
    along = {round(float((candidate.grasp.position - bar.pose.position) @ bar.axis), 3) for candidate in candidates}
    assert len(along) == 3
    assert max(along) < 0.2 / 2 - 0.025, "clear of the feet"
    tilts = {round(math.degrees(math.acos(-c.grasp.rotation[:, 2] @ bar.outward))) for c in candidates}
    assert {0, 20} <= tilts
    assert len({bool(candidate.grasp.rotation[2, 1] > 0) for candidate in candidates}) == 2


def test_a_drawer_s_handle_is_lifted_straight_towards_the_robot() -> None:
    candidates = plan(handle())
    assert len(candidates) > 10
    for candidate in candidates:
        np.testing.assert_allclose(candidate.lift.position - candidate.grasp.position, [-0.05, 0, 0], atol=1e-12)
        np.testing.assert_allclose(candidate.lift.rotation, candidate.grasp.rotation, atol=1e-12)


def test_a_door_s_handle_moves_on_an_arc_about_the_hinge() -> None:
    hinge = np.array([1.01, -0.2, 0.5])
    door = handle(turn=UPRIGHT, joint="revolute", hinge=hinge, hinge_direction=np.array([0.0, 0.0, -1.0]))
    candidates = plan(door)
    assert len(candidates) > 10
    for candidate in candidates:
        before, after = (pose.position - hinge for pose in (candidate.grasp, candidate.lift))
        assert np.hypot(*after[:2]) == pytest.approx(np.hypot(*before[:2]))
        assert after[0] < before[0], "it opens towards the robot"
        turned = math.acos((np.trace(candidate.grasp.rotation.T @ candidate.lift.rotation) - 1) / 2)
        arm = door.pose.position - hinge
        assert turned == pytest.approx(0.05 / np.hypot(*arm[:2]))


def test_a_knob_is_taken_from_all_directions() -> None:
    knob = handle("knob", radius=0.015, standoff=0.03, length=0.03)
    turns = {
        round(math.degrees(math.atan2(*(c.grasp.rotation[1:, 1]))) % 180) % 180
        for c in plan(knob)
        if c.grasp.rotation[:, 2] @ knob.outward < -0.999
    }
    assert turns == {0, 30, 60, 90, 120, 150}


@pytest.mark.slow
def test_a_bar_near_the_front_is_taken_from_further_out_and_one_too_near_not_at_all() -> None:
    assert plan(handle(standoff=0.025))[0].grasp.position[0] == pytest.approx(0.975)
    near = plan(handle(standoff=0.010, radius=0.006))
    assert near
    assert all(candidate.grasp.position[0] + 0.01 <= 0.9971 for candidate in near)
    assert plan(handle(standoff=0.003, radius=0.003)) == ()


def test_a_lip_is_pinched_where_the_hand_has_room_above_the_recess() -> None:
    lip = handle("edge", radius=0.006, standoff=-0.006, panel=Pose(np.array([1.0, 0.2, 0.7])))
    slim = with_part(GRIPPER, pad_size=(0.02, 0.012), max_width=0.03)
    shape = HandSize(finger_thickness=0.010, palm_size=(0.05, 0.04))
    closed = HandleGrasp(shape=shape)
    open_above = HandleGrasp(shape=shape, recess_width=0.3)
    assert plan(lip) == closed.plan(target(lip), slim, 0.0) == (), "palm and fingers would meet what is above"
    candidates = open_above.plan(target(lip), slim, 0.0)
    assert candidates
    for candidate in candidates:
        assert candidate.grasp.rotation[2, 2] < -0.5, "from above, over the lip's free edge"
        assert abs(candidate.grasp.rotation[0, 1]) > 0.8, "one finger before, one behind"


def test_a_bar_too_thick_for_the_hand_has_no_grasp() -> None:
    assert plan(handle(radius=0.037, standoff=0.1)) == ()


def test_hands_that_would_touch_the_surroundings_are_left_out() -> None:
    bar = handle()
    other = np.array([[0.90, 0.25, 0.90], [0.90, 0.25, 0.95], [0.90, 0.25, 0.85]])
    kept = plan(bar, other)
    assert 0 < len(kept) < len(plan(bar))
    assert all(candidate.clearance >= 0.005 for candidate in kept)


def test_a_target_without_a_handle_is_refused() -> None:
    with pytest.raises(PerceptionError, match="needs a target with a handle"):
        HandleGrasp().plan(GraspTarget(PlacedShape(Box((0.1, 0.1, 0.1)), Pose())), GRIPPER, 0.0)
