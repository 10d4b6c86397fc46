"""Joints and arms over a channel: set-points within limits, stops in time, what fails a motion and what does not."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from bestman_bt.messages import JointTrajectory
from bestman_bt.robot_model.connection_config import SafetyConfig, WorkspaceConfig
from bestman_bt.robot_model.model import ArmModel, RobotModel
from bestman_bt.robot_model.part_fields import ConstraintsConfig, JointConstraint
from hal.api import CommandRefusedError, Failure, MotionErrorCode, MotionStatus, NotConnectedError
from hal.parts.channels import JointChannel, JointReading
from hal.parts.gate import ToolLimits
from hal.parts.part_connection import ConnectionFailedError
from hal.parts.stop_latch import StopLatch
from hal.parts.streamed_arm import StreamedArm
from hal.parts.streamed_joints import StreamedJointGroup
from tests.robot_models import joint_group_model

PERIOD = 0.01
SLOW, STRONG = 0.5, 1.0
"""rad/s² and rad/s."""
MODEL = joint_group_model(
    ("pan", "tilt"),
    lower=(-2.0, -1.0),
    upper=(2.0, 1.5),
    velocity=(STRONG, STRONG),
    acceleration=(SLOW, SLOW),
    effort=(10.0, 10.0),
)


class Joints(JointChannel):
    """Joints that are where they were last sent plus ``off``, at a speed of ``tremble``; they stand while paused."""

    def __init__(self, count: int, stream_at_rest: bool = False) -> None:
        self.at, self.off = np.zeros(count), np.zeros(count)
        self.tremble, self.old, self.share = 0.0, 0.0, 1.0
        self.sent: list[tuple[np.ndarray, np.ndarray]] = []
        self.stream_at_rest = stream_at_rest

    @property
    def age(self) -> float:
        return self.old

    @property
    def scaling(self) -> float:
        return self.share

    def read(self) -> JointReading:
        count = len(self.at)
        return JointReading(self.at + self.off, np.full(count, self.tremble), np.zeros(count))

    def send(self, positions: np.ndarray, velocities: np.ndarray) -> None:
        if self.share > 0.0:
            self.at = positions.copy()
        self.sent.append((positions.copy(), velocities.copy()))


@pytest.fixture
def latch() -> StopLatch:
    return StopLatch()


@pytest.fixture
def channel() -> Joints:
    return Joints(2)


@pytest.fixture
def group(channel: Joints, latch: StopLatch) -> StreamedJointGroup:
    made = StreamedJointGroup("head", MODEL, channel, latch, PERIOD)
    made.attach()
    return made


def run(group: StreamedJointGroup, seconds: float, elapsed: float = PERIOD) -> None:
    for _ in range(round(seconds / elapsed)):
        group.cycle(elapsed)


def drive(group: StreamedJointGroup, velocities: list[float], seconds: float) -> None:
    """A velocity that is commanded again before it lapses."""
    for _ in range(round(seconds / 0.1)):
        group.command(velocities=velocities)
        run(group, 0.1)


def speed(channel: Joints) -> float:
    """Of the last two set-points, not of what was said about it."""
    (before, _), (after, _) = channel.sent[-2:]
    return float(np.max(np.abs(after - before))) / PERIOD


@pytest.mark.parametrize("halt", ["stop", "brake", "detach"])
def test_a_stop_brakes_within_its_time_harder_than_the_limits_if_need_be(
    group: StreamedJointGroup, channel: Joints, halt: str
) -> None:
    drive(group, [STRONG, -0.5], 1.8)  # 0.9 rad/s at 0.5 rad/s²: within the limits it would take 1.8 s to stop
    assert speed(channel) > 0.8
    getattr(group, halt)()
    assert not group.resting
    run(group, 0.29)
    assert speed(channel) < 0.1
    run(group, 0.05)
    assert speed(channel) == 0.0
    assert group.resting
    sent = len(channel.sent)
    run(group, 0.1)
    assert len(channel.sent) == sent


def test_joints_that_failed_in_motion_brake_as_for_a_stop_and_set_off_from_rest(
    group: StreamedJointGroup, channel: Joints, latch: StopLatch
) -> None:
    drive(group, [STRONG, 0.0], 2.0)
    assert speed(channel) > 0.9
    sent = len(channel.sent)
    group.fail(Failure(MotionErrorCode.FAULT, "overcurrent"))
    run(group, 0.4)
    assert group.resting
    rates = np.diff([position[0] for position, _ in channel.sent[sent - 2 :]]) / PERIOD
    assert np.max(np.abs(np.diff(rates))) <= 1.01 * PERIOD * STRONG / 0.3  # 0.3 s from its top speed
    assert rates[-1] == 0.0
    place = channel.at.copy()
    group.move_to(place - [0.1, 0.0])
    run(group, 5 * PERIOD)
    assert channel.sent[-1][1][0] < 0.0  # and not on as it went before
    assert channel.at[0] <= place[0]


def test_a_slow_joint_brakes_within_its_limits(group: StreamedJointGroup, channel: Joints) -> None:
    group.command(velocities=[0.1, 0.0])
    run(group, 0.5)
    group.stop()
    run(group, 0.21)
    assert speed(channel) == pytest.approx(0.0, abs=0.01)
    velocities = np.array([velocity[0] for _, velocity in channel.sent])
    assert np.max(np.abs(np.diff(velocities))) <= SLOW * PERIOD + 1e-9


def test_a_stopped_motion_is_told_why_and_a_part_alone_can_be_stopped(
    group: StreamedJointGroup, latch: StopLatch
) -> None:
    first = group.move_to([1.0, 0.0])
    group.stop()
    assert first.failure is not None
    assert first.failure.code is MotionErrorCode.STOPPED
    second = group.move_to([1.0, 0.0])
    latch.set(Failure(MotionErrorCode.COLLISION, "the base hit a wall"))
    group.stop()
    assert second.status is MotionStatus.CANCELED
    assert "the base hit a wall" in str(second.failure)
    for command in (lambda: group.move_to([0, 0]), lambda: group.command([0, 0])):
        with pytest.raises(CommandRefusedError, match="the base hit a wall"):
            command()


def test_set_points_keep_to_the_limits_and_arrive(group: StreamedJointGroup, channel: Joints) -> None:
    motion = group.move_to([1.5, -0.3], 0.5)
    run(group, 8.0)
    assert motion.status is MotionStatus.SUCCEEDED
    assert channel.at == pytest.approx([1.5, -0.3])
    places = np.array([position for position, _ in channel.sent])
    rates = np.diff(places, axis=0) / PERIOD
    assert np.max(np.abs(rates)) <= 0.5 * STRONG + 1e-6
    assert np.max(np.abs(np.diff(rates, axis=0))) <= 0.5 * SLOW * PERIOD + 1e-6


def test_a_newer_command_brakes_first_and_the_older_motion_is_superseded(
    group: StreamedJointGroup, channel: Joints
) -> None:
    older = group.move_to([1.5, 0.0])
    run(group, 1.0)
    newer = group.move_to([-1.0, 0.0])
    assert older.failure is not None
    assert older.failure.code is MotionErrorCode.SUPERSEDED
    run(group, 10.0)
    assert newer.status is MotionStatus.SUCCEEDED
    places = np.array([position[0] for position, _ in channel.sent])
    assert np.max(np.abs(np.diff(places, 2))) / PERIOD**2 <= SLOW / 0.3 + 1e-6
    older.cancel()
    assert group.resting


def test_a_late_cycle_is_no_jump_of_the_set_points(group: StreamedJointGroup, channel: Joints) -> None:
    drive(group, [STRONG, 0.0], 2.0)
    before = channel.at[0]
    group.cycle(0.4)
    assert 0.0 < channel.at[0] - before <= 3 * PERIOD * STRONG + 1e-9


def test_set_points_that_are_held_up_fail_the_motion_and_a_single_delay_does_not(
    group: StreamedJointGroup, channel: Joints
) -> None:
    motion = group.move_to([2.0, 0.0], 0.1)
    for _ in range(5):
        group.cycle(0.4)
        run(group, 3.0)  # of which seven eighths are forgotten
    assert not motion.done
    group.cycle(0.4)
    assert not motion.done
    group.cycle(0.4)
    assert motion.failure is not None
    assert motion.failure.code is MotionErrorCode.TIMEOUT
    assert "held up" in motion.failure.text
    run(group, 0.5)
    assert group.resting
    again = group.move_to([2.0, 0.0], 0.1)
    group.cycle(0.4)  # counted anew
    assert not again.done


@pytest.mark.parametrize(("off", "fails"), [(0.149, False), (0.151, True), (-0.151, True)])
def test_joints_that_do_not_follow_fail_the_motion_and_the_set_points_go_back_to_where_they_are(
    group: StreamedJointGroup, channel: Joints, off: float, fails: bool
) -> None:
    motion = group.move_to([1.5, 0.0])
    run(group, 0.5)
    channel.off = np.array([0.0, off])
    run(group, 0.14)
    assert not motion.done
    run(group, 0.03)
    assert motion.done is fails
    if fails:
        assert motion.failure is not None
        assert motion.failure.code is MotionErrorCode.TRACKING
        assert "tilt" in motion.failure.text
        held = channel.read().positions
        for _ in range(200):  # held up where they are
            channel.off = held - channel.at
            group.cycle(PERIOD)
        assert group.resting
        assert channel.at[1] == pytest.approx(held[1], abs=0.002)
        places = np.array([position for position, _ in channel.sent])
        assert np.max(np.abs(np.diff(places, axis=0))) <= STRONG * PERIOD * (1 + 1e-6)  # no jump


def test_joints_that_are_astray_now_and_then_go_on_and_unknown_places_are_no_error(
    group: StreamedJointGroup, channel: Joints
) -> None:
    motion = group.move_to([1.5, 0.0])
    for _ in range(4):
        channel.off = np.array([0.3, 0.0])
        run(group, 0.1)
        channel.off = np.zeros(2)
        run(group, 0.05)
    channel.off, channel.old = np.array([0.3, 0.0]), 0.11  # nobody knows
    run(group, 0.5)
    assert not motion.done
    channel.old = 0.09
    run(group, 0.2)
    assert motion.done


@pytest.mark.parametrize(
    ("off", "tremble", "settles"),
    [(0.0049, 0.0, True), (0.0051, 0.0, False), (-0.0051, 0.0, False), (0.0, 0.029, True), (0.0, -0.031, False)],
)
def test_a_motion_succeeds_when_the_joints_have_settled(
    group: StreamedJointGroup, channel: Joints, off: float, tremble: float, settles: bool
) -> None:
    channel.off, channel.tremble = np.array([0.0, off]), tremble
    motion = group.move_to([0.1, 0.0])
    run(group, 2.5)
    assert motion.done is settles
    run(group, 0.7)
    assert motion.status is (MotionStatus.SUCCEEDED if settles else MotionStatus.FAILED)
    assert group.resting
    if not settles:
        channel.off, channel.tremble = np.array([0.0, 0.0051]), 0.0
        again = group.move_to([0.1, 0.0])
        run(group, 1.0)  # it waits anew
        assert not again.done


def test_each_joint_has_tolerances_of_its_own_on_the_way_and_at_the_goal(latch: StopLatch) -> None:
    constraints = ConstraintsConfig(
        trajectory=0.1, goal_time=0.5, joints={"tilt": JointConstraint(trajectory=0.3, goal=0.02)}
    )
    model = replace(MODEL, part=replace(MODEL.part, constraints=constraints))
    for off, failed in (([0.0, 0.25], None), ([0.0, 0.35], "tilt is 0.350 off"), ([0.12, 0.0], "pan is 0.120 off")):
        channel = Joints(2)
        group = StreamedJointGroup("head", model, channel, latch, PERIOD)
        group.attach()
        motion = group.move_to([0.6, 0.6])
        run(group, 0.5)
        channel.off = np.array(off)
        run(group, 1.0)
        assert (motion.failure is None) == (failed is None)
        assert failed is None or (motion.failure is not None and failed in motion.failure.text)
    for off, failed in (([0.004, 0.015], None), ([0.006, 0.0], "pan is 0.0060 off, its tolerance is 0.005")):
        channel = Joints(2)
        group = StreamedJointGroup("head", model, channel, latch, PERIOD)
        group.attach()
        channel.off = np.array(off)
        motion = group.move_to([0.2, 0.2])
        run(group, 3.0)
        assert motion.done
        assert (motion.failure is None) == (failed is None)
        assert failed is None or (motion.failure is not None and failed in motion.failure.text)


@pytest.mark.parametrize(("off", "start"), [(0.06, 0.06), (0.04, 0.0), (-0.06, -0.06)])
def test_joints_that_were_moved_by_hand_go_on_from_there(
    group: StreamedJointGroup, channel: Joints, off: float, start: float
) -> None:
    for rest in (0.0, 0.5):
        channel.at = np.array([rest, 0.0])
        group.attach()
        channel.off = np.array([off, 0.0])
        group.command(positions=[1.0, 0.0])
        channel.off = np.zeros(2)
        group.cycle(PERIOD)
        assert channel.at[0] == pytest.approx(rest + start, abs=0.001)


def test_what_holds_streams_only_for_controllers_that_want_it(latch: StopLatch) -> None:
    for wants in (False, True):
        channel = Joints(2, stream_at_rest=wants)
        group = StreamedJointGroup("head", MODEL, channel, latch, PERIOD)
        group.attach()
        run(group, 0.1)
        assert len(channel.sent) == (10 if wants else 0)


def test_a_fault_ends_set_points_and_one_of_the_wire_ends_readings_until_it_is_attached_again(
    group: StreamedJointGroup, channel: Joints
) -> None:
    for code, readable in ((MotionErrorCode.COLLISION, True), (MotionErrorCode.DISCONNECTED, False)):
        motion = group.move_to([1.0, 0.0])
        run(group, 1.0)
        group.fail(Failure(code, "something happened", vendor_code="C1"))
        assert motion.status is MotionStatus.FAILED
        assert motion.failure is not None
        assert motion.failure.code is code
        assert group.resting is not readable  # one that cannot be reached is sent no more
        group.give_way()  # the controller has stopped the joints itself
        assert group.resting
        sent = len(channel.sent)
        run(group, 0.2)
        assert len(channel.sent) == sent
        if readable:
            group.positions()
        else:
            for read in (group.positions, group.velocities, group.efforts):
                with pytest.raises(NotConnectedError, match="something happened"):
                    read()
        channel.at = np.array([0.5, 1.4])  # somebody moved them
        group.attach()
        assert group.positions() == pytest.approx([0.5, 1.4])
        group.command(velocities=[0.0, 0.0])
        run(group, 0.05)
        assert channel.at == pytest.approx([0.5, 1.4])  # not where they were before


@pytest.mark.parametrize(("place", "where"), [(1.52, "1.5200"), (-1.02, "-1.0200")])
def test_joints_outside_of_their_range_are_refused_when_they_are_connected(
    latch: StopLatch, channel: Joints, place: float, where: str
) -> None:
    group = StreamedJointGroup("head", MODEL, channel, latch, PERIOD)
    channel.at = np.array([0.0, place])
    with pytest.raises(ConnectionFailedError, match=rf"head: tilt is at {where}.*\[-1.0000, 1.5000\].*move-into"):
        group.attach()
    with pytest.raises(NotConnectedError):
        group.command(velocities=[0.0, 0.0])
    channel.at = np.array([0.0, np.clip(place, -1.005, 1.505)])  # as far as joints at the end of their range sag
    group.attach()
    assert group.positions() == pytest.approx(channel.at)


def test_joints_are_moved_into_their_range_without_a_jump_and_never_farther_out(
    latch: StopLatch, channel: Joints
) -> None:
    group = StreamedJointGroup("head", MODEL, channel, latch, PERIOD)
    channel.at = np.array([0.0, 1.7])
    group.comes_into_limits = True
    group.attach()
    drive(group, [0.0, 0.5], 0.4)
    assert channel.at == pytest.approx([0.0, 1.7])
    motion = group.move_to([0.0, 1.4], 0.1)
    run(group, 8.0)
    assert motion.status is MotionStatus.SUCCEEDED
    places = np.array([position[1] for position, _ in channel.sent])
    assert np.max(np.abs(np.diff(places))) <= 0.1 * STRONG * PERIOD * (1 + 1e-6)
    drive(group, [0.0, 0.5], 1.0)
    assert channel.at[1] == pytest.approx(1.5, abs=1e-3)  # now the range holds


def test_detached_it_refuses_and_its_motion_has_failed(group: StreamedJointGroup) -> None:
    motion = group.move_to([1.0, 0.0])
    group.detach()
    assert motion.failure is not None
    assert motion.failure.code is MotionErrorCode.DISCONNECTED
    for call in (group.positions, lambda: group.move_to([0, 0]), lambda: group.command([0, 0])):
        with pytest.raises(NotConnectedError, match="head"):
            call()
    group.stop()


def test_a_velocity_is_kept_until_a_limit_of_a_joint(group: StreamedJointGroup, channel: Joints) -> None:
    drive(group, [-STRONG, 0.2], 20.0)
    assert channel.at == pytest.approx([-2.0, 1.5], abs=1e-3)
    assert np.min(np.array([place for place, _ in channel.sent])) >= -2.0
    with pytest.raises(CommandRefusedError, match="efforts"):
        group.command(efforts=[1.0, 1.0])
    with pytest.raises(CommandRefusedError, match="got 2"):
        group.command(positions=[0, 0], velocities=[0, 0])


def test_a_velocity_lapses_unless_it_is_commanded_again(group: StreamedJointGroup, channel: Joints) -> None:
    drive(group, [0.1, 0.0], 1.0)
    assert speed(channel) == pytest.approx(0.1)
    run(group, 0.14)  # 0.24 s after the last one
    assert speed(channel) == pytest.approx(0.1)
    run(group, 0.25)
    assert speed(channel) == 0.0
    assert group.resting


HOME = [0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785]


def test_a_velocity_lapses_while_the_controller_is_paused_too(group: StreamedJointGroup, channel: Joints) -> None:
    channel.share = 0.0
    group.command(velocities=[STRONG, 0.0])
    run(group, 0.5)
    channel.share = 1.0
    run(group, 0.5)
    np.testing.assert_array_equal(channel.at, [0.0, 0.0])


@pytest.fixture
def make_arm(robot_model: RobotModel, latch: StopLatch) -> Callable[..., tuple[StreamedArm, Joints]]:
    def make(**safety: Any) -> tuple[StreamedArm, Joints]:
        channel = Joints(7)
        channel.at = np.array(HOME)
        tool = ToolLimits(robot_model, "arm", SafetyConfig(**safety))
        arm = StreamedArm("arm", robot_model.of(ArmModel)["arm"], channel, latch, PERIOD, tool)
        arm.attach()
        return arm, channel

    return make


def sideways(angle: float) -> np.ndarray:
    return np.array(HOME) + np.array([angle, 0, 0, 0, 0, 0, 0])


def way(arm: StreamedArm, angle: float, duration: float) -> JointTrajectory:
    times = np.linspace(0.0, duration, 21)
    share = 3 * (times / duration) ** 2 - 2 * (times / duration) ** 3
    rate = 6 * times * (duration - times) / duration**3
    turn = sideways(angle) - np.array(HOME)
    return JointTrajectory(arm.joint_names, times, np.array(HOME) + share[:, None] * turn, rate[:, None] * turn)


def fastest_tool(arm: StreamedArm, channel: Joints, model: RobotModel) -> float:
    tool = ToolLimits(model, "arm", SafetyConfig())
    places = np.array([tool.tool(place) for place, _ in channel.sent])
    return float(np.max(np.linalg.norm(np.diff(places, axis=0), axis=1))) / PERIOD


def test_no_command_makes_the_tool_faster_than_its_limit(
    make_arm: Callable[..., tuple[StreamedArm, Joints]], robot_model: RobotModel
) -> None:
    for command in ("move_to", "follow"):
        arm, channel = make_arm(tool_speed=0.1)
        motion = arm.move_to(sideways(0.6)) if command == "move_to" else arm.follow(way(arm, 0.6, 1.0))
        run(arm, 6.0)
        assert motion.status is MotionStatus.SUCCEEDED
        assert 0.09 < fastest_tool(arm, channel, robot_model) < 0.105
        assert channel.at == pytest.approx(sideways(0.6))
    arm, channel = make_arm(tool_speed=0.1)
    arm.move_to(sideways(0.05))  # too short for the joint's top speed
    run(arm, 3.0)
    assert 0.09 < fastest_tool(arm, channel, robot_model) < 0.105
    arm, _ = make_arm(tool_speed=0.1)
    with pytest.raises(CommandRefusedError, match="faster than its limit"):
        arm.servo(sideways(0.05))
    arm.servo(sideways(0.001))


def test_a_slowed_trajectory_reports_its_own_time(make_arm: Callable[..., tuple[StreamedArm, Joints]]) -> None:
    arm, channel = make_arm(tool_speed=0.1)
    trajectory = way(arm, 0.6, 1.0)
    assert arm.trajectory_time() is None
    arm.follow(trajectory)
    run(arm, 1.0)
    channel.old = 0.05
    told = arm.trajectory_time()
    assert told is not None
    ahead = trajectory.sample(told)[0][0]
    assert ahead == pytest.approx(channel.at[0], abs=0.02)
    assert ahead < channel.at[0]  # what is read is older than what was sent
    run(arm, 6.0)
    assert arm.trajectory_time() is None
    held = np.array([channel.at, channel.at])
    arm.follow(JointTrajectory(arm.joint_names, np.array([0.0, 20.0]), held, 0.0 * held))
    run(arm, 1.0)
    assert arm.trajectory_time() == pytest.approx(0.95)  # the pace is that of each trajectory


def test_a_trajectory_of_one_sample_holds_the_arm_there(make_arm: Callable[..., tuple[StreamedArm, Joints]]) -> None:
    arm, channel = make_arm(tool_speed=0.1)
    there = np.array([HOME[0] + 0.02, *HOME[1:]])
    motion = arm.follow(JointTrajectory(arm.joint_names, np.zeros(1), there[None], np.zeros((1, 7))))
    run(arm, 1.0)
    assert motion.status is MotionStatus.SUCCEEDED
    assert channel.at == pytest.approx(there)


def test_a_slowed_trajectory_keeps_its_way_between_its_samples(
    make_arm: Callable[..., tuple[StreamedArm, Joints]],
) -> None:
    arm, channel = make_arm(tool_speed=0.1)
    positions, velocities = np.tile(HOME, (3, 1)), np.zeros((3, 7))
    positions[1:, 0] += (0.2, 0.4)
    positions[2, 3] += 0.3
    velocities[1, [0, 3]] = 0.4, 0.3
    trajectory = JointTrajectory(arm.joint_names, np.array([0.0, 0.5, 1.0]), positions, velocities)
    arm.follow(trajectory)
    run(arm, 8.0)
    np.testing.assert_allclose(channel.at, positions[-1], atol=1e-6)
    dense = np.array([trajectory.sample(time)[0] for time in np.linspace(0.0, 1.0, 2001)])
    away = [np.linalg.norm(dense - place, axis=1).min() for place, _ in channel.sent[::5]]
    assert max(away) < 2e-3


def test_no_command_leads_the_tool_out_of_its_workspace(
    make_arm: Callable[..., tuple[StreamedArm, Joints]], robot_model: RobotModel
) -> None:
    place = ToolLimits(robot_model, "arm", SafetyConfig()).tool(np.array(HOME))
    strip = WorkspaceConfig((-1.0, place[1] - 0.05, 0.0), (1.0, place[1] + 0.05, 2.0))
    arm, channel = make_arm(workspace=strip)
    for command in (
        lambda: arm.move_to(sideways(0.8)),
        lambda: arm.command(positions=sideways(0.8)),
        lambda: arm.follow(way(arm, 0.8, 5.0)),
        lambda: arm.follow(way(arm, -0.8, 5.0)),
    ):
        with pytest.raises(CommandRefusedError, match="workspace"):
            command()
    drive(arm, list(sideways(0.5) - np.array(HOME)), 3.0)
    run(arm, 0.5)
    assert arm.resting
    reached = ToolLimits(robot_model, "arm", SafetyConfig()).tool(channel.at)
    assert 0.045 < reached[1] - place[1] <= 0.0501
    streamed, _ = make_arm(workspace=strip, joint_speed=1.0)
    run(streamed, 0.2)
    streamed.servo(sideways(0.06))
    run(streamed, 0.2)
    streamed.servo(sideways(0.1))
    run(streamed, 0.2)
    with pytest.raises(CommandRefusedError, match="workspace"):
        streamed.servo(sideways(0.2))


def test_streamed_set_points_take_the_time_between_them(make_arm: Callable[..., tuple[StreamedArm, Joints]]) -> None:
    arm, channel = make_arm()
    limit = arm.model.velocity[0]
    run(arm, 1.0)
    arm.servo(sideways(0.005 * limit))  # after a pause: within a tenth of a second
    run(arm, 0.05)
    assert channel.at[0] == pytest.approx(0.0025 * limit)
    run(arm, 0.1)
    assert channel.at[0] == pytest.approx(0.005 * limit)
    for step, fits in ((1.01, True), (1.04, False), (-1.04, False)):
        arm, channel = make_arm()
        run(arm, 1.0)
        arm.servo(np.array(HOME))
        run(arm, 0.05)
        if fits:
            arm.servo(sideways(step * 0.05 * limit))
        else:
            with pytest.raises(CommandRefusedError, match="would need"):
                arm.servo(sideways(step * 0.05 * limit))


def test_a_trajectory_that_starts_a_little_off_fades_in(
    make_arm: Callable[..., tuple[StreamedArm, Joints]],
) -> None:
    arm, channel = make_arm()
    trajectory = way(arm, 0.3, 2.0)
    off = np.array([0, 0.04, 0, 0, 0, 0, 0])
    channel.at = channel.at + off
    arm.attach()
    motion = arm.follow(trajectory)
    arm.cycle(PERIOD)
    assert channel.at[1] == pytest.approx(HOME[1] + 0.04, abs=0.001)
    run(arm, 0.25)
    assert channel.at[1] == pytest.approx(HOME[1], abs=1e-6)
    run(arm, 3.0)
    assert motion.status is MotionStatus.SUCCEEDED
    far = replace(trajectory, positions=trajectory.positions + np.array([0.351, 0, 0, 0, 0, 0, 0]))
    with pytest.raises(CommandRefusedError, match="within 0.05"):
        arm.follow(far)
    arm, channel = make_arm()
    channel.at = sideways(0.3)  # by hand
    arm.follow(replace(trajectory, positions=trajectory.positions + sideways(0.3) - np.array(HOME)))
    arm.cycle(PERIOD)
    assert channel.at == pytest.approx(sideways(0.3), abs=0.001)


class Torques(Joints):
    """Joints that take efforts, too, and whose sensors tell programs something else than the drives know."""

    takes_efforts = True

    def __init__(self, count: int) -> None:
        super().__init__(count)
        self.exerted: list[np.ndarray] = []
        self.halts = 0

    def halt(self) -> None:
        self.halts += 1
        self.tremble *= 0.9

    def exert(self, efforts: np.ndarray) -> None:
        self.exerted.append(efforts.copy())

    def published(self) -> JointReading:
        reading = self.read()
        return JointReading(reading.positions + 0.1, reading.velocities + 0.2, reading.efforts + 0.3)


def test_efforts_act_at_once_and_end_with_a_stop_from_where_the_joints_are(latch: StopLatch) -> None:
    channel = Torques(2)
    group = StreamedJointGroup("head", MODEL, channel, latch, PERIOD)
    channel.stream_at_rest = True  # also such a controller gets no set-point while efforts act
    group.attach()
    motion = group.move_to([1.0, 0.5])
    run(group, 0.2)
    group.command(efforts=[3.0, -2.0])
    assert motion.status is MotionStatus.CANCELED
    assert channel.exerted[-1] == pytest.approx([3.0, -2.0])
    assert not group.resting
    sent = len(channel.sent)
    channel.off, channel.tremble = np.array([0.4, 0.0]), 0.2  # the torques have moved them
    run(group, 0.3)
    assert len(channel.sent) == sent
    here = channel.read().positions
    group.stop()
    run(group, 5 * PERIOD)
    assert len(channel.sent) == sent
    assert channel.halts == 5  # no set-point before the drives have brought the joints to rest
    assert not group.resting
    channel.off, channel.tremble = np.zeros(2), 0.01
    channel.at = here
    run(group, 0.01)
    assert np.max(np.abs(channel.sent[-1][0] - here)) < 0.01
    run(group, 0.6)
    assert channel.halts == 5
    assert group.resting


def test_efforts_that_are_commanded_anew_end_the_halt_of_earlier_ones(latch: StopLatch) -> None:
    channel = Torques(2)
    group = StreamedJointGroup("head", MODEL, channel, latch, PERIOD)
    group.attach()
    channel.tremble = 0.5
    group.command(efforts=[3.0, -2.0])
    group.stop()
    run(group, 2 * PERIOD)
    group.command(efforts=[1.0, 0.0])
    run(group, 2 * PERIOD)
    assert channel.halts == 2


@pytest.mark.parametrize("speed", [0.3, 2.0 * STRONG], ids=["within the limits", "faster than they allow"])
@pytest.mark.parametrize("braked", [False, True], ids=["while efforts act", "while they are braked"])
@pytest.mark.parametrize(
    "command",
    [
        lambda group: group.command(positions=[1.0, -0.5]),
        lambda group: group.command(velocities=[0.4, -0.4]),
        lambda group: group.move_to([1.0, -0.5]),
    ],
    ids=["positions", "velocities", "move_to"],
)
def test_a_command_after_efforts_starts_from_the_measured_positions_and_velocities(
    latch: StopLatch, command: Callable[[StreamedJointGroup], object], braked: bool, speed: float
) -> None:
    channel = Torques(2)
    group = StreamedJointGroup("head", MODEL, channel, latch, PERIOD)
    group.attach()
    group.command(efforts=[3.0, -2.0])
    run(group, 0.1)
    channel.at, channel.tremble = np.array([0.4, -0.1]), speed  # the efforts have moved them
    if braked:
        group.brake()
        run(group, PERIOD)
    here = channel.read()
    command(group)
    run(group, PERIOD)
    assert len(channel.sent) == 1
    positions, velocities = channel.sent[0]
    hardest = STRONG / 0.3  # braking within the time of a stop
    assert np.all(np.abs(velocities - here.velocities) <= hardest * PERIOD + 1e-9)
    assert positions == pytest.approx(here.positions + here.velocities * PERIOD, abs=hardest * PERIOD**2 + 1e-9)
    run(group, 0.2)
    rates = np.diff([here.positions, *(sent for sent, _ in channel.sent)], axis=0) / PERIOD
    assert np.max(np.abs(np.diff(rates, axis=0))) <= 1.01 * hardest * PERIOD


@pytest.mark.parametrize(
    "wrong", [{"positions": [9.0, 0.0]}, {"velocities": [9.0, 0.0]}], ids=lambda wrong: next(iter(wrong))
)
def test_a_refused_command_leaves_efforts_as_they_are(latch: StopLatch, wrong: dict[str, list[float]]) -> None:
    channel = Torques(2)
    group = StreamedJointGroup("head", MODEL, channel, latch, PERIOD)
    group.attach()
    group.command(efforts=[3.0, -2.0])
    with pytest.raises(CommandRefusedError):
        group.command(**wrong)
    run(group, 0.1)
    assert not channel.sent
    assert not channel.halts


def test_a_refused_servo_leaves_efforts_as_they_are(robot_model: RobotModel, latch: StopLatch) -> None:
    channel = Torques(7)
    channel.at = np.array(HOME)
    tool = ToolLimits(robot_model, "arm", SafetyConfig())
    arm = StreamedArm("arm", robot_model.of(ArmModel)["arm"], channel, latch, PERIOD, tool)
    arm.attach()
    arm.command(efforts=[0.0] * 7)
    with pytest.raises(CommandRefusedError):
        arm.servo(sideways(1.0))
    run(arm, 0.1)
    assert not channel.sent
    assert not channel.halts


def test_the_way_of_a_command_after_efforts_is_checked_from_where_the_joints_are(
    robot_model: RobotModel, latch: StopLatch
) -> None:
    ahead = ToolLimits(robot_model, "arm", SafetyConfig()).tool(np.array(HOME))[0]
    behind = WorkspaceConfig((-1.0, -1.0, 0.0), (ahead - 0.02, 1.0, 2.0))
    tool, channel = ToolLimits(robot_model, "arm", SafetyConfig(workspace=behind)), Torques(7)
    channel.at = sideways(-0.8)
    arm = StreamedArm("arm", robot_model.of(ArmModel)["arm"], channel, latch, PERIOD, tool)
    arm.attach()
    arm.command(positions=sideways(-0.7))  # does not pass the boundary ahead
    run(arm, 0.02)
    arm.command(efforts=[0.0] * 7)
    channel.at = sideways(0.8)  # the efforts have moved the arm to the other side
    with pytest.raises(CommandRefusedError, match="workspace"):
        arm.command(positions=sideways(-0.7))


def test_a_reading_that_never_comes_to_rest_does_not_keep_the_joints_from_being_held(latch: StopLatch) -> None:
    class Restless(Torques):
        def halt(self) -> None:
            """The reading goes on trembling."""

    channel = Restless(2)
    group = StreamedJointGroup("head", MODEL, channel, latch, PERIOD)
    group.attach()
    channel.tremble = 0.5
    group.command(efforts=[3.0, -2.0])
    sent = len(channel.sent)
    group.stop()
    run(group, 0.5)
    assert len(channel.sent) == sent
    run(group, 0.2)
    assert len(channel.sent) > sent


def test_a_channel_without_a_halt_of_its_own_holds_the_joints_where_they_are(latch: StopLatch) -> None:
    channel = Torques(2)
    channel.off, channel.tremble = np.array([0.4, -0.1]), 0.5
    JointChannel.halt(channel)
    positions, velocities = channel.sent[-1]
    assert positions == pytest.approx([0.4, -0.1])
    assert not velocities.any()


def test_a_controller_that_connects_anew_holds_the_joints_where_efforts_have_left_them(latch: StopLatch) -> None:
    channel = Torques(2)
    channel.stream_at_rest = True
    group = StreamedJointGroup("head", MODEL, channel, latch, PERIOD)
    group.attach()
    group.command(efforts=[3.0, -2.0])
    channel.at = np.array([0.3, -0.2])
    group.attach()
    assert group.resting
    run(group, PERIOD)
    assert channel.sent[-1][0] == pytest.approx([0.3, -0.2])


@pytest.mark.parametrize("code", [None, MotionErrorCode.DISCONNECTED])
def test_a_controller_that_stops_joints_during_efforts_finds_them_held_where_they_are(
    latch: StopLatch, code: MotionErrorCode | None
) -> None:
    channel = Torques(2)
    channel.stream_at_rest = True
    group = StreamedJointGroup("head", MODEL, channel, latch, PERIOD)
    group.attach()
    group.command(efforts=[3.0, -2.0])
    channel.at = np.array([0.3, -0.2])
    if code is None:
        group.give_way()
    else:
        group.fail(Failure(code, "the cable is out"))
    assert group.resting
    run(group, PERIOD)
    assert channel.sent[-1][0] == pytest.approx([0.3, -0.2])


@pytest.mark.parametrize("efforts", [[11.0, 0.0], [0.0, float("nan")], [1.0]])
def test_efforts_beyond_the_limits_are_refused(latch: StopLatch, efforts: list[float]) -> None:
    channel = Torques(2)
    group = StreamedJointGroup("head", MODEL, channel, latch, PERIOD)
    group.attach()
    with pytest.raises(CommandRefusedError, match="efforts"):
        group.command(efforts=efforts)
    assert not channel.exerted


def test_programs_read_the_sensors_and_the_law_the_drives(latch: StopLatch) -> None:
    channel = Torques(2)
    group = StreamedJointGroup("head", MODEL, channel, latch, PERIOD)
    group.attach()
    motion = group.move_to([0.2, 0.0])
    run(group, 3.0)
    assert motion.status is MotionStatus.SUCCEEDED
    assert group.positions() == pytest.approx([0.3, 0.1], abs=0.005)
    assert group.velocities() == pytest.approx([0.2, 0.2])
    assert group.efforts() == pytest.approx([0.3, 0.3])
    assert channel.sent[-1][0] == pytest.approx([0.2, 0.0])


def test_a_motion_that_the_controller_stopped_on_its_way_has_failed_also_where_nobody_saw_why(
    group: StreamedJointGroup, channel: Joints
) -> None:
    motion = group.move_to([1.0, 0.0])
    run(group, 0.3)
    group.give_way()  # for a moment, in which nobody has looked
    run(group, 3.0)
    assert motion.status is MotionStatus.FAILED
    assert motion.failure is not None
    assert (motion.failure.code, "on their way" in motion.failure.text) == (MotionErrorCode.FAULT, True)
    again = group.move_to([1.0, 0.0])
    run(group, 3.0)
    assert again.status is MotionStatus.SUCCEEDED


def test_a_controller_is_told_the_load_of_the_hand_again_whenever_it_has_connected(
    make_arm: Callable[..., tuple[StreamedArm, Joints]],
) -> None:
    arm, _ = make_arm()
    told: list[float] = []
    arm.send_load = lambda mass, centre: told.append(mass)
    arm.attach()
    assert told == [], "nothing is known of a load yet"
    arm.carry(0.4, (0.0, 0.0, 0.1))
    arm.detach()
    arm.carry(0.3, (0.0, 0.0, 0.1))
    assert told == [0.4], "there is no controller to tell"
    arm.attach()
    arm.carry(0.0, (0.0, 0.0, 0.0))
    arm.attach()
    assert told == [0.4, 0.3, 0.0, 0.0]
