"""The open hand, what its pads meet, how a grasp is placed and ranked: on numbers that can be worked out by hand."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from bestman_bt.messages import Pose
from bestman_bt.perception.grasp_pose.base import GraspCandidate
from bestman_bt.perception.grasp_pose.contact_quality import ContactQuality, PadContacts, close_pads
from bestman_bt.perception.grasp_pose.hand_poses import HandPoses, different_hands, hands_about
from bestman_bt.perception.grasp_pose.hand_shape import HandPlacement, HandShape, HandSize
from bestman_bt.perception.grasp_pose.ranking import GraspRanking, clear_candidates, columns_below
from tests.robot_models import gripper_model, with_part

GRIPPER = gripper_model(finger_depth=0.045, pad_size=(0.02, 0.016))
SHAPE = HandShape(GRIPPER, HandSize(finger_thickness=0.02, palm_size=(0.06, 0.2), palm_length=0.1))
TOOL = Pose.from_xyz_rpy((0.5, -0.2, 0.8), (math.pi - 0.3, 0.2, 1.0))


def hands(*poses: Pose) -> HandPoses:
    return HandPoses(np.array([pose.rotation for pose in poses]), np.array([pose.position for pose in poses]))


def seen_from_tool(*local: tuple[float, float, float]) -> np.ndarray:
    return TOOL.apply(np.array(local, dtype=float))


@pytest.mark.parametrize(
    ("point", "clearance"),
    [
        ((0.0, 0.0, 0.0), 0.02),  # between the fingers, opened by 40 mm
        ((0.0, 0.021, 0.0), 0.0),  # in a finger
        ((0.0, -0.039, -0.04), 0.0),
        ((0.0, 0.050, 0.0), 0.01),  # outside of one, 20 mm thick
        ((0.02, 0.03, 0.0), 0.01),  # beside it, 20 mm wide
        ((0.0, 0.03, 0.018), 0.01),  # before its tip, half a pad beyond the tool frame
        ((0.0, 0.0, -0.046), 0.0),  # in the palm, 45 mm behind the tool frame
        ((0.0, 0.0, -0.035), 0.01),
        ((0.04, 0.0, -0.1), 0.01),
        ((0.0, 0.11, -0.1), 0.01),
        ((0.0, 0.0, -0.155), 0.01),  # behind the hand, 100 mm long
    ],
)
def test_the_open_hand_is_two_fingers_and_a_palm(point: tuple[float, float, float], clearance: float) -> None:
    openings, points = np.array([0.04]), seen_from_tool(point)
    assert SHAPE.clearances(hands(TOOL), openings, points) == pytest.approx([clearance], abs=1e-9)
    for margin, touches in ((clearance - 1e-4, clearance == 0.0), (clearance + 1e-4, True)):
        assert SHAPE.touches(hands(TOOL), openings, points, max(margin, 0.0)).tolist() == [touches]


def test_clearances_are_told_hand_by_hand_and_no_farther_than_enough() -> None:
    away = TOOL @ Pose(np.array([0.0, 0.0, -0.5]))
    points = seen_from_tool((0.0, 0.0, 0.0))
    assert SHAPE.clearances(hands(TOOL, away), np.full(2, 0.04), points) == pytest.approx([0.02, 0.492], abs=1e-3)
    assert SHAPE.clearances(hands(TOOL), np.array([0.04]), points, 0.01) == pytest.approx([0.01])
    assert SHAPE.clearances(hands(TOOL), np.array([0.04]), np.zeros((0, 3)), 0.3) == pytest.approx([0.3])


def test_the_lowest_corner_and_the_reach_hold_for_the_whole_outline() -> None:
    for opening in (0.0, 0.08):
        outline = SHAPE.outline(hands(TOOL), opening)
        assert SHAPE.lowest(hands(TOOL), np.array([opening])) == pytest.approx([outline[:, 2].min()], abs=1e-9)
        assert np.linalg.norm(outline - TOOL.position, axis=1).max() <= SHAPE.reach + 1e-9
    down = Pose.from_xyz_rpy((0, 0, 0.5), (math.pi, 0, 0))
    assert SHAPE.lowest(hands(down), np.array([0.04])) == pytest.approx([0.5 - 0.008])


def block(width: float, off: float = 0.0, turn: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Two faces with normals outward, ``width`` apart in the tool's y; one may lean by ``turn``."""
    x, z = np.meshgrid(np.linspace(-0.0305, 0.0305, 62), np.linspace(-0.0305, 0.0305, 62))
    points, normals = [], []
    for sign in (1.0, -1.0):
        lean = turn if sign > 0 else 0.0
        y = sign * width / 2 + off - np.tan(lean) * x
        points.append(np.column_stack([x.ravel(), y.ravel(), z.ravel()]))
        normals.append(np.tile([sign * np.sin(lean), sign * np.cos(lean), 0.0], (x.size, 1)))
    return TOOL.apply(np.concatenate(points)), np.concatenate(normals) @ TOOL.rotation.T


def closed(points: np.ndarray, normals: np.ndarray, opening: float = 0.08) -> PadContacts:
    return close_pads(
        points, normals, hands(TOOL), np.array([opening]), GRIPPER.part.pad_size, GRIPPER.part.finger_depth, 0.001
    )


def test_pads_close_on_both_faces_and_report_where_the_middle_is() -> None:
    met = closed(*block(0.04, off=0.007))
    assert met.width == pytest.approx([0.04])
    assert met.centre[0] == pytest.approx([0.0, 0.007, 0.0], abs=1e-9)
    assert met.alignment == pytest.approx([1.0])
    assert met.offset == pytest.approx([0.0], abs=1e-9)
    assert met.bulge == pytest.approx([0.0])
    assert met.extent[0] == pytest.approx(np.array([0.02, 0.016]) / math.sqrt(12.0), rel=0.05)
    assert closed(*block(0.04, off=0.025)).width == pytest.approx([0.0]), "one face is beyond the open finger"
    assert closed(*block(0.04), opening=0.03).width == pytest.approx([0.0])


def test_the_worse_side_reports_how_well_the_pads_face_the_object() -> None:
    met = closed(*block(0.04, turn=0.3))
    assert met.alignment == pytest.approx([math.cos(0.3)], abs=1e-6)
    assert met.width[0] == pytest.approx(0.04 + 0.01 * math.tan(0.3), abs=5e-4)
    assert met.offset[0] > 0.005, "it meets an edge of the pad there"


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_what_is_wider_towards_the_palm_bulges_on_either_side(sign: float) -> None:
    points, normals = block(0.04)
    above = TOOL.inverse().apply(points)
    wider = (above[:, 2] < -0.01) & (sign * above[:, 1] > 0)
    above[wider, 1] += 0.006 * sign
    assert closed(TOOL.apply(above), normals).bulge == pytest.approx([0.006])


def quality(centre_of_mass: tuple[float, float, float] = (0, 0, 0), **changes: float) -> float:
    given = {"width": 0.03, "alignment": 1.0, "offset": 0.0, "bulge": 0.0, **changes}
    contacts = PadContacts(
        width=np.array([given["width"]]),
        centre=np.array([[0.0, 0.0, given.get("tip", 0.0)]]),
        alignment=np.array([given["alignment"]]),
        extent=np.array([GRIPPER.part.pad_size]) / math.sqrt(12.0),
        offset=np.array([given["offset"]]),
        bulge=np.array([given["bulge"]]),
    )
    upright = Pose.from_xyz_rpy((0, 0, 0), (math.pi, 0, 0))
    options = {"widest": 0.073, "friction": 0.5, "bulge": 0.004}
    return float(ContactQuality().judge(hands(upright), contacts, np.array(centre_of_mass), GRIPPER, **options)[0])


def odds(value: float) -> float:
    return math.log(value / (1.0 - value))


@pytest.mark.parametrize(
    ("changes", "loss"),
    [
        ({"alignment": math.cos(0.2)}, 0.2 * 2.4),
        ({"offset": 0.01}, 0.5 * 1.2),
        ({"offset": 0.05}, 1.2),
        ({"tip": 0.004, "centre_of_mass": (0, 0, -0.004)}, 0.5 * 3.0),
        ({"tip": -0.004, "centre_of_mass": (0, 0, 0.004)}, 0.0),
        ({"width": 0.07}, 0.5 * 0.8),
        ({"centre_of_mass": (0.02, 0, 0)}, 0.02 * 15.0),
        ({"centre_of_mass": (0, 0.02, 0)}, 0.0),
        ({"centre_of_mass": (0, 0, 0.02)}, 0.3 * 0.02 * 15.0),
    ],
)
def test_each_fault_of_a_contact_costs_what_it_weighs(changes: dict, loss: float) -> None:
    assert odds(quality()) == pytest.approx(3.7 + 0.5 + 1.2)
    assert odds(quality()) - odds(quality(**changes)) == pytest.approx(loss, abs=1e-6)


@pytest.mark.parametrize(
    ("changes", "holds"),
    [
        ({"width": 0.0729}, True),
        ({"width": 0.0731}, False),
        ({"width": 0.0}, False),
        ({"bulge": 0.0039}, True),
        ({"bulge": 0.0041}, False),
        ({"alignment": math.cos(math.atan(0.49))}, True),
        ({"alignment": math.cos(math.atan(0.51))}, False),
    ],
)
def test_beyond_its_bounds_a_contact_holds_nothing(changes: dict, holds: bool) -> None:
    assert (quality(**changes) > 0.0) is holds


PLACEMENT = HandPlacement()


@pytest.mark.parametrize(("width", "fits"), [(0.0, False), (0.001, True), (0.0729, True), (0.0731, False)])
def test_a_hand_takes_what_is_between_its_least_and_its_greatest_opening(width: float, fits: bool) -> None:
    assert PLACEMENT.fits(width, GRIPPER) is fits
    opening = PLACEMENT.openings(np.array([width]), GRIPPER)[0]
    assert opening == pytest.approx(min(0.08, width + 0.02))


@pytest.mark.parametrize(
    ("top", "height"), [(0.2, 0.17), (0.04, 0.014), (0.016, 0.0128), (0.0143, 0.0111), (0.0141, None)]
)
def test_from_above_the_hand_goes_as_deep_as_palm_and_support_allow(top: float, height: float | None) -> None:
    """Reach 30 mm, half a pad 8 mm: 14 mm above the support, or for flat things 11 mm."""
    found = PLACEMENT.top_height(0.5 + top, 0.5, GRIPPER)
    assert found == (None if height is None else pytest.approx(0.5 + height))
    short = with_part(GRIPPER, finger_depth=0.02)
    assert PLACEMENT.reach(short) == pytest.approx(0.012)


def candidate(pose: Pose, quality: float = 0.8, clearance: float = 1.0, width: float = 0.03) -> GraspCandidate:
    made = PLACEMENT.candidate(pose.position, pose.rotation[:, 2], pose.rotation[:, 1], width, quality, "top", GRIPPER)
    return replace(made, clearance=clearance)


def test_a_grasp_comes_along_its_approach_and_is_lifted_straight_up() -> None:
    made = candidate(TOOL, quality=1.3)
    assert np.allclose(made.grasp.matrix, TOOL.matrix)
    assert np.allclose(made.pre_grasp.matrix, (TOOL @ Pose(np.array([0.0, 0.0, -0.10]))).matrix)
    assert made.lift.position - TOOL.position == pytest.approx([0.0, 0.0, 0.12])
    assert (made.opening, made.quality) == (pytest.approx(0.05), 1.0)


def test_hands_are_turned_about_their_closing_axis_from_straight_above() -> None:
    closing = np.array([[0.0, 0.6, 0.8], [0.0, 0.0, 1.0]])
    made = hands_about(np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]), closing, np.array([0.0, 0.5, -0.5]))
    assert len(made) == 6
    assert made.positions[3:] == pytest.approx(np.tile([4.0, 5.0, 6.0], (3, 1)))
    for i in range(6):
        assert np.linalg.det(made.rotations[i]) == pytest.approx(1.0)
        assert made.rotations[i, :, 1] == pytest.approx(closing[i // 3])
    assert made.rotations[0, :, 2] == pytest.approx([0.0, 0.8, -0.6])
    assert made.rotations[1, :, 2] @ made.rotations[0, :, 2] == pytest.approx(math.cos(0.5))
    assert np.cross(made.rotations[0, :, 2], made.rotations[1, :, 2]) @ closing[0] == pytest.approx(math.sin(0.5))
    shifted = made.shifted(np.arange(6) * 0.01, 2)
    assert shifted.positions[2] - made.positions[2] == pytest.approx(0.02 * made.rotations[2, :, 2])


@pytest.mark.parametrize(
    ("shift", "turn", "count"), [(0.009, 0.1, 1), (0.011, 0.1, 2), (0.009, 0.29, 1), (0.009, 0.31, 2)]
)
def test_hands_count_as_one_only_where_place_and_turn_are_near(shift: float, turn: float, count: int) -> None:
    other = TOOL @ Pose.from_xyz_rpy((shift, 0, 0), (0, 0, turn))
    assert len(different_hands(hands(TOOL, other), np.arange(2), 5, 0.01, 0.3)) == count
    assert different_hands(hands(TOOL, other), np.array([1, 0]), 1, 0.01, 0.3) == [1]


def test_candidates_keep_their_distance_and_are_told_it_and_that_to_the_support() -> None:
    made, points = candidate(TOOL), seen_from_tool((0.0, 0.055, 0.0))
    lowest = float(SHAPE.lowest(hands(TOOL), np.array([made.opening]))[0])
    for least, kept in ((0.009, 1), (0.011, 0)):
        found = clear_candidates([made], SHAPE, points, lowest - 1.0, least)
        assert len(found) == kept
        assert all(one.clearance == pytest.approx(0.01) for one in found)
    (near,) = clear_candidates([made], SHAPE, points, lowest - 0.004, 0.0)
    assert near.clearance == pytest.approx(0.004)


def test_what_was_seen_reaches_down_to_the_support() -> None:
    column = columns_below(np.array([[0.1, 0.2, 0.55], [0.1, 0.2, 0.53], [0.3, 0.2, 0.505]]), 0.5, 0.005, 0.01)
    assert column[:, :2] == pytest.approx(np.tile([0.1, 0.2], (4, 1)))
    assert column[:, 2] == pytest.approx([0.505, 0.515, 0.525, 0.535])


def spread(count: int, **options) -> list[GraspCandidate]:
    return [candidate(TOOL @ Pose(np.array([0.05 * i, 0, 0])), **options) for i in range(count)]


def test_grasps_are_ranked_by_quality_room_and_reachability() -> None:
    poses = spread(4)
    made = [
        replace(c, quality=q, clearance=r)
        for c, q, r in zip(poses, (0.8, 0.8, 0.7, 0.9), (1, 0.0075, 1, 1), strict=True)
    ]
    answers = {id(made[3].grasp): 0.5, id(made[2].grasp): 1.7}
    ranked = GraspRanking().rank(made, lambda pose: answers.get(id(pose), 1.0))
    assert [one.score for one in ranked] == pytest.approx([0.8, 0.7, 0.8 * 0.85, 0.45])
    assert [one.candidate for one in ranked] == [made[0], made[2], made[1], made[3]]
    assert ranked[1].reachability == 1.0
    assert [one.candidate for one in GraspRanking().rank(made, lambda pose: float(pose is made[2].grasp))] == [made[2]]


def test_reachability_is_asked_no_more_often_than_it_can_matter() -> None:
    made, asked = spread(6, quality=0.5), []
    parameters = GraspRanking(enough=2)
    parameters.rank(made, lambda pose: asked.append(pose) or 1.0)
    assert len(asked) == 2
    asked.clear()
    parameters.rank(made, lambda pose: asked.append(pose) or 0.5)
    assert len(asked) == 6
    batches = []
    parameters.rank(made, reachability_of_all=lambda poses: batches.append(len(poses)) or [1.0] * len(poses))
    assert batches == [2]


def test_the_first_few_are_unlike_each_other_and_the_rest_follows() -> None:
    twins = [candidate(TOOL, 0.9), candidate(TOOL, 0.8), *spread(3, quality=0.7)[1:]]
    ranked = [one.candidate for one in GraspRanking(different=2).rank(twins)]
    assert ranked == [twins[0], twins[2], twins[1], twins[3]]
