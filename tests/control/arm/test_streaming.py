"""What streams tool poses to an arm: small steps, guarded moves, and how either ends; an arm without physics."""

from __future__ import annotations

import math

import numpy as np
import pytest

from bestman_bt.control.arm.arm_controller import ArmController, ArmMoving
from bestman_bt.control.arm.constraint_following import FollowGoal
from bestman_bt.control.arm.guarded_move import Guarding, Streaming, StreamStep, ToolStream
from bestman_bt.messages import Failure, MotionErrorCode, Pose
from hal.api import CommandRefusedError, MotionStatus, NoDataError, NotConnectedError, RobotStoppedError
from tests.control.arm.gantry import START, AtWork, Gantry, spring
from tests.control.scripted_parts import ScriptedArm
from tests.robot_models import arm_model

ALONG = np.array([0.6, -0.64, 0.48])


def stream(velocity: float = 2.0, **parameters) -> tuple[ToolStream, ScriptedArm, Gantry]:
    arm, kinematics = ScriptedArm(START, velocity), Gantry()
    return ToolStream(arm, kinematics, Streaming(**parameters)), arm, kinematics


def moved(pose: Pose, x: float, y: float = 0.0) -> Pose:
    return Pose(pose.position + np.array([x, y, 0.0]), pose.quaternion)


@pytest.mark.parametrize("axis", range(7))
def test_a_step_that_any_joint_would_take_too_fast_is_not_sent(axis):
    # 0.6 of 2 rad/s for a sixtieth of a second: 0.02 rad.
    for share, step in ((0.99, StreamStep.SENT), (1.01, StreamStep.TOO_FAST)):
        sent, arm, kinematics = stream()
        target = START.copy()
        target[axis] -= 0.02 * share
        kinematics.track = lambda pose, start, target=target: target
        assert sent.send(sent.pose) is step
        assert len(arm.sent) == (step is StreamStep.SENT)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_step_that_a_joint_would_have_to_accelerate_too_much_for_is_not_sent(sign):
    sent, arm, _ = stream()
    arm.model = arm_model(arm.joint_names, velocity=2.0, acceleration=5.0)  # 1.389 mm more than the step before
    sent = ToolStream(arm, Gantry())
    for way, step in ((1.3, "sent"), (4.1, "too fast"), (3.9, "sent"), (4.2, "sent")):  # the last one: slower again
        assert sent.send(moved(Pose(START[:3], sent.pose.quaternion), sign * way / 1000)).value == step
    assert len(arm.sent) == 3


def test_a_posture_far_off_is_approached_with_a_third_of_the_acceleration_and_leaves_the_rest_to_the_tool():
    arm = ScriptedArm(START, 2.0)
    arm.model = arm_model(arm.joint_names, velocity=2.0, acceleration=5.0)  # 1.389 mrad more than the step before
    posture = START.copy()
    posture[6] += 1.0  # the gantry's seventh joint moves no tool
    sent = ToolStream(arm, Gantry())
    assert sent.send(moved(sent.pose, 0.0013), posture) is StreamStep.SENT
    assert arm.sent[-1][6] - START[6] == pytest.approx(0.001389 / 3, rel=0.01)
    for _ in range(20):
        assert sent.send(moved(sent.pose, 0.0013), posture) is StreamStep.SENT
    assert arm.sent[-1][6] - START[6] > 0.01


def test_a_refused_pose_leaves_the_stream_where_it_was_and_a_sent_one_takes_it_on():
    sent, arm, kinematics = stream()
    first = sent.pose
    assert sent.send(moved(first, 0.5)) is StreamStep.TOO_FAST
    assert sent.pose is first
    kinematics.reachable = lambda place: place[0] < 0.41
    assert sent.send(moved(first, 0.015)) is StreamStep.UNREACHABLE
    assert sent.pose is first
    for k in range(1, 4):  # each from the one before, not from the first
        assert sent.send(moved(first, 0.003 * k, 0.019 * k)) is StreamStep.SENT
    assert sent.pose.position == pytest.approx(first.position + np.array([0.009, 0.057, 0.0]))
    assert len(arm.sent) == 3


def test_towards_a_singularity_it_goes_no_further_and_away_from_one_it_may():
    for first, second, step in ((0.02, 0.009, False), (0.02, 0.011, True), (0.005, 0.006, True), (0.005, 0.004, False)):
        arm, kinematics = ScriptedArm(START), Gantry()
        kinematics.measure = lambda place, first=first, second=second: first if place[0] < 0.401 else second
        sent = ToolStream(arm, kinematics)
        result = sent.send(moved(sent.pose, 0.01))
        assert result is (StreamStep.SENT if step else StreamStep.UNREACHABLE), (first, second)


def test_a_posture_is_neared_by_what_moves_the_tool_not_at_all_and_no_faster_than_a_third():
    sent, arm, _ = stream(posture_rate=3.0)
    posture = START + 1.0
    sent.send(sent.pose, posture)
    assert arm.sent[-1][:6] == pytest.approx(START[:6])
    assert arm.sent[-1][6] - START[6] == pytest.approx(0.02 / 3.0)
    near = START.copy()
    near[6] += 0.02
    sent, arm, _ = stream(posture_rate=3.0)
    sent.send(sent.pose, near)
    assert arm.sent[-1][6] - START[6] == pytest.approx(3.0 / 60.0 * 0.02)


def test_where_the_tool_is_by_its_encoders_need_not_be_where_it_was_sent():
    sent, arm, _ = stream()
    sent.send(moved(sent.pose, 0.01))
    arm.at = START + 0.005
    assert sent.measured().position == pytest.approx(START[:3] + 0.005)
    assert sent.pose.position[0] == pytest.approx(START[0] + 0.01)


def test_a_guarded_move_goes_its_way_in_its_direction_at_its_speed_and_stops_the_arm():
    it = AtWork()
    handle = it.controller.move_until(2.0 * ALONG, 0.05, 0.12, 5.0)
    stops = it.arm.stops
    it.wait(handle)
    assert handle.status is MotionStatus.SUCCEEDED
    assert not handle.result.touched
    assert it.arm.stops == stops + 1
    assert it.tool.position - START[:3] == pytest.approx(0.12 * ALONG, abs=2e-4)
    assert it.tool.quaternion == pytest.approx(it.kinematics.tool_pose(START).quaternion)
    steps = np.linalg.norm(np.diff([START, *it.arm.sent], axis=0), axis=1) * 60.0
    assert steps.max() == pytest.approx(0.05, rel=1e-6)
    changes = np.diff(steps) * 60.0
    assert changes.max() < 0.2 + 1e-6
    assert changes[:-1].min() > -0.45  # it brakes for the end, too
    assert handle.result.distance == pytest.approx(0.12, abs=2e-3)
    sent = len(it.arm.sent)
    it.clock.sleep(0.5)
    assert len(it.arm.sent) == sent


def test_a_guarded_move_sends_no_arm_further_than_asked_however_late_its_encoders_are(monkeypatch):
    it = AtWork()
    monkeypatch.setattr(it.arm, "positions", lambda: [*[START] * 6, *it.arm.sent][len(it.arm.sent)])
    handle = it.wait(it.controller.move_until(ALONG, 0.05, 0.12, 5.0))
    assert handle.status is MotionStatus.SUCCEEDED
    assert it.arm.sent[-1][:3] - START[:3] == pytest.approx(0.12 * ALONG, abs=2e-4)


def test_a_guarded_move_stops_at_the_force_that_opposes_it_beyond_what_was_felt_at_the_start():
    weight, wall = np.array([0.0, 3.0, -7.0]) - 6.0 * ALONG, spring(START[:3] + 0.05 * ALONG, -ALONG, 4000.0)
    it = AtWork(lambda pose: weight + wall(pose))
    handle = it.wait(it.controller.move_until(ALONG, 0.03, 0.3, 8.0))
    assert handle.result.touched
    assert 8.0 <= float(handle.result.force @ -ALONG) < 14.0
    assert handle.result.distance == pytest.approx(float((handle.result.tool.position - START[:3]) @ ALONG))
    assert 0.051 < handle.result.distance < 0.056


ASIDE = np.cross(ALONG, [0.0, 0.0, 1.0])


@pytest.mark.parametrize("direction", [ALONG, ASIDE / np.linalg.norm(ASIDE)], ids=["along", "aside"])
@pytest.mark.parametrize(("force", "touched"), [(11.5, False), (12.5, True)])
def test_what_pushes_along_or_aside_ends_a_guarded_move_at_one_and_a_half_times_its_force(direction, force, touched):
    it = AtWork(lambda pose: force * direction if pose.position[0] > START[0] + 0.01 else np.zeros(3))
    assert it.wait(it.controller.move_until(ALONG, 0.05, 0.1, 8.0)).result.touched is touched


def test_on_its_blind_way_a_guarded_move_looks_at_no_force():
    for blind, touched in ((0.0, True), (0.06, False)):

        def bump(pose):
            return -30.0 * ALONG if 0.01 < (pose.position - START[:3]) @ ALONG < 0.05 else np.zeros(3)

        it = AtWork(bump, moving=ArmMoving(guarded=Guarding(blind_way=blind)))
        assert it.wait(it.controller.move_until(ALONG, 0.05, 0.1, 8.0)).result.touched == touched


def test_a_guarded_move_that_can_go_no_further_reports_how_far_it_came():
    it = AtWork()
    it.kinematics.reachable = lambda place: float((place - START[:3]) @ ALONG) < 0.05
    handle = it.wait(it.controller.move_until(ALONG, 0.05, 0.2, 8.0))
    assert (handle.status, handle.failure.code) == (MotionStatus.FAILED, MotionErrorCode.UNREACHABLE)
    assert handle.result.distance == pytest.approx(0.05, abs=1e-3)
    assert "0.05" in handle.failure.text or "0.049" in handle.failure.text
    assert not handle.result.touched


def test_where_a_joint_would_be_too_fast_a_guarded_move_goes_more_slowly():
    it = AtWork(velocity=0.2)  # 2 mm a step at most, a fifth of what is asked
    handle = it.wait(it.controller.move_until(np.array([1.0, 0.0, 0.0]), 0.5, 0.1, 8.0))
    assert handle.status is MotionStatus.SUCCEEDED
    assert np.abs(np.diff([START, *it.arm.sent], axis=0)).max() <= 0.6 * 0.2 / 60.0 + 1e-9


@pytest.mark.parametrize("how", ["cancel", "stop"])
def test_a_stream_that_is_cancelled_stops_the_arm_sends_nothing_more_and_a_new_one_begins(how):
    it = AtWork()
    handle = it.controller.move_until(ALONG, 0.05, 0.3, 5.0)
    it.clock.sleep(0.5)
    sent, stops = len(it.arm.sent), it.arm.stops
    handle.cancel() if how == "cancel" else it.controller.stop()
    assert it.arm.stops == stops + 1
    assert handle.failure.code is (MotionErrorCode.CANCELED if how == "cancel" else MotionErrorCode.STOPPED)
    it.clock.sleep(0.5)
    assert (len(it.arm.sent), it.arm.stops) == (sent, stops + 1)
    before = it.tool.position
    second = it.wait(it.controller.move_until(-ALONG, 0.05, 0.02, 5.0))
    assert second.status is MotionStatus.SUCCEEDED
    assert it.tool.position - before == pytest.approx(-0.02 * ALONG, abs=2e-4)
    stops = it.arm.stops
    handle.cancel()
    second.cancel()
    assert it.arm.stops == stops


@pytest.mark.parametrize("newer", ["follow", "move_to", "move_until"])
def test_a_newer_command_supersedes_a_stream_which_then_sends_nothing(newer):
    it = AtWork()
    handle = it.controller.move_until(ALONG, 0.05, 0.3, 5.0)
    it.clock.sleep(0.5)
    sent = len(it.arm.sent)
    commands = {
        "follow": lambda: it.controller.follow(None),
        "move_to": lambda: it.controller.move_to(START),
        "move_until": lambda: it.controller.move_until(-ALONG, 0.05, 0.3, 5.0),
    }
    second = commands[newer]()
    assert (handle.status, handle.failure.code) == (MotionStatus.CANCELED, MotionErrorCode.SUPERSEDED)
    it.clock.sleep(0.3)
    assert not second.done
    if newer != "move_until":
        assert len(it.arm.sent) == sent
        handle.cancel()
        assert not second.done, "the older handle no longer stops the arm"


def test_a_stream_ends_a_motion_that_is_under_way():
    it = AtWork()
    first = it.controller.move_to(START + 0.1)
    it.controller.move_until(ALONG, 0.05, 0.1, 5.0)
    assert first.status is MotionStatus.CANCELED


@pytest.mark.parametrize(
    ("error", "status", "code"),
    [
        (RobotStoppedError("gone", "arm", "C31"), MotionStatus.CANCELED, MotionErrorCode.STOPPED),
        (CommandRefusedError("gone", "arm", "C31"), MotionStatus.FAILED, MotionErrorCode.REFUSED),
        (NotConnectedError("gone", "arm", "C31"), MotionStatus.FAILED, MotionErrorCode.DISCONNECTED),
    ],
)
def test_a_stream_ends_with_the_arm_and_leaves_no_timer(error, status, code):
    it = AtWork()
    handle = it.controller.move_until(ALONG, 0.05, 0.3, 5.0)
    it.clock.sleep(0.3)
    it.arm.error = error
    it.clock.sleep(0.1)
    assert (handle.status, handle.failure) == (status, Failure(code, "gone", "arm", "C31"))
    it.arm.error, sent = None, len(it.arm.sent)
    it.clock.sleep(0.3)
    assert len(it.arm.sent) == sent


def test_a_wrist_that_falls_silent_ends_a_stream_and_stops_the_arm():
    it = AtWork()
    handle = it.controller.move_until(ALONG, 0.05, 0.3, 5.0)
    it.clock.sleep(0.3)
    stops = it.arm.stops
    it.wrist.error = NoDataError("silent")
    it.clock.sleep(0.1)
    assert handle.failure.code is MotionErrorCode.NO_DATA
    assert it.arm.stops == stops + 1


def guarded(guard, begin="move_to"):
    it = AtWork()
    if begin == "move_to":
        return it, it.controller.move_to(START, guard=guard)
    return it, it.controller.follow(None, guard)


@pytest.mark.parametrize("begin", ["move_to", "follow"])
def test_a_guard_is_asked_until_it_objects_and_then_the_arm_is_stopped(begin):
    asked, answer = [], [None]
    it, handle = guarded(lambda: asked.append(1) or answer[0], begin)
    it.clock.sleep(0.5)
    assert 9 <= len(asked) <= 10
    answer[0] = "it slipped"
    it.clock.sleep(0.06)
    assert (handle.status, handle.failure.code) == (MotionStatus.FAILED, MotionErrorCode.GUARDED)
    assert (handle.failure.text, it.arm.stops) == ("it slipped", 1)
    count = len(asked)
    it.clock.sleep(0.5)
    assert (len(asked), it.arm.stops) == (count, 1)


def test_a_guard_whose_readings_fail_ends_the_motion_and_stops_the_arm():
    def guard():
        raise NoDataError("the gripper is silent")

    it, handle = guarded(guard)
    it.clock.sleep(0.06)
    assert (handle.failure.code, handle.failure.text) == (MotionErrorCode.NO_DATA, "the gripper is silent")
    assert it.arm.stops == 1


def test_a_guard_of_a_motion_that_has_ended_is_asked_no_more_and_stops_nothing():
    asked = []
    it, handle = guarded(lambda: asked.append(1) or (None if len(asked) < 3 else "too late"))
    it.clock.sleep(0.11)
    second = it.controller.move_to(START)
    count = len(asked)
    it.clock.sleep(0.5)
    assert handle.failure.code is MotionErrorCode.SUPERSEDED
    assert (len(asked), it.arm.stops) == (count, 0)
    assert not second.done


def test_a_command_that_is_refused_is_not_watched():
    it = AtWork()
    it.arm.error = CommandRefusedError("no")
    asked = []
    handle = it.controller.move_to(START, guard=lambda: asked.append(1))
    it.clock.sleep(0.3)
    assert (handle.failure.code, asked) == (MotionErrorCode.REFUSED, [])


@pytest.mark.parametrize(
    ("direction", "values", "named"),
    [
        ((0.0, 0.0, 0.0), (0.05, 0.1, 5.0), "direction"),
        ((0.0, math.nan, 1.0), (0.05, 0.1, 5.0), "direction"),
        ((1.0, 0.0), (0.05, 0.1, 5.0), "direction"),
        ((1.0, 0.0, 0.0), (0.0, 0.1, 5.0), "speed"),
        ((1.0, 0.0, 0.0), (0.05, -0.1, 5.0), "max_distance"),
        ((1.0, 0.0, 0.0), (0.05, 0.1, math.nan), "stop_force"),
    ],
)
def test_a_guarded_move_that_makes_no_sense_is_refused_and_leaves_alone_what_is_under_way(direction, values, named):
    it = AtWork()
    first = it.controller.move_to(START)
    with pytest.raises(ValueError, match=named):
        it.controller.move_until(direction, *values)
    assert not first.done
    assert it.arm.stops == 0


def test_an_arm_without_a_wrist_feels_no_way():
    it = AtWork()
    arm = ArmController(it.arm, it.clock, kinematics=it.kinematics)
    with pytest.raises(ValueError, match="force-torque"):
        arm.move_until(ALONG, 0.05, 0.1, 5.0)
    with pytest.raises(ValueError, match="kinematics"):
        ArmController(it.arm, it.clock, wrist=it.wrist).follow_constraint(ALONG, FollowGoal(distance=0.1))
