"""The operator's speed: motions slow down, wait and go on along their paths, within the limits of the joints."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from bestman_bt.messages import JointTrajectory
from bestman_bt.robot_model.connection_config import SafetyConfig
from bestman_bt.robot_model.model import ArmModel, RobotModel
from hal.api import MotionStatus
from hal.parts.gate import ToolLimits
from hal.parts.stop_latch import StopLatch
from hal.parts.streamed_arm import StreamedArm
from hal.parts.streamed_joints import StreamedJointGroup
from tests.hal.parts.test_streamed_joints import HOME, MODEL, PERIOD, SLOW, STRONG, Joints

ROOM = 1.02
"""Times its limit up to which a joint may accelerate: path accelerations are those of the step before."""


@pytest.fixture
def channel() -> Joints:
    return Joints(2, stream_at_rest=True)


@pytest.fixture
def group(channel: Joints) -> StreamedJointGroup:
    made = StreamedJointGroup("head", MODEL, channel, StopLatch(), PERIOD)
    made.attach()
    return made


def run(group: StreamedJointGroup, seconds: float, share: Callable[[float], float] = lambda time: 1.0) -> None:
    for step in range(round(seconds / PERIOD)):
        group.speed_share = share(step * PERIOD)
        group.cycle(PERIOD)


def sent(channel: Joints) -> np.ndarray:
    return np.array([positions for positions, _ in channel.sent])


def check_limits(places: np.ndarray, acceleration: float = SLOW, velocity: float = STRONG) -> None:
    speeds = np.diff(places, axis=0) / PERIOD
    assert np.max(np.abs(speeds)) <= velocity * 1.01
    assert np.max(np.abs(np.diff(speeds, axis=0))) / PERIOD <= acceleration * ROOM


def moving(places: np.ndarray) -> float:
    """Seconds that pass between the first and the last step."""
    steps = np.flatnonzero(np.any(np.diff(places, axis=0) != 0.0, axis=1))
    return float(steps[-1] - steps[0]) * PERIOD


@pytest.mark.parametrize("share", [0.3, 0.7])
def test_a_motion_at_a_share_of_its_speed_takes_as_much_longer(
    group: StreamedJointGroup, channel: Joints, share: float
) -> None:
    run(group, 0.1)
    usual = group.move_to([1.0, 0.4])
    run(group, 10.0)
    lasted = moving(sent(channel))
    channel.sent.clear()
    run(group, 0.1, lambda time: share)
    slower = group.move_to([0.0, 0.0])
    run(group, 20.0, lambda time: share)
    assert usual.status is slower.status is MotionStatus.SUCCEEDED
    assert moving(sent(channel)) == pytest.approx(lasted / share, rel=0.02)


def test_a_pause_brakes_on_the_way_and_the_same_motion_goes_on_to_its_end(
    group: StreamedJointGroup, channel: Joints
) -> None:
    motion = group.move_to([1.5, -0.9])
    run(group, 5.0, lambda time: 1.0 if time < 1.0 else 0.0)
    places = sent(channel)
    assert np.array_equal(places[300], places[499])  # it rests
    assert 0.0 < np.linalg.norm(places[300] - places[100]) < 0.5  # after it has braked
    assert not motion.done
    run(group, 8.0)
    assert motion.status is MotionStatus.SUCCEEDED
    places = sent(channel)
    assert places[-1] == pytest.approx([1.5, -0.9], abs=1e-6)
    off = places @ np.array([0.9, 1.5]) / np.hypot(0.9, 1.5)
    assert np.max(np.abs(off)) < 1e-3  # of the straight line
    check_limits(places)


@pytest.mark.quick_cases(2)
@pytest.mark.parametrize("seed", range(6))
def test_whatever_an_operator_sets_trajectories_keep_to_their_path_and_limits(
    robot_model: RobotModel, seed: int
) -> None:
    channel = Joints(7)
    channel.at = np.array(HOME)
    arm = StreamedArm(
        "arm",
        robot_model.of(ArmModel)["arm"],
        channel,
        StopLatch(),
        PERIOD,
        ToolLimits(robot_model, "arm", SafetyConfig()),
    )
    arm.attach()
    rng = np.random.default_rng(seed)
    model, start = arm.model, arm.positions()
    times = np.linspace(0.0, 8.0, 401)[:, None]
    phases, swing = rng.uniform(0.2, 0.5, len(start)), 0.25
    places = start + swing * (1.0 - np.cos(2.0 * np.pi * phases * times)) / 2.0
    speeds = swing * np.pi * phases * np.sin(2.0 * np.pi * phases * times)
    motion = arm.follow(JointTrajectory(arm.joint_names, times[:, 0], places, speeds))
    shares = rng.choice([0.0, 0.05, 0.3, 1.0], 40)
    run(arm, 20.0, lambda time: shares[int(time / 0.5)])
    run(arm, 12.0)
    assert motion.status is MotionStatus.SUCCEEDED
    told = sent(channel)
    off = [np.min(np.max(np.abs(places - place), axis=1)) for place in told[::10]]
    assert max(off) < 0.01  # radians, of the nearest sample
    jerks = np.abs(np.diff(told, n=2, axis=0)) / PERIOD**2 / model.acceleration
    assert np.max(jerks) <= ROOM


def test_a_motion_is_slower_by_the_operators_share_and_by_the_controllers(
    group: StreamedJointGroup, channel: Joints
) -> None:
    run(group, 0.1)
    group.move_to([1.0, 0.4])
    run(group, 10.0)
    lasted = moving(sent(channel))
    channel.sent.clear()
    channel.share = 0.5
    run(group, 0.1, lambda time: 0.6)
    slower = group.move_to([0.0, 0.0])
    run(group, 20.0, lambda time: 0.6)
    assert slower.status is MotionStatus.SUCCEEDED
    assert moving(sent(channel)) == pytest.approx(lasted / 0.3, rel=0.02)


def paused_at_speed(group: StreamedJointGroup, channel: Joints) -> tuple[np.ndarray, np.ndarray]:
    """Where the joints are, and their velocities, when the controller is paused on the way of a motion."""
    run(group, 1.0)
    here, velocity = channel.sent[-1]
    channel.share = 0.0
    channel.sent.clear()
    return here, velocity


def braking_way(velocity: np.ndarray) -> np.ndarray:
    """By which joints that brake together, within the limits, are at most farther than where they began."""
    speed = np.abs(velocity)
    way: np.ndarray = 1.05 * speed * (np.max(speed) / (2.0 * 0.9 * SLOW) + PERIOD)
    return way


def test_while_the_controller_is_paused_set_points_come_back_and_go_on_along_the_path_from_where_it_stands(
    group: StreamedJointGroup, channel: Joints
) -> None:
    motion = group.move_to([1.5, -0.9])
    here, velocity = paused_at_speed(group, channel)
    run(group, 4.0)  # longer than anything that ends a motion
    assert np.all(np.abs(sent(channel) - here) <= braking_way(velocity))
    assert channel.sent[-1][0] == pytest.approx(here)
    assert not motion.done
    channel.sent.clear()
    channel.share = 1.0
    run(group, 10.0)
    assert motion.status is MotionStatus.SUCCEEDED, motion.failure
    places = np.vstack([here, here, sent(channel)])
    assert places[-1] == pytest.approx([1.5, -0.9], abs=1e-6)
    assert np.max(np.abs(places @ np.array([0.9, 1.5]))) < 2e-3  # on the straight line
    check_limits(places)


@pytest.mark.parametrize("after", [0.0, 0.05, 1.0])
def test_a_stop_while_the_controller_is_paused_moves_nothing_when_it_goes_on(
    group: StreamedJointGroup, channel: Joints, after: float
) -> None:
    motion = group.move_to([1.5, -0.9])
    here, velocity = paused_at_speed(group, channel)
    run(group, after)
    group.stop()
    run(group, 0.5)
    assert motion.done
    assert group.resting
    assert np.all(np.abs(sent(channel) - here) <= braking_way(velocity))
    channel.share = 1.0
    run(group, 1.0)
    assert channel.at == pytest.approx(here)


def test_a_velocity_lapses_and_streamed_set_points_wait_while_the_controller_is_paused(
    group: StreamedJointGroup, channel: Joints
) -> None:
    group.command(velocities=[0.8, 0.0])
    run(group, 0.2)
    channel.share, here = 0.0, channel.at
    run(group, 1.0)
    channel.share = 1.0
    run(group, 1.0)
    assert channel.at == pytest.approx(here)


@pytest.mark.slow
def test_velocities_and_targets_are_slowed_down_too(group: StreamedJointGroup, channel: Joints) -> None:
    for _ in range(80):
        group.command(velocities=[0.8, 0.0])
        run(group, 0.1, lambda time: 0.25)
    assert channel.sent[-1][1] == pytest.approx([0.2, 0.0], abs=1e-6)
    group.command(positions=[-0.5, 0.5])
    run(group, 40.0, lambda time: 0.25)
    assert channel.at == pytest.approx([-0.5, 0.5], abs=1e-5)
    places = sent(channel)
    assert np.max(np.abs(np.diff(places, axis=0))) / PERIOD <= 0.25 * STRONG + 1e-6
    check_limits(places)


def test_a_stop_brakes_in_real_time_whatever_the_speed(group: StreamedJointGroup, channel: Joints) -> None:
    motion = group.move_to([1.5, -0.9])
    run(group, 2.0, lambda time: 0.5)
    group.stop()
    run(group, 0.35, lambda time: 0.0)
    assert motion.done
    assert np.array_equal(channel.sent[-1][0], channel.sent[-2][0])
