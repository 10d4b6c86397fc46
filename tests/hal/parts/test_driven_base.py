"""A base over a channel: limits, dead-man, distances and turns, and what it sends."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import astuple, replace
from itertools import pairwise

import pytest

from bestman_bt.messages import Pose2D, Twist2D, wrap_angle
from bestman_bt.robot_model.model import BaseModel, RobotModel
from hal.api import CommandRefusedError, Failure, MotionErrorCode, MotionStatus, NoDataError, NotConnectedError
from hal.parts.channels import BaseChannel, BaseReading
from hal.parts.driven_base import Arrival, DrivenBase, MotionProfile
from hal.parts.stop_latch import StopLatch

PERIOD = 0.02

STRUCK = Failure(MotionErrorCode.COLLISION, "Collision", "arm", "C31")


class Unicycle(BaseChannel):
    """A base that does what it is told, ``lag`` seconds later at most, and stands when nothing comes."""

    def __init__(self) -> None:
        self.pose, self.twist = Pose2D(1.0, 2.0, 3.0), Twist2D(0.0, 0.0, 0.0)
        self.sent: list[Twist2D] = []

    def read(self) -> BaseReading:
        return BaseReading(self.pose, self.twist)

    def send(self, velocity: Twist2D) -> bool:
        self.twist = velocity
        self.sent.append(velocity)
        return True

    def move(self, dt: float) -> None:
        heading = self.pose.theta + self.twist.wz * dt / 2
        self.pose = Pose2D(
            self.pose.x + self.twist.vx * math.cos(heading) * dt,
            self.pose.y + self.twist.vx * math.sin(heading) * dt,
            wrap_angle(self.pose.theta + self.twist.wz * dt),
        )


Run = Callable[[float], None]


@pytest.fixture
def latch() -> StopLatch:
    return StopLatch()


@pytest.fixture
def channel() -> Unicycle:
    return Unicycle()


@pytest.fixture
def base(robot_model: RobotModel, channel: Unicycle, latch: StopLatch) -> DrivenBase:
    driven = DrivenBase("base", robot_model.of(BaseModel)["base"], channel, latch)
    driven.attach()
    return driven


@pytest.fixture
def run(base: DrivenBase, channel: Unicycle) -> Run:
    def run_for(seconds: float) -> None:
        for _ in range(round(seconds / PERIOD)):
            base.cycle(PERIOD)
            channel.move(PERIOD)

    return run_for


def test_a_base_drives_a_distance_straight(base: DrivenBase, channel: Unicycle, run: Run) -> None:
    start = channel.pose
    motion = base.move_backward(0.5)
    run(6.0)
    moved = start.inverse() @ channel.pose
    assert motion.status is MotionStatus.SUCCEEDED
    assert (moved.x, moved.y) == pytest.approx((-0.5, 0.0), abs=0.003)
    channel.pose = start  # pushed away afterwards, it does not drive back
    channel.sent.clear()
    run(1.0)
    assert set(channel.sent) <= {Twist2D(0.0, 0.0, 0.0)}
    assert base.resting


@pytest.mark.parametrize("angle", [1.0, -4.0, 7.0])
def test_a_base_turns_by_an_angle_also_more_than_once(
    base: DrivenBase, channel: Unicycle, run: Run, angle: float
) -> None:
    start = channel.pose.theta
    motion = base.rotate(angle)
    run(15.0)
    assert motion.status is MotionStatus.SUCCEEDED
    assert wrap_angle(channel.pose.theta - start - angle) == pytest.approx(0.0, abs=0.003)


def test_no_velocity_or_acceleration_beyond_the_limits_is_sent(base: DrivenBase, channel: Unicycle, run: Run) -> None:
    limits = base.model.part
    base.move_forward(2.0)
    run(6.0)
    speeds = [twist.vx for twist in channel.sent]
    changes = [abs(b - a) for a, b in pairwise(speeds)]
    assert max(speeds) <= limits.max_vx + 1e-9
    assert max(changes) <= limits.max_acceleration * PERIOD + 1e-9


@pytest.mark.parametrize("share", [0.3, 0.05])
def test_a_slowed_base_keeps_its_curve_and_a_waiting_motion_goes_on_to_its_end(
    base: DrivenBase, channel: Unicycle, run: Run, share: float
) -> None:
    for step in range(60):
        base.speed_share = 1.0 if step < 30 else share
        base.set_velocity(0.4, 0.0, 0.2)
        run(0.1)
    assert astuple(channel.twist) == pytest.approx((0.4 * share, 0.0, 0.2 * share))
    assert {round(twist.wz / twist.vx, 6) for twist in channel.sent[100:]} == {0.5}
    run(3.0)
    start, motion = channel.pose, base.move_forward(0.4)
    run(0.5)
    base.speed_share = 0.0
    run(20.0)
    assert channel.twist == Twist2D(0.0, 0.0, 0.0)
    assert not motion.done
    base.speed_share = 1.0
    run(4.0)
    assert motion.status is MotionStatus.SUCCEEDED
    assert (start.inverse() @ channel.pose).x == pytest.approx(0.4, abs=0.003)


def test_a_velocity_lapses_without_a_new_command(base: DrivenBase, channel: Unicycle, run: Run) -> None:
    base.set_velocity(0.3, 0.0, 0.0)
    run(base.command_timeout)
    assert channel.twist.vx > 0.0
    run(1.5)
    assert channel.twist == Twist2D(0.0, 0.0, 0.0)


def test_at_rest_it_falls_silent(base: DrivenBase, channel: Unicycle, run: Run) -> None:
    base.set_velocity(0.2, 0.0, 0.0)
    run(3.0)
    count = len(channel.sent)
    run(1.0)
    assert len(channel.sent) == count
    assert channel.sent[-10:] == [Twist2D(0.0, 0.0, 0.0)] * 10


def test_a_stop_brakes_within_half_a_second_and_ends_the_motion(base: DrivenBase, channel: Unicycle, run: Run) -> None:
    motion = base.move_forward(3.0)
    run(1.5)
    base.stop()
    run(0.4)
    assert channel.twist == Twist2D(0.0, 0.0, 0.0)
    assert motion.failure is not None
    assert motion.failure.code is MotionErrorCode.STOPPED


def test_a_base_that_does_not_get_there_in_time_reports_what_is_left(base: DrivenBase, channel: Unicycle) -> None:
    motion = base.move_forward(0.5)
    for _ in range(round(10.0 / PERIOD)):
        base.cycle(PERIOD)  # the wheels are blocked
    assert motion.failure is not None
    assert motion.failure.code is MotionErrorCode.TIMEOUT
    assert "0.500 m remain" in motion.failure.text
    assert channel.sent[-1] == Twist2D(0.0, 0.0, 0.0)
    assert base.resting


def test_a_lost_controller_fails_the_motion_and_silences_the_odometry(base: DrivenBase, run: Run) -> None:
    motion = base.rotate(1.0)
    run(0.2)
    base.fail(Failure(MotionErrorCode.DISCONNECTED, "nothing was heard"))
    assert motion.status is MotionStatus.FAILED
    with pytest.raises(NotConnectedError, match="nothing was heard"):
        base.odometry()


@pytest.mark.parametrize("velocity", [(9.0, 0.0, 0.0), (0.0, 0.1, 0.0), (0.0, 0.0, -9.0), (math.nan, 0.0, 0.0)])
def test_velocities_beyond_the_limits_are_refused(base: DrivenBase, velocity: tuple[float, float, float]) -> None:
    with pytest.raises(CommandRefusedError, match="base refused set_velocity"):
        base.set_velocity(*velocity)


def test_a_distance_is_finite_and_above_0_and_an_angle_is_finite(base: DrivenBase, channel: Unicycle, run: Run) -> None:
    for distance in (0.0, -0.1, math.inf, math.nan):
        for drive in (base.move_forward, base.move_backward):
            with pytest.raises(CommandRefusedError, match=rf"base refused {drive.__name__}: distance = {distance} m"):
                drive(distance)
    for angle in (math.inf, math.nan):
        with pytest.raises(CommandRefusedError, match=f"base refused rotate: angle = {angle} rad"):
            base.rotate(angle)
    run(0.1)
    assert set(channel.sent) == {Twist2D(0.0, 0.0, 0.0)}


def test_programs_read_what_the_base_tells(base: DrivenBase, channel: Unicycle) -> None:
    channel.twist = Twist2D(0.3, 0.0, 0.1)
    assert (base.odometry(), base.velocity()) == (channel.pose, channel.twist)


def test_a_stopped_robot_reports_why_it_refuses(base: DrivenBase, latch: StopLatch) -> None:
    latch.set(STRUCK)
    latch.set(Failure(MotionErrorCode.FAULT, "a later reason"))
    with pytest.raises(CommandRefusedError, match="C31") as refused:
        base.move_forward(1.0)
    failure = refused.value.failure
    assert (failure.code, failure.part, failure.vendor_code) == (MotionErrorCode.STOPPED, "base", "C31")
    latch.clear()
    base.move_forward(1.0)
    latch.set()
    with pytest.raises(CommandRefusedError, match="is stopped; clear_stop"):
        base.move_forward(1.0)


def test_nothing_works_before_it_is_attached(robot_model: RobotModel, latch: StopLatch) -> None:
    unattached = DrivenBase("base", robot_model.of(BaseModel)["base"], Unicycle(), latch)
    with pytest.raises(NotConnectedError):
        unattached.velocity()
    with pytest.raises(NotConnectedError):
        unattached.rotate(1.0)


def test_attaching_commands_the_base_to_stand_first(
    robot_model: RobotModel, channel: Unicycle, latch: StopLatch
) -> None:
    """It may still do what it was told last, by whomever."""
    channel.twist = Twist2D(0.3, 0.0, 0.1)
    base = DrivenBase("base", robot_model.of(BaseModel)["base"], channel, latch)
    base.attach()
    for _ in range(10):
        base.cycle(PERIOD)
    assert channel.sent == [Twist2D(0.0, 0.0, 0.0)] * 10


def test_attached_again_it_does_nothing_of_what_it_did_before(base: DrivenBase, channel: Unicycle, run: Run) -> None:
    for begin in (lambda: base.move_forward(1.0), lambda: base.set_velocity(0.3, 0.0, 0.2)):
        begin()
        run(0.2)
        base.detach()
        base.attach()
        channel.sent.clear()
        run(1.0)
        assert set(channel.sent) == {Twist2D(0.0, 0.0, 0.0)}
        assert base.resting


def accelerations(channel: Unicycle) -> list[float]:
    return [(b.vx - a.vx) / PERIOD for a, b in pairwise(channel.sent)]


def test_a_stop_is_harder_than_a_cancel_and_neither_outlasts_itself(
    base: DrivenBase, channel: Unicycle, run: Run, robot_model: RobotModel
) -> None:
    limits = base.model.part
    hard = max(limits.max_acceleration, limits.max_vx / 0.3)
    assert hard > limits.max_acceleration  # of this robot
    for end, deceleration in (("cancel", limits.max_acceleration), ("stop", hard), ("fail", hard), ("detach", hard)):
        motion = base.move_forward(5.0)
        run(2.0)
        channel.sent.clear()
        if end == "cancel":
            motion.cancel()
        elif end == "fail":
            base.fail(Failure(MotionErrorCode.FAULT, "a wheel is blocked"))
        else:
            getattr(base, end)()
        run(1.5)
        assert channel.twist == Twist2D(0.0, 0.0, 0.0)
        assert min(accelerations(channel)) == pytest.approx(-deceleration, rel=0.01)
        base.attach()
        channel.sent.clear()
        base.set_velocity(limits.max_vx, 0.0, 0.0)
        run(0.2)
        assert max(accelerations(channel)) <= limits.max_acceleration + 1e-9
        base.stop()
        run(1.0)
        channel.sent.clear()
        base.move_forward(0.5)
        run(0.5)
        assert max(accelerations(channel)) <= limits.max_acceleration + 1e-9
        base.stop()
        run(1.0)


def test_a_stop_brakes_turning_by_the_limits_of_turning(base: DrivenBase, channel: Unicycle, run: Run) -> None:
    limits = base.model.part
    hard = limits.max_wz / 0.3
    assert hard > max(limits.max_angular_acceleration, limits.max_vx / 0.3)  # of this robot
    for end, deceleration in (("cancel", limits.max_angular_acceleration), ("stop", hard)):
        motion = base.rotate(9.0)
        run(2.0)
        channel.sent.clear()
        motion.cancel() if end == "cancel" else base.stop()
        run(1.0)
        changes = [(b.wz - a.wz) / PERIOD for a, b in pairwise(channel.sent)]
        assert min(changes) == pytest.approx(-deceleration, rel=0.01)
        assert channel.twist == Twist2D(0.0, 0.0, 0.0)


def test_a_velocity_replaces_a_motion_and_lapses_when_it_should(base: DrivenBase, channel: Unicycle, run: Run) -> None:
    motion = base.rotate(3.0)
    run(0.5)
    for _ in range(10):  # repeated, it goes on
        base.set_velocity(0.2, 0.0, 0.0)
        run(0.2)
    assert motion.failure is not None
    assert motion.failure.code is MotionErrorCode.SUPERSEDED
    assert channel.twist == Twist2D(0.2, 0.0, 0.0)
    run(0.04)
    assert channel.twist == Twist2D(0.2, 0.0, 0.0)
    run(0.04)
    assert 0.0 < channel.twist.vx < 0.2
    run(1.0)
    assert channel.twist == Twist2D(0.0, 0.0, 0.0)
    assert base.resting


def test_a_stop_is_told_why_and_a_detached_base_fails_its_motion(base: DrivenBase, latch: StopLatch) -> None:
    motion = base.rotate(1.0)
    latch.set(STRUCK)
    base.stop()
    text = "stopped because arm: Collision (C31)"
    assert motion.failure == Failure(MotionErrorCode.STOPPED, text, "base", "C31")
    assert str(motion.failure) == f"base: {text}"
    latch.clear()
    motion = base.rotate(1.0)
    base.detach()
    assert motion.failure is not None
    assert motion.failure.code is MotionErrorCode.DISCONNECTED
    base.stop()
    with pytest.raises(NotConnectedError):
        base.set_velocity(0.0, 0.0, 0.0)


def test_a_base_that_is_pushed_aside_steers_back_to_its_heading(base: DrivenBase, channel: Unicycle, run: Run) -> None:
    start = channel.pose
    motion = base.move_forward(1.5)
    run(1.0)
    channel.pose = Pose2D(channel.pose.x, channel.pose.y, wrap_angle(channel.pose.theta + 0.2))
    run(8.0)
    assert motion.status is MotionStatus.SUCCEEDED
    assert wrap_angle(channel.pose.theta - start.theta) == pytest.approx(0.0, abs=0.01)
    assert (start.inverse() @ channel.pose).x == pytest.approx(1.5, abs=0.003)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_along_aside_and_about_it_keeps_the_limits_of_each(
    robot_model: RobotModel, channel: Unicycle, latch: StopLatch, sign: float
) -> None:
    model = robot_model.of(BaseModel)["base"]
    part = replace(model.part, max_vy=0.4, max_acceleration=0.5, max_angular_acceleration=2.0)
    base = DrivenBase("base", replace(model, part=part), channel, latch)
    base.attach()
    base.set_velocity(sign * 0.2, sign * 0.3, sign * 0.8)
    base.cycle(PERIOD)
    assert astuple(channel.sent[-1]) == pytest.approx((sign * 0.01, sign * 0.01, sign * 0.04))


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_motion_profile_brakes_by_the_acceleration_of_what_it_does(robot_model: RobotModel, sign: float) -> None:
    base = robot_model.of(BaseModel)["base"].part
    model = replace(base, max_vx=1.0, max_wz=1.5, max_acceleration=0.5, max_angular_acceleration=2.0)
    start = Pose2D(1.0, 2.0, 3.0)
    turning = MotionProfile(model, start, Arrival(), turn=sign * 1.0).velocity(start @ Pose2D(theta=sign * 0.7), PERIOD)
    assert turning.wz == pytest.approx(sign * math.sqrt(1.4 * 2.0 * 0.3))
    driving = MotionProfile(model, start, Arrival(), distance=sign * 1.0).velocity(
        start @ Pose2D(sign * 0.7, 0.0, 0.0), PERIOD
    )
    assert driving.vx == pytest.approx(sign * math.sqrt(1.4 * 0.5 * 0.3))


def test_odometry_that_falls_silent_fails_the_motion_and_brakes(
    base: DrivenBase, channel: Unicycle, run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    motion = base.move_forward(2.0)
    run(1.0)
    assert channel.twist.vx > 0.3

    def silent() -> BaseReading:
        raise NoDataError("the encoders tell nothing")

    monkeypatch.setattr(channel, "read", silent)
    run(2.0)
    assert motion.failure is not None
    assert (motion.failure.code, "tell nothing" in motion.failure.text) == (MotionErrorCode.NO_DATA, True)
    assert channel.twist == Twist2D(0.0, 0.0, 0.0)
    assert base.resting


def test_a_velocity_that_is_not_taken_yet_is_due_again_and_not_counted_as_driven(
    base: DrivenBase, channel: Unicycle, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Steered wheels turn before they roll: the ramp begins when they do."""
    asked: list[Twist2D] = []
    monkeypatch.setattr(channel, "send", lambda velocity: bool(asked.append(velocity)))
    for _ in range(5):
        base.set_velocity(0.2, 0.0, 0.0)
        base.cycle(PERIOD)
    assert len(set(map(astuple, asked))) == 1
    monkeypatch.undo()
    base.cycle(PERIOD)
    base.cycle(PERIOD)
    assert channel.sent[0] == asked[0]
    assert channel.sent[1].vx == pytest.approx(2 * channel.sent[0].vx)


def test_steered_wheels_change_their_velocity_along_one_direction(
    robot_model: RobotModel, channel: Unicycle, latch: StopLatch
) -> None:
    model = robot_model.of(BaseModel)["base"]
    part = replace(model.part, max_vy=0.5, steering_joints=("steer",))
    base = DrivenBase("base", replace(model, part=part), channel, latch)
    base.attach()
    base.set_velocity(0.3, 0.1, 0.0)
    base.cycle(PERIOD)
    first = channel.sent[-1]
    assert first.vy / first.vx == pytest.approx(1.0 / 3.0)
    assert math.hypot(first.vx, first.vy) == pytest.approx(part.max_acceleration * PERIOD)
    for _ in range(round(1.0 / PERIOD)):
        base.set_velocity(0.3, 0.1, 0.0)
        base.cycle(PERIOD)
    assert channel.sent[-1] == Twist2D(0.3, 0.1, 0.0)
