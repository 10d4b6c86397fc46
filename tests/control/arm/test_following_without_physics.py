"""Following a drawer, a door and nothing at all, felt by scripted forces: forces, ends, turns, guides."""

from __future__ import annotations

import math

import numpy as np
import pytest

from bestman_bt.control.arm.arm_controller import ArmMoving
from bestman_bt.control.arm.constraint_following import FollowedMotion, FollowEnd, FollowGoal, FollowGuide, Following
from bestman_bt.control.arm.joint_axis import JointAxis
from bestman_bt.messages import MotionErrorCode, Pose
from hal.api import Motion, MotionStatus
from tests.control.arm.gantry import START, AtWork

OUT = np.array([-0.6, 0.8, 0.0])
UP = np.array([0.0, 0.0, 1.0])


def drawer(friction: float = 6.0, jam: float = math.inf, side: float = 0.0, stiffness: float = 8000.0):
    """A drawer that slides along OUT with friction, N; at ``jam`` metres it stops. ``side``: N that push aside."""
    place = [0.0]

    def force(pose: Pose) -> np.ndarray:
        off = pose.position - START[:3]
        along = float(off @ OUT)
        place[0] = min(jam, max(place[0], along - friction / stiffness))
        pull = stiffness * (along - place[0])
        across = off - along * OUT
        return -pull * OUT - stiffness * across + side * UP * (along > 0.05)

    return force


def follow(force, direction=OUT, following: Following | None = None, grip=None, hint=None, **goal):
    it = AtWork(force, moving=ArmMoving(following=following or Following()))
    handle = it.controller.follow_constraint(direction, FollowGoal(**{"distance": 0.2} | goal), grip, hint)
    return it, it.wait(handle, 60.0)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_guarded_move_stops_also_where_the_wrist_tells_forces_with_the_other_sign(sign):
    def wall(pose: Pose) -> np.ndarray:
        return -sign * 4000.0 * max(0.0, float((pose.position - START[:3]) @ OUT) - 0.05) * OUT

    it = AtWork(wall)
    handle = it.wait(it.controller.move_until(OUT, 0.03, 0.15, 8.0), 60.0)
    assert handle.status is MotionStatus.SUCCEEDED, handle.failure
    assert handle.result.touched
    assert handle.result.distance < 0.06


def test_a_drawer_is_followed_so_far_and_told_along_which_way_and_with_what_force():
    it, handle = follow(drawer(), direction=OUT + np.array([0.03, 0.0, 0.03]))
    assert handle.status is MotionStatus.SUCCEEDED, handle.failure
    motion = handle.result
    assert motion.end is FollowEnd.REACHED
    assert motion.distance == pytest.approx(0.2, abs=0.01)
    assert motion.axis.kind == "prismatic"
    assert float(motion.axis.direction @ OUT) > 0.998
    assert 5.0 < motion.peak_pull < 8.0
    assert motion.peak_side > 0.1
    assert motion.angle == motion.turned == 0.0
    assert motion.tool.position == pytest.approx(it.tool.position)
    speeds = np.linalg.norm(np.diff(it.arm.sent, axis=0), axis=1) * 60.0
    assert speeds.max() < 0.06 + 0.03


@pytest.mark.parametrize(
    ("jam", "end", "words"), [(0.006, FollowEnd.LOCKED, "locked"), (0.05, FollowEnd.JAMMED, "jammed")]
)
def test_what_does_not_give_way_is_reported_within_the_force_limit(jam, end, words):
    for most in (20.0, 40.0):
        it, handle = follow(drawer(jam=jam), max_pull=most)
        assert (handle.status, handle.failure.code) == (MotionStatus.FAILED, MotionErrorCode.BLOCKED)
        assert handle.result.end is end
        assert words in handle.failure.text
        assert handle.result.peak_pull < 1.1 * most
        # At the end it gives way to what still pulls.
        assert np.linalg.norm(it.wrist.force(it.tool)) < 0.9 * handle.result.peak_pull


@pytest.mark.slow
def test_where_an_end_stop_may_be_met_it_moves_slowly_and_presses_less():
    for stop, most in ((math.inf, 0.06), (0.1, 0.01)):
        it, handle = follow(drawer(jam=0.15), max_pull=30.0, end_stop=stop)
        assert handle.result.end is FollowEnd.JAMMED
        way = np.linalg.norm(it.arm.sent - it.arm.sent[0], axis=1)
        speeds = np.diff(way) * 60.0
        assert speeds[way[1:] > 0.103].max() == pytest.approx(most, abs=1e-3)
        assert speeds[way[1:] < 0.08].max() == pytest.approx(0.06, abs=1e-3)


def test_a_hand_that_gets_no_further_is_jammed_though_it_feels_nothing(monkeypatch):
    it = AtWork()
    way, measured = np.append(OUT, np.zeros(4)), it.arm.positions

    def held_up() -> np.ndarray:
        off = measured() - START
        return START + off - max(0.0, float(off @ way) - 0.05) * way

    monkeypatch.setattr(it.arm, "positions", held_up)
    handle = it.wait(it.controller.follow_constraint(OUT, FollowGoal(distance=0.2)), 60.0)
    assert handle.result.end is FollowEnd.JAMMED
    assert handle.result.distance == pytest.approx(0.05, abs=1e-3)
    assert it.clock.now() < 3.0


@pytest.mark.parametrize(("side", "meets"), [(9.0, False), (16.0, True)])
def test_what_pushes_aside_harder_than_it_may_is_an_obstacle(side, meets):
    def force(pose: Pose) -> np.ndarray:
        return side * UP * (float((pose.position - START[:3]) @ OUT) > 0.05)

    axis = JointAxis("prismatic", START[:3], OUT, 0.0, 0.0)
    _, handle = follow(force, max_side=12.0, axis=axis, learns=False)
    assert (handle.status is MotionStatus.FAILED) == meets
    if meets:
        assert handle.failure.code is MotionErrorCode.COLLISION
        assert handle.result.end is FollowEnd.OBSTACLE
        assert "push the hand aside" in handle.failure.text


def test_a_grip_that_is_lost_ends_it_at_once_with_its_words():
    asked = []
    it, handle = follow(
        drawer(), grip=lambda: "the gripper holds nothing" if asked.append(1) or len(asked) > 60 else None
    )
    assert (handle.status, handle.failure.code) == (MotionStatus.FAILED, MotionErrorCode.GUARDED)
    assert handle.failure.text.startswith("the gripper holds nothing after 0.0")
    assert handle.result.end is FollowEnd.GRIP_LOST
    assert len(asked) == 61
    assert len(it.arm.sent) == 60, "nothing is sent any more"


def test_where_the_arm_can_go_no_further_it_reports_it_and_how_far_it_came():
    it = AtWork(drawer())
    it.kinematics.reachable = lambda place: float((place - START[:3]) @ OUT) < 0.08
    handle = it.wait(it.controller.follow_constraint(OUT, FollowGoal(distance=0.2)))
    assert handle.failure.code is MotionErrorCode.UNREACHABLE
    assert handle.result.end is FollowEnd.ARM_LIMIT
    assert handle.result.distance == pytest.approx(0.08, abs=0.003)


def test_it_has_a_time_limit_that_grows_with_the_way():
    for factor, end in ((4.0, FollowEnd.REACHED), (0.2, FollowEnd.TIMEOUT)):
        _, handle = follow(drawer(), following=Following(time_factor=factor), speed=0.02, distance=0.15)
        assert handle.result.end is end
    assert "s" in handle.failure.text


HINGE, RADIUS = START[:3] + 0.4 * np.array([0.8, 0.6, 0.0]), 0.4


def door(side: float = 1.0, friction: float = 5.0, stiffness: float = 10000.0):
    """A door that the hand holds, about a vertical axis through HINGE."""
    opened = [0.0]

    def force(pose: Pose) -> np.ndarray:
        arm = pose.position - HINGE
        start = START[:3] - HINGE
        angle = math.atan2(start[0] * arm[1] - start[1] * arm[0], float(start[:2] @ arm[:2])) * side
        opened[0] = max(opened[0], angle - friction / stiffness / RADIUS)
        turn = side * opened[0]
        cos, sin = math.cos(turn), math.sin(turn)
        held = HINGE + np.array([cos * start[0] - sin * start[1], sin * start[0] + cos * start[1], 0.0])
        return -stiffness * (pose.position - held)

    return force, opened


@pytest.mark.quick_cases(2)
@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize("turn", [1.0, 0.0])
def test_a_door_is_followed_about_its_hinge_either_way_and_the_hand_turns_with_it_as_asked(side, turn):
    force, opened = door(side)
    direction = side * np.cross(UP, START[:3] - HINGE) / RADIUS
    axis = JointAxis("revolute", HINGE, side * UP, RADIUS, 0.0)
    _, handle = follow(force, direction=direction, distance=math.inf, angle=0.8, turn=turn, axis=axis, learns=False)
    assert handle.status is MotionStatus.SUCCEEDED, handle.failure
    motion = handle.result
    assert motion.axis is axis
    assert motion.angle == pytest.approx(0.8, abs=0.04)
    assert opened[0] == pytest.approx(0.8, abs=0.04)
    assert motion.turned == pytest.approx(turn * motion.angle, abs=0.05)
    yaw = math.atan2(motion.tool.rotation[1, 0], motion.tool.rotation[0, 0]) - 0.5
    assert yaw == pytest.approx(side * motion.turned, abs=0.02)


def test_of_an_angle_and_a_distance_the_one_that_comes_first_ends_it():
    direction = np.cross(UP, START[:3] - HINGE) / RADIUS
    for distance, angle, reached in ((0.15, 0.8, 0.15 / RADIUS), (0.9, 0.5, 0.5)):
        force, opened = door()
        _, handle = follow(force, direction=direction, distance=distance, angle=angle)
        assert handle.result.axis.kind == "revolute"
        assert handle.result.axis.radius == pytest.approx(RADIUS, rel=0.3)
        assert opened[0] == pytest.approx(reached, abs=0.15)


@pytest.mark.slow
def test_a_guide_tells_hand_and_posture_on_the_way_and_what_is_held_need_not_be_the_tool():
    force, _ = door()
    held_at = np.array([0.05, 0.0, 0.02])
    axis = JointAxis("revolute", HINGE, UP, RADIUS, 0.0)
    postures = np.vstack([START, START])
    postures[1, 6] += 0.4
    guide = FollowGuide(np.array([0.0, 0.3]), np.array([0.0, 0.45]), postures, held_at)
    held_start = AtWork().tool.apply(held_at[None])[0]
    moved = held_start - START[:3]

    def at_held(pose: Pose) -> np.ndarray:
        return force(Pose(pose.apply(held_at[None])[0] - moved, pose.quaternion))

    axis = JointAxis("revolute", HINGE + moved, UP, RADIUS, 0.0)
    direction = np.cross(UP, START[:3] - HINGE) / RADIUS
    it, handle = follow(at_held, direction=direction, distance=0.3, turn=1.0, guide=guide, axis=axis, learns=False)
    assert handle.status is MotionStatus.SUCCEEDED, handle.failure
    assert handle.result.turned == pytest.approx(0.45, abs=0.05)
    assert it.arm.at[6] - START[6] == pytest.approx(0.4, abs=0.08)
    held = it.tool.apply(held_at[None])[0]
    assert np.linalg.norm(held - HINGE - moved) == pytest.approx(RADIUS, abs=0.01)


def test_cancelling_a_following_and_a_second_one_after_it():
    it = AtWork(drawer())
    handle = it.controller.follow_constraint(OUT, FollowGoal(distance=0.3))
    it.clock.sleep(1.0)
    stops = it.arm.stops
    handle.cancel()
    sent = len(it.arm.sent)
    it.clock.sleep(0.5)
    assert (it.arm.stops, len(it.arm.sent)) == (stops + 1, sent)
    assert handle.status is MotionStatus.CANCELED
    second = it.wait(it.controller.follow_constraint(OUT, FollowGoal(distance=0.1)))
    assert second.status is MotionStatus.SUCCEEDED
    assert second.result.distance == pytest.approx(0.1, abs=0.01)


@pytest.mark.parametrize(
    ("values", "named"),
    [
        ({"speed": 0.0}, "speed"),
        ({"max_pull": -1.0}, "max_pull"),
        ({"max_side": 0.0}, "max_side"),
        ({"distance": math.inf}, "distance or an angle"),
        ({"distance": -0.1}, "distance"),
        ({"angle": 0.0}, "angle"),
    ],
)
def test_a_following_that_makes_no_sense_is_refused(values, named):
    with pytest.raises(ValueError, match=named):
        FollowGoal(**{"distance": 0.1} | values)


def test_a_guide_needs_increasing_ways_each_with_a_turn_and_a_posture():
    guide = FollowGuide(np.array([0.0, 0.2]), np.array([0.0, 1.0]), np.array([[0.0, 1.0], [2.0, 3.0]]))
    assert guide.turn(0.05) == pytest.approx(0.25)
    assert guide.posture(0.05).tolist() == pytest.approx([0.5, 1.5])
    assert guide.turn(0.25) == pytest.approx(1.25)  # where the true way is longer, the hand goes on as before
    assert guide.posture(0.25).tolist() == pytest.approx([2.5, 3.5])
    for ways, turns, postures in (
        (np.array([0.0]), np.zeros(1), np.zeros((1, 2))),
        (np.array([0.1, 0.1]), np.zeros(2), np.zeros((2, 2))),
        (np.array([0.0, 0.1]), np.zeros(3), np.zeros((2, 2))),
        (np.array([0.0, 0.1]), np.zeros(2), np.zeros((3, 2))),
    ):
        with pytest.raises(ValueError, match="increasing ways"):
            FollowGuide(ways, turns, postures)


def nothing(pose: Pose) -> np.ndarray:
    return np.zeros(3)


def test_it_gathers_speed_and_brakes_before_the_end_of_its_way():
    axis = JointAxis("prismatic", START[:3], OUT, 0.0, 0.0)
    it, handle = follow(nothing, distance=0.12, axis=axis, learns=False)
    assert handle.status is MotionStatus.SUCCEEDED
    along = (np.array([START, *it.arm.sent])[:, :3] - START[:3]) @ OUT
    speed = np.diff(along) * 60.0
    assert speed.max() == pytest.approx(0.06)
    assert np.diff(speed)[:5].max() * 60.0 == pytest.approx(0.1)
    left = np.maximum(0.12 - along[:-1], 0.0)
    assert np.all(speed[left > 1e-3] <= np.sqrt(2 * 0.1 * (left[left > 1e-3] + 2e-3)))


def test_where_a_joint_would_be_too_fast_it_goes_more_slowly():
    it = AtWork(nothing, velocity=0.05)  # half a millimetre a step
    handle = it.wait(it.controller.follow_constraint(OUT, FollowGoal(distance=0.05)))
    assert handle.status is MotionStatus.SUCCEEDED, handle.failure
    assert np.abs(np.diff([START, *it.arm.sent], axis=0)).max() <= 0.6 * 0.05 / 60.0 + 1e-9


def test_what_the_hand_holds_stays_on_its_circle_while_the_hand_turns_about_it():
    held_at = np.array([0.08, -0.03, 0.02])
    held = AtWork().tool.apply(held_at[None])[0]
    hinge = held + np.array([0.3, 0.1, 0.0])
    axis = JointAxis("revolute", hinge, UP, math.hypot(0.3, 0.1), 0.0)
    guide = FollowGuide(np.array([0.0, 0.25]), np.array([0.0, 0.7]), np.vstack([START, START]), held_at)
    direction = np.cross(UP, held - hinge)
    it, handle = follow(nothing, direction=direction, distance=0.3, guide=guide, axis=axis, learns=False)
    assert handle.status is MotionStatus.SUCCEEDED, handle.failure
    assert handle.result.turned == pytest.approx(0.7 * 0.3 / 0.25, abs=0.02)
    places = np.array([it.kinematics.tool_pose(sent).apply(held_at[None])[0] for sent in it.arm.sent])
    assert np.linalg.norm(places - hinge, axis=1) == pytest.approx(axis.radius, abs=1.5e-3)


def turned_along_a_kinked_guide(steep: float) -> tuple[np.ndarray, np.ndarray, Motion[FollowedMotion]]:
    """Ways (N,) and turns (N,) of a hand whose guide begins to turn at once by ``steep`` radians per metre."""
    hinge = START[:3] + np.array([0.3, 0.1, 0.0])
    axis = JointAxis("revolute", hinge, UP, math.hypot(0.3, 0.1), 0.0)
    ways = np.array([0.0, 0.1, 0.2, 0.3])
    guide = FollowGuide(ways, steep * np.array([0.0, 0.0, 0.1, 0.1]), np.vstack([START] * 4))
    it = AtWork(acceleration=6.0, moving=ArmMoving(following=Following(turn_speed=4.0)))
    goal = FollowGoal(distance=0.3, guide=guide, axis=axis, learns=False)
    handle = it.wait(it.controller.follow_constraint(np.cross(UP, START[:3] - hinge), goal), 60.0)
    sent = np.array(it.arm.sent)
    arms = sent[:, :2] - hinge[:2]
    angles = np.unwrap(np.arctan2(arms[:, 1], arms[:, 0]))
    return axis.radius * (angles - angles[0]), sent[:, 5] - START[5], handle


def test_a_hand_whose_guide_begins_to_turn_at_once_gathers_turn_as_its_joints_allow():
    ways, turns, handle = turned_along_a_kinked_guide(12.0)  # 0.012 rad a period, where 0.0017 may be gained
    assert handle.status is MotionStatus.SUCCEEDED, handle.failure
    assert handle.result.turned == pytest.approx(1.2, abs=0.02)
    assert np.abs(turns - np.interp(ways, [0.1, 0.2], [0.0, 1.2])).max() < 0.2


def test_a_hand_that_cannot_turn_as_fast_as_its_guide_goes_slower_and_keeps_to_it():
    ways, turns, handle = turned_along_a_kinked_guide(25.0)  # 1.5 rad/s at full speed, above what the joint may do
    assert handle.status is MotionStatus.SUCCEEDED, handle.failure
    assert np.abs(turns - np.interp(ways, [0.1, 0.2], [0.0, 2.5])).max() < 0.25
