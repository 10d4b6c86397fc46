"""The gate: no set-point that a vendor's wire takes breaks a limit, whatever is commanded."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import pytest

from benchmarks import gate as trials
from bestman_bt.messages import JointTrajectory
from bestman_bt.robot_model.connection_config import SafetyConfig, WorkspaceConfig
from bestman_bt.robot_model.hardware_config import with_hardware
from bestman_bt.robot_model.model import ArmModel
from hal.api import CommandRefusedError, MotionErrorCode
from hal.parts.channels import JointChannel, JointReading
from hal.parts.gate import SetpointGate, ToolLimits
from hal.parts.setpoints import Brake
from hal.parts.stop_latch import StopLatch
from hal.parts.streamed_arm import StreamedArm

PERIOD = 1.0 / 500.0
TURN = np.array([1.0, 0.0, 0.0, 0.0, 0.0, 0.0])


class Wire(JointChannel):
    """Takes set-points, and is there."""

    def __init__(self, positions: np.ndarray) -> None:
        self.sent = [positions]

    def read(self) -> JointReading:
        return JointReading(self.sent[-1], np.zeros(6), np.zeros(6))

    def send(self, positions: np.ndarray, velocities: np.ndarray) -> None:
        self.sent.append(positions.copy())


class Rig:
    """A UR5 at home, its limits and what its wire took."""

    def __init__(self, **safety: Any) -> None:
        whole, limits = trials.robot("ur"), SafetyConfig(**safety)
        model = with_hardware(whole, {}, limits)
        self.joints = model.of(ArmModel)["arm"]
        self.home = model.posture("home", self.joints.joint_names)
        self.wire, self.tool = Wire(self.home), ToolLimits(model, "arm", limits)
        self.arm = StreamedArm("arm", self.joints, self.wire, StopLatch(), PERIOD, self.tool)
        self.arm.attach()

    def run(self, seconds: float, again: Callable[[], object] = lambda: None) -> None:
        for cycle in range(round(seconds / PERIOD)):
            if cycle % 50 == 0:
                again()
            self.arm.cycle(PERIOD)

    @property
    def rates(self) -> np.ndarray:
        return np.diff(self.wire.sent, axis=0) / PERIOD

    @property
    def tool_speed(self) -> float:
        places = np.array([self.tool.tool(place) for place in self.wire.sent])
        return float(np.max(np.linalg.norm(np.diff(places, axis=0), axis=1))) / PERIOD

    @property
    def acceleration(self) -> np.ndarray:
        return np.max(np.abs(np.diff(self.rates, axis=0, prepend=0.0 * TURN[None])), axis=0) / PERIOD

    def way(self, positions: np.ndarray, duration: float) -> JointTrajectory:
        """Two samples, at rest at both."""
        rows = np.vstack([self.home, positions])
        return JointTrajectory(self.arm.joint_names, np.array([0.0, duration]), rows, 0.0 * rows)


def test_no_kind_of_command_makes_the_tool_faster_than_its_limit() -> None:
    for command in (
        lambda rig: rig.arm.command(positions=rig.home + 0.2 * TURN),
        lambda rig: rig.arm.move_to(rig.home + 0.2 * TURN),
        lambda rig: rig.arm.follow(rig.way(rig.home + 0.2 * TURN, 0.2)),
        lambda rig: rig.arm.command(velocities=0.5 * TURN),
    ):
        rig = Rig(tool_speed=0.1)
        command(rig)
        rig.run(1.5)
        assert 0.08 < rig.tool_speed <= 0.101
        assert np.all(rig.acceleration <= 1.01 * np.maximum(rig.joints.acceleration, rig.joints.velocity / 0.3))


def test_a_target_is_reached_though_the_tool_is_slow() -> None:
    rig, target = Rig(tool_speed=0.2), np.array([0.2, 0.1, -0.2, 0.3, 0.1, 0.2])
    rig.arm.command(positions=rig.home + target)
    rig.run(4.0)
    assert rig.wire.sent[-1] == pytest.approx(rig.home + target)
    assert rig.arm.resting


def test_a_trajectory_that_is_too_fast_between_its_samples_is_slowed_down_and_arrives() -> None:
    rig = Rig(joint_speed=0.1)
    limit = rig.joints.velocity[0]
    motion = rig.arm.follow(rig.way(rig.home + TURN, 1.0 / limit))  # a cubic's top speed is 1.5 times its mean
    rig.run(1.6 / limit)
    assert motion.failure is None
    assert motion.done
    assert 0.98 * limit < np.max(np.abs(rig.rates)) <= 1.001 * limit
    rig = Rig()
    motion = rig.arm.follow(rig.way(rig.home + 0.3 * TURN, 0.15))  # 6 x 0.3 / 0.15² = 80 rad/s² at both ends
    rig.run(1.0)
    assert motion.done
    assert motion.failure is None
    assert np.max(rig.acceleration) <= 1.01 * rig.joints.acceleration[0]


def test_the_first_sample_of_a_stream_and_a_stream_that_ends_at_speed_keep_the_acceleration() -> None:
    rig = Rig()
    target = rig.home.copy()
    for _ in range(20):
        target = target + 0.02 * TURN
        rig.run(0.02)
        rig.arm.servo(target)
    rig.run(1.0)
    assert np.max(rig.acceleration) <= 1.01 * rig.joints.acceleration[0]
    assert rig.wire.sent[-1] == pytest.approx(target)
    assert rig.arm.resting


@pytest.mark.slow
def test_tool_and_elbow_stay_in_their_box() -> None:
    home = Rig()
    tool, elbow = home.tool.places(home.home)
    side = WorkspaceConfig((-2.0, -2.0, 0.0), (2.0, tool[1] + 0.1, 3.0))
    above = WorkspaceConfig((-2.0, -2.0, 0.0), (2.0, 2.0, elbow[2] + 0.02))
    assert elbow[2] > tool[2]
    for box, velocity, axis, which in ((side, TURN, 1, 0), (above, np.roll(TURN, 1), 2, 1)):
        for sign in (1.0, -1.0):
            rig = Rig(workspace=box)
            rig.run(2.0, partial(rig.arm.command, velocities=sign * 3.0 * velocity))
            places = np.array([rig.tool.places(place)[which, axis] for place in rig.wire.sent])
            assert np.max(places) <= box.upper[axis] + 1e-4
            if np.max(places) > box.upper[axis] - 1e-3:
                break
        else:
            pytest.fail("it never came to the wall")
        with pytest.raises(CommandRefusedError, match=("tool", "elbow")[which]):
            rig.arm.move_to(rig.wire.sent[-1] + sign * 0.2 * velocity)
        rig.arm.move_to(rig.home)  # back is allowed
        rig.run(2.0)
        assert rig.wire.sent[-1] == pytest.approx(rig.home)


def test_a_motion_that_the_gate_has_brought_to_rest_fails_and_reports_why() -> None:
    home = Rig()
    tool = home.tool.places(home.home)[0]
    rig = Rig(workspace=WorkspaceConfig((-2.0, -2.0, 0.0), (2.0, tool[1] + 0.1, 3.0)))
    samples = np.vstack([rig.home, rig.home])
    speeds = np.vstack([6.0 * TURN, -6.0 * TURN]) / 2  # out and back again between two samples
    with pytest.raises(CommandRefusedError, match="the tool would be at y"):
        rig.arm.follow(JointTrajectory(rig.arm.joint_names, np.array([0.0, 1.0]), samples, speeds))
    motion = rig.arm.move_to(rig.home + 0.05 * TURN)
    rig.run(2 * PERIOD)
    way = rig.arm._setpoints._move
    way._delta = 20.0 * way._delta  # as if the checks had overlooked something
    rig.run(3.0)
    assert motion.failure is not None
    assert motion.failure.code is MotionErrorCode.FAULT
    assert "workspace" in motion.failure.text
    assert rig.arm.resting
    assert rig.tool.tool(rig.wire.sent[-1])[1] <= tool[1] + 0.1001


def test_a_way_goes_on_only_as_fast_as_the_gate_lets_the_joints_come_along() -> None:
    rig = Rig()
    target = rig.home + TURN
    motion = rig.arm.move_to(target)
    rig.run(2 * PERIOD)
    way = rig.arm._setpoints._move
    way._start, way._delta = rig.home + 0.1 * TURN, 0.9 * TURN  # set off with a jump
    rig.run(3.0)
    assert motion.done
    assert motion.failure is None
    assert rig.wire.sent[-1] == pytest.approx(target)
    assert np.max(rig.acceleration) <= 1.01 * rig.joints.acceleration[0]


@pytest.mark.parametrize("vendor", list(trials.ROBOTS))
def test_hostile_commands_break_no_limit_on_a_vendors_wire(vendor: str) -> None:
    for seed in range(100, 104):
        broken, trial = trials.faults(vendor, seed, commands=4)
        assert broken == []
        assert trial.accepted + trial.refused == 4


@pytest.mark.parametrize(("vendor", "seed"), [("xarm", 249), ("ur", 1017), ("ur", 1684)])
def test_late_cycles_and_braking_at_the_end_of_a_range_keep_the_acceleration(vendor: str, seed: int) -> None:
    assert trials.faults(vendor, seed)[0] == []


@pytest.mark.slow
@pytest.mark.parametrize("vendor", list(trials.ROBOTS))
def test_hundreds_of_hostile_commands_break_no_limit_on_a_vendors_wire(vendor: str) -> None:
    found = [trials.faults(vendor, seed) for seed in range(80)]
    assert [fault for broken, _ in found for fault in broken] == []
    assert sum(trial.accepted for _, trial in found) > 400


def test_a_set_point_that_is_no_finite_number_brakes() -> None:
    rig = Rig()
    gate = rig.arm._gate
    gate.start(rig.home, 0.1 * TURN)
    for value in (np.nan, np.inf):
        admitted = gate.admit(value * np.ones(6), 0.0 * TURN, PERIOD, PERIOD)
        assert np.all(np.isfinite(admitted))
        assert "finite" in gate.reason


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_joint_comes_to_rest_within_its_range_whichever_way_it_is_sent_out(sign: float) -> None:
    joints = Rig().joints
    gate, middle = SetpointGate(joints, PERIOD), (joints.lower + joints.upper) / 2
    gate.start(middle + sign * ((joints.upper - middle)[0] - 0.1) * TURN)
    for _ in range(round(1.0 / PERIOD)):
        gate.admit(gate.position + sign * 0.5 * PERIOD * TURN, sign * 0.5 * TURN, PERIOD, PERIOD)
    edge = joints.upper[0] if sign > 0.0 else joints.lower[0]
    assert -2e-6 < sign * (edge - gate.position[0]) < 0.01
    assert gate.reason == f"{joints.joint_names[0]} would leave its range"


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_joint_that_cannot_brake_within_its_range_stops_at_its_end(sign: float) -> None:
    joints = Rig().joints
    edge = joints.upper if sign > 0.0 else joints.lower
    place, speed = edge - sign * 0.01 * TURN, sign * joints.velocity * TURN
    place[1:] = 0.0
    gate, brake = SetpointGate(joints, PERIOD), Brake(place, speed, joints.acceleration, joints.lower, joints.upper)
    gate.start(place, speed)
    for _ in range(round(0.1 / PERIOD)):
        gate.admit(*brake.advance(PERIOD), PERIOD, PERIOD, braking=True)
        brake.continue_from(gate.position, gate.rate)
        assert sign * (edge - gate.position)[0] >= 0.0
    assert gate.position[0] == pytest.approx(edge[0])
    assert not gate.moving


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_joint_that_comes_to_rest_beyond_its_range_by_rounding_keeps_its_deceleration(sign: float) -> None:
    joints = Rig().joints
    edge = joints.upper[0] if sign > 0.0 else joints.lower[0]
    for beyond in np.linspace(-2e-6, 0.9e-6, 30):
        gate, middle = SetpointGate(joints, PERIOD), (joints.lower + joints.upper) / 2
        rate, deceleration = 0.03, gate.deceleration[0]
        left = (rate - deceleration * PERIOD / 2) ** 2 / (2.0 * deceleration)  # the way to rest; `rate` is a mean
        place = np.where(TURN > 0.0, edge + sign * (beyond - left), middle)
        gate.start(place, sign * rate * TURN)
        rates = [sign * rate]
        for _ in range(5):
            before = gate.position[0]
            gate.admit(place + sign * TURN, 0.0 * TURN, PERIOD, PERIOD)
            rates.append((gate.position[0] - before) / PERIOD)
        assert np.abs(np.diff(rates)).max() / PERIOD < 1.01 * deceleration
        assert sign * (gate.position[0] - edge) < 2e-6


def test_late_cycles_at_a_high_speed_keep_the_tools_step_and_else_the_acceleration() -> None:
    limits, period, longest, rng = SafetyConfig(), 1.0 / 200.0, 0.01, np.random.default_rng(1)
    model = with_hardware(trials.robot("xarm"), {}, limits)
    joints, tool = model.of(ArmModel)["arm"], ToolLimits(model, "arm", limits)
    wire = Wire(model.posture("home", joints.joint_names))
    wire.longest_tool_step = longest
    arm = StreamedArm("arm", joints, wire, StopLatch(), period, tool)
    arm.attach()
    times = [period]
    for _ in range(60):
        arm.command(velocities=rng.uniform(-1.0, 1.0, 6) * joints.velocity)
        for _ in range(40):
            times.append(period * (rng.uniform(1.0, 3.0) if rng.random() < 0.2 else 1.0))
            arm.cycle(times[-1])
    sent, dt = np.array(wire.sent), np.array(times)
    assert len(sent) == len(dt)
    steps = np.linalg.norm(np.diff([tool.tool(place) for place in sent], axis=0), axis=1)
    rates = np.vstack([0.0 * TURN, np.diff(sent, axis=0) / dt[1:, None]])
    shares = np.abs(np.diff(rates, axis=0)) / (joints.acceleration * (dt[:-1] + dt[1:])[:, None] / 2)
    waits = steps > trials.WAITING_STEP * longest
    assert np.max(steps) <= 1.001 * longest
    assert np.max(shares[~waits]) < 1.01
    assert np.any(waits & (shares.max(axis=1) > 1.01))


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_stream_that_is_caught_up_with_is_not_overshot(sign: float) -> None:
    """A stream that sets out too hard and then moves at the limits: the joints follow, and end where it ends."""
    rig = Rig()
    speed, acceleration = float(rig.joints.velocity[0]), float(rig.joints.acceleration[0])
    ahead, length = 0.03, 1.2  # radians that the stream is ahead at the start, and its way
    ramp = speed / acceleration
    gate, places = SetpointGate(rig.joints, PERIOD), []
    gate.start(rig.home)
    end = 2.0 * ramp + (length - speed * ramp) / speed
    for cycle in range(round((end + 0.5) / PERIOD)):
        passed = min(cycle * PERIOD, end)
        left = end - passed
        along = np.select(
            [passed < ramp, left < ramp],
            [acceleration * passed**2 / 2, length - acceleration * left**2 / 2],
            speed * (passed - ramp / 2),
        )
        moves = speed * min(1.0, passed / ramp, left / ramp)
        wanted = rig.home + sign * (ahead + along) * TURN
        places.append(gate.admit(wanted, sign * moves * TURN, PERIOD, PERIOD)[0])
    gone = sign * (np.array(places) - rig.home[0])
    assert gone[-1] == pytest.approx(length + ahead, abs=1e-4)
    assert gone.max() < length + ahead + 1e-3
    rates = np.diff(gone) / PERIOD
    assert np.abs(rates).max() < 1.001 * speed
    assert np.abs(np.diff(rates)).max() / PERIOD < 1.01 * acceleration
