"""What an xArm's replies say about its controller: a scripted SDK answers."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import pytest

import hal.xarm.wire
from bestman_bt.robot_model.connection_config import ConnectionConfig, SafetyConfig
from bestman_bt.robot_model.model import ArmModel, GripperModel, RobotModel
from hal.api import MotionErrorCode
from hal.parts.part_connection import ConnectionFailedError
from hal.parts.simulated_clock import SimulatedClock
from hal.parts.stop_latch import StopLatch
from hal.xarm.connection import XArmConnection, XArmGripper
from hal.xarm.lite6_gripper import Lite6GripperWire
from hal.xarm.options import XArmOptions
from hal.xarm.wire import ArmIdentity, XArmWire

TITLES = {number: {"en": {"title": f"title {number}"}} for number in (*range(40), "other")}


class Arm:
    """The SDK's arm: ``error`` of the controller, ``gripper_error``, ``code`` of whatever it is told."""

    connected = True

    def __init__(self) -> None:
        self.error = self.gripper_error = self.code = self.state = 0
        self.has_err_warn = False
        self.stays = False
        self.calls: list[Any] = []

    def connect(self) -> None:
        self.calls.append("connect")

    def disconnect(self) -> None:
        self.calls.append("disconnect")

    def set_timeout(self, timeout: float) -> None:
        self.calls.append(("timeout", timeout))

    def get_err_warn_code(self) -> tuple[int, tuple[int, int]]:
        return 0, (self.error, 0)

    def get_gripper_err_code(self) -> tuple[int, int]:
        return 0, self.gripper_error

    def get_state(self) -> tuple[int, int]:
        return 0, self.state

    def clean_error(self) -> None:
        self.calls.append("clean_error")
        if not self.stays:
            self.error, self.has_err_warn = 0, False

    def __getattr__(self, name: str) -> Callable[..., int]:
        def call(*arguments: Any, **options: Any) -> int:
            self.calls.append((name, *arguments) if arguments else name)
            return self.code

        return call


class Clock(SimulatedClock):
    time = 0.0

    def now(self) -> float:
        return self.time


@pytest.fixture
def arm() -> Arm:
    return Arm()


@pytest.fixture
def clock() -> Clock:
    return Clock(0.01)


@pytest.fixture
def wire(arm: Arm, clock: Clock, monkeypatch: pytest.MonkeyPatch) -> XArmWire:
    modules = {
        "xarm": SimpleNamespace(wrapper=SimpleNamespace(XArmAPI=lambda *a, **k: arm)),
        "xarm.core.utils.log": SimpleNamespace(logger=SimpleNamespace(setLevel=lambda level: None)),
        "xarm.core.config.x_code": SimpleNamespace(ControllerErrorCodeMap=TITLES, GripperErrorCodeMap=TITLES),
    }
    passed = [0.0]
    monkeypatch.setattr(hal.xarm.wire, "answers", lambda address, timeout: True)
    monkeypatch.setattr(
        hal.xarm.wire,
        "time",
        SimpleNamespace(
            sleep=lambda duration: passed.__setitem__(0, passed[0] + duration), monotonic=lambda: passed[0]
        ),
    )
    made = XArmWire("arm_controller", clock, modules.__getitem__)
    made.open("192.168.7.7", XArmOptions())
    return made


@pytest.mark.parametrize(("code", "heard"), [(0, True), (-1, False), (3, False), (8, False), (1, True), (9, True)])
def test_only_what_is_answered_is_a_sign_of_life(wire: XArmWire, clock: Clock, code: int, heard: bool) -> None:
    clock.time = 5.0
    assert wire.ask(lambda arm: (code, [1.0])) == ([1.0] if code == 0 else None)
    assert wire.heard == (5.0 if heard else 0.0)
    clock.time = 6.0
    wire.send("set-point", lambda arm: code)
    assert wire.heard == (6.0 if heard else 0.0)
    assert (wire.fault is not None) is (code in (-1, 9))
    assert wire.stopped is (wire.fault is not None)
    assert wire.fault is None or (wire.fault.code is MotionErrorCode.DISCONNECTED) is (code == -1)


@pytest.mark.parametrize(
    ("number", "code"),
    [
        (22, MotionErrorCode.COLLISION),
        (31, MotionErrorCode.COLLISION),
        (30, MotionErrorCode.TRACKING),
        (38, MotionErrorCode.TRACKING),
        (1, MotionErrorCode.STOPPED),
        (2, MotionErrorCode.STOPPED),
        (3, MotionErrorCode.STOPPED),
        (23, MotionErrorCode.FAULT),
    ],
)
def test_an_error_that_any_reply_flags_is_the_fault_with_its_number(
    wire: XArmWire, arm: Arm, number: int, code: MotionErrorCode
) -> None:
    arm.has_err_warn = True
    wire.ask(lambda _: (0, 1))
    assert wire.fault is None  # a warning
    arm.error = number
    wire.ask(lambda _: (1, None))
    assert wire.fault is not None
    assert (wire.fault.code, wire.fault.vendor_code, wire.fault.text) == (code, f"C{number}", f"title {number}")
    wire.send("set-point", lambda _: 9)  # of which a later refusal is only the consequence
    assert wire.fault.vendor_code == f"C{number}"


def test_a_refusal_without_an_error_is_a_fault_of_its_own(wire: XArmWire) -> None:
    for code, words in ((9, "not ready to move"), (77, "refused a set-point")):
        wire.make_ready(gripper=False)
        wire.send("set-point", lambda _, code=code: code)
        assert wire.fault is not None
        assert words in wire.fault.text
        assert wire.fault.vendor_code == f"SDK {code}"


def test_a_fault_of_the_gripper_has_the_grippers_number(wire: XArmWire, arm: Arm) -> None:
    wire.send("gripper", lambda _: 102)
    assert wire.fault is None
    arm.gripper_error = 34
    wire.ask(lambda _: 102)
    assert wire.fault is not None
    assert (wire.fault.code, wire.fault.vendor_code) == (MotionErrorCode.FAULT, "G34")


def test_making_ready_enters_servo_mode_and_clears_no_error_of_the_controller(
    wire: XArmWire, arm: Arm, clock: Clock
) -> None:
    clock.time = 9.0
    arm.calls.clear()
    wire.make_ready(gripper=True)
    assert arm.calls == [
        "clean_warn",
        ("set_mode", 1),
        ("set_state", 0),
        "clean_gripper_error",
        ("set_gripper_mode", 0),
        ("set_gripper_enable", True),
    ]
    assert wire.fault is None
    assert wire.heard == 9.0
    arm.calls.clear()
    arm.error = 31
    with pytest.raises(ConnectionFailedError, match="title 31.*bestman-bt robot release"):
        wire.make_ready(gripper=True)
    assert arm.calls == ["clean_warn"]


def test_a_release_clears_the_error_and_switches_the_motors_on(wire: XArmWire, arm: Arm) -> None:
    arm.error = 31
    assert "title 31" in (wire.held() or "")
    arm.calls.clear()
    wire.release()
    assert arm.calls == ["clean_error", ("motion_enable", True), ("set_state", 0)]


def test_a_controller_that_stays_stopped_is_reported_with_what_to_do(wire: XArmWire, arm: Arm) -> None:
    arm.state, arm.stays = 4, True
    with pytest.raises(ConnectionFailedError, match="motors are off, or it is stopped.*bestman-bt robot release"):
        wire.make_ready(gripper=False)


def test_a_command_that_has_to_succeed_reports_what_was_refused(wire: XArmWire, arm: Arm) -> None:
    wire.demand("the payload", lambda _: 2)  # with a warning
    with pytest.raises(ConnectionFailedError, match=r"arm_controller: the controller refused the payload \(SDK 1\)"):
        wire.demand("the payload", lambda _: 1)


def test_a_closed_connection_neither_sends_nor_answers(wire: XArmWire, arm: Arm) -> None:
    wire.close()
    wire.close()
    assert arm.calls.count("disconnect") == 1
    assert wire.ask(lambda _: (0, 1)) is None
    wire.send("set-point", lambda _: 77)
    assert wire.fault is None


@pytest.mark.parametrize("end", ["lower", "upper"])
@pytest.mark.parametrize(("beyond", "refused"), [(0.009, False), (0.011, True)])
def test_an_arm_whose_limits_go_beyond_the_controller_s_at_either_end_is_another_one(
    robot_model: RobotModel, end: str, beyond: float, refused: bool
) -> None:
    arm = robot_model.of(ArmModel)["arm"]
    ranges = [[low, high] for low, high in zip(arm.lower.tolist(), arm.upper.tolist(), strict=True)]
    ranges[3][0 if end == "lower" else 1] += beyond if end == "lower" else -beyond
    identity = ArmIdentity(len(ranges), 7, tuple((low, high) for low, high in ranges))
    mismatch = identity.mismatch("xarm", arm)
    assert (mismatch is not None) is refused
    assert mismatch is None or arm.joint_names[3] in mismatch


def test_the_controller_is_told_its_limits_in_its_own_units(
    robot_model: RobotModel, wire: XArmWire, arm: Arm, clock: Clock, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Millimetres, but radians; ``wait``: not for the arm to stand still."""
    options = XArmOptions(
        collision_sensitivity=2, reduced_mode=True, payload=1.2, payload_center=(0.01, -0.02, 0.03), arm="xarm"
    )
    settings = ConnectionConfig("xarm", ("arm",), "192.168.7.7", options=options)
    limits = SafetyConfig(tool_speed=0.25)
    connection = XArmConnection("arm_controller", settings, robot_model, limits, clock, StopLatch())
    connection._wire = wire
    monkeypatch.setattr(ArmIdentity, "mismatch", lambda *_: None)
    monkeypatch.setattr(ArmIdentity, "of", lambda *_: ArmIdentity(7, 7, ()))
    connection.open()
    assert ("set_collision_sensitivity", 2) in arm.calls
    load = "set_tcp_load", 1.2, [10.0, -20.0, 30.0]
    assert load in arm.calls
    connection._set_load(0.0, (0.0, 0.0, 0.0))  # the hand holds nothing any more
    assert arm.calls.count(load) == 2
    assert ("set_reduced_max_joint_speed", max(robot_model.of(ArmModel)["arm"].velocity)) in arm.calls
    assert ("set_reduced_max_tcp_speed", 250.0) in arm.calls
    assert ("set_reduced_mode", True) in arm.calls


def test_a_lite6s_gripper_that_is_turned_round_half_way_goes_back_from_there(
    robot_model: RobotModel, wire: XArmWire, clock: Clock
) -> None:
    model = robot_model.of(GripperModel)["gripper"]
    gripper = Lite6GripperWire(wire, model, clock)
    travel = (model.max_width - model.part.min_width) / model.part.max_speed
    clock.time = 50.0
    gripper.send(model.max_width, 0.0, 0.0)
    clock.time += travel / 2
    middle = (model.max_width + model.part.min_width) / 2
    assert gripper.read().width == pytest.approx(middle)
    gripper.send(model.part.min_width, 0.0, 0.0)
    assert gripper.read().width == pytest.approx(middle)
    clock.time += travel / 4
    assert gripper.read().width == pytest.approx((middle + model.part.min_width) / 2)
    clock.time += travel / 4
    assert gripper.read().width == pytest.approx(model.part.min_width)
    gripper.send(model.max_width, 0.0, 0.0)
    clock.time += travel / 2
    gripper.halt()  # without power it stays
    clock.time += travel
    assert gripper.read().width == pytest.approx(middle)


def test_a_gripper_is_halted_where_it_is_by_then(wire: XArmWire, arm: Arm, robot_model: RobotModel) -> None:
    gripper = XArmGripper(wire, robot_model.of(GripperModel)["gripper"], 850)
    for pulses in (700, 400):
        arm.get_gripper_position = lambda pulses=pulses: (0, pulses)
        if pulses == 700:
            gripper.refresh()
    gripper.halt()
    assert arm.calls[-1] == ("set_gripper_position", 400)
