"""The stop, the watchdog and the recovery of a robot of two controllers; what they do is scripted."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace

import pytest

from bestman_bt.messages import Pose2D, Twist2D
from bestman_bt.registry import CONNECTIONS
from bestman_bt.robot_model.connection_config import ConnectionConfig
from bestman_bt.robot_model.model import RobotModel
from hal.api import CommandRefusedError, Failure, Gripper, MobileBase, MotionErrorCode, MotionStatus, NotConnectedError
from hal.hardware.connection import Connection, PartFactory
from hal.hardware.robot import HardwareRobot
from hal.parts.channels import BaseChannel, BaseReading, GripperChannel, GripperReading
from hal.parts.driven_base import DrivenBase
from hal.parts.gripper import CommandedGripper
from hal.parts.part_connection import ConnectionFailedError

PATIENCE = 60.0


class Wheels(BaseChannel):
    def read(self) -> BaseReading:
        return BaseReading(Pose2D(0.0, 0.0, 0.0), Twist2D(0.0, 0.0, 0.0))

    def send(self, velocity: Twist2D) -> bool:
        return True


class Fingers(GripperChannel):
    def read(self) -> GripperReading:
        return GripperReading(0.04)

    def send(self, width: float, force: float, speed: float) -> None:
        pass

    def halt(self) -> None:
        pass


class Controller(Connection):
    """Reports ``told``, is silent since ``silent_since``, and recovers when ``recovering`` lets it."""

    driver = "scripted"
    told: Failure | None = None
    broken = False
    silent_since: float | None = None
    reachable = True
    closes = True
    recovers = True
    during_recovery: Callable[[], None] = staticmethod(lambda: None)

    def factories(self) -> Mapping[str, PartFactory]:
        self.calls: list[str] = []
        return {
            "base": lambda name, model: DrivenBase(name, model, Wheels(), self.latch),
            "gripper": lambda name, model: CommandedGripper(name, model, Fingers(), self.latch),
        }

    def open(self) -> None:
        self.calls.append("open")
        if not self.reachable:
            raise ConnectionFailedError(f"{self.name}: nobody answers")

    def close(self) -> None:
        self.calls.append("close")
        if not self.closes:
            raise OSError(f"{self.name}: broken pipe")

    def abandon(self) -> None:
        self.calls.append("abandon")

    def heard(self) -> float:
        return self.clock.now() if self.silent_since is None else self.silent_since

    def reported_fault(self) -> Failure | None:
        if self.broken:
            raise ZeroDivisionError("of the driver")
        return self.told

    def recover(self) -> None:
        self.calls.append("recover")
        self.during_recovery()
        if not self.recovers:
            raise ConnectionFailedError(f"{self.name}: it does not recover")
        self.told = None


@pytest.fixture
def unconnected(robot_model: RobotModel, monkeypatch: pytest.MonkeyPatch) -> HardwareRobot:
    monkeypatch.setattr(CONNECTIONS, "resolve", lambda driver: Controller)
    connections = {"platform": ConnectionConfig("any", ("base",)), "hand": ConnectionConfig("any", ("gripper",))}
    return HardwareRobot(replace(robot_model, connections=connections))


@pytest.fixture
def robot(unconnected: HardwareRobot) -> Iterator[HardwareRobot]:
    with unconnected:
        yield unconnected


def controller(robot: HardwareRobot, name: str) -> Controller:
    found = robot.connections[name]
    assert isinstance(found, Controller)
    return found


def until(holds: Callable[[], bool]) -> None:
    deadline = time.monotonic() + PATIENCE
    while not holds():
        assert time.monotonic() < deadline
        time.sleep(0.002)


def test_a_fault_of_one_controller_fails_its_motions_and_stops_all_others(robot: HardwareRobot) -> None:
    turning, closing = robot.part("base", MobileBase).rotate(1.0), robot.part("gripper", Gripper).move(0.0)
    controller(robot, "hand").told = Failure(MotionErrorCode.COLLISION, "too much force", vendor_code="G9")
    until(lambda: turning.done and closing.done and robot.stopped_at is not None)
    assert closing.status is MotionStatus.FAILED
    assert closing.failure is not None
    assert closing.failure.code is MotionErrorCode.COLLISION
    assert turning.status is MotionStatus.CANCELED
    assert turning.failure is not None
    assert turning.failure.code is MotionErrorCode.STOPPED
    assert "hand: too much force (G9)" in turning.failure.text
    assert robot.stopped
    assert list(robot.faults) == ["hand"]
    assert robot.diagnostics()["hand"].endswith("too much force (G9)")
    assert robot.diagnostics()["stopped"].startswith("yes: hand")
    robot.clear_stop()
    assert not robot.stopped
    assert robot.faults == {}
    assert controller(robot, "hand").calls == ["open", "recover"]
    assert controller(robot, "platform").calls == ["open"]
    controller(robot, "hand").told = Failure(MotionErrorCode.FAULT, "again", "gripper")
    until(lambda: robot.stopped)  # it is noticed anew
    assert robot.faults["hand"].text == "again"
    assert robot.diagnostics()["stopped"] == "yes: gripper: again"


def test_a_second_stop_reaches_each_controller_again(robot: HardwareRobot, monkeypatch: pytest.MonkeyPatch) -> None:
    told: list[str] = []
    monkeypatch.setattr(Controller, "stop", lambda self: told.append(self.name))
    robot.stop()
    first = robot.stopped_at
    robot.stop()
    assert told == 2 * ["platform", "hand"]
    assert robot.stopped_at == first


def test_a_controller_whose_loop_has_crashed_is_connected_anew_and_not_only_recovered(robot: HardwareRobot) -> None:
    hand = controller(robot, "hand")
    hand._crashed(ZeroDivisionError("of the loop"))
    until(lambda: "hand" in robot.faults)
    assert robot.faults["hand"].text == "hand stopped working: ZeroDivisionError: of the loop"
    robot.clear_stop()
    assert hand.calls == ["open", "close", "open"]
    assert robot.faults == {}


def test_a_controller_that_tells_no_serial_number_is_not_the_one_that_was_brought_up(
    robot_model: RobotModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(CONNECTIONS, "resolve", lambda driver: Controller)
    model = replace(
        robot_model,
        connections={"hand": ConnectionConfig("any", ("gripper",))},
        serial_numbers={"hand": "G7"},
        bringup="hand.yaml",
    )
    with pytest.raises(ConnectionFailedError, match="serial number is not reported, that of the bring-up is G7"):
        HardwareRobot(model).connect()


def test_after_a_fault_the_other_controllers_are_watched_on(robot: HardwareRobot) -> None:
    for name in ("platform", "hand"):
        controller(robot, name).told = Failure(MotionErrorCode.FAULT, "broken")
        until(lambda name=name: name in robot.faults)
    assert list(robot.faults) == ["platform", "hand"]


def test_a_silent_controller_is_lost_and_connected_anew_even_if_it_is_heard_again(robot: HardwareRobot) -> None:
    base, platform = robot.part("base", MobileBase), controller(robot, "platform")
    motion = base.rotate(1.0)
    platform.silent_since = robot.clock.now()
    until(lambda: robot.stopped_at is not None)
    assert robot.stopped_at is not None
    assert robot.stopped_at - platform.silent_since > robot.model.safety.watchdog
    assert motion.failure is not None
    assert motion.failure.code is MotionErrorCode.DISCONNECTED
    with pytest.raises(NotConnectedError, match="no message from platform"):
        base.odometry()
    platform.silent_since = None
    with pytest.raises(NotConnectedError):
        base.odometry()
    robot.clear_stop()
    assert platform.calls == ["open", "abandon", "close", "open"]
    base.odometry()
    assert base.rotate(1.0).status is MotionStatus.RUNNING


def test_a_stop_during_a_recovery_stays(robot: HardwareRobot) -> None:
    hand = controller(robot, "hand")
    hand.told = Failure(MotionErrorCode.COLLISION, "too much force")
    until(lambda: "hand" in robot.faults)
    during, go_on = threading.Event(), threading.Event()

    def recovery() -> None:
        during.set()
        assert go_on.wait(PATIENCE)

    hand.during_recovery = recovery
    refused: list[str] = []

    def clear() -> None:
        with pytest.raises(ConnectionFailedError) as error:
            robot.clear_stop()
        refused.append(str(error.value))

    clearing = threading.Thread(target=clear)
    clearing.start()
    assert during.wait(PATIENCE)
    robot.stop()
    go_on.set()
    clearing.join(PATIENCE)
    assert refused == ["the robot was stopped again while its stop was cleared"]
    assert robot.stopped
    with pytest.raises(CommandRefusedError):
        robot.part("base", MobileBase).rotate(1.0)
    robot.clear_stop()
    assert not robot.stopped


def test_a_recovery_that_fails_leaves_the_robot_stopped_with_its_fault(robot: HardwareRobot) -> None:
    hand = controller(robot, "hand")
    hand.told = Failure(MotionErrorCode.COLLISION, "too much force")
    until(lambda: "hand" in robot.faults)
    hand.recovers = False
    with pytest.raises(ConnectionFailedError, match="hand"):
        robot.clear_stop()
    assert robot.stopped
    assert list(robot.faults) == ["hand"]
    hand.recovers = True
    robot.clear_stop()
    assert not robot.stopped


def test_the_loops_of_a_controller_run_from_its_opening_until_it_is_disconnected(
    robot_model: RobotModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    ticked = threading.Event()

    class Looping(Controller):
        def open(self) -> None:
            super().open()
            self.add_loop("ticks", 200.0, lambda elapsed: ticked.set())

    monkeypatch.setattr(CONNECTIONS, "resolve", lambda driver: Looping)
    robot = HardwareRobot(replace(robot_model, connections={"platform": ConnectionConfig("any", ("base",))}))
    for _ in range(2):
        ticked.clear()
        robot.connect()
        assert ticked.wait(PATIENCE)
        assert "platform ticks" in robot.diagnostics()
        robot.disconnect()
        assert robot.connections["platform"].loops == ()
        assert "platform ticks" not in {thread.name for thread in threading.enumerate()}


def test_a_loop_that_crashes_is_a_fault_that_connecting_anew_clears(robot: HardwareRobot) -> None:
    platform = controller(robot, "platform")

    def broken(elapsed: float) -> None:
        raise ZeroDivisionError("of the driver")

    platform.add_loop("broken", 100.0, broken)
    platform.loops[-1].start()
    until(lambda: "platform" in robot.faults)
    assert "stopped working: ZeroDivisionError: of the driver" in robot.faults["platform"].text
    robot.clear_stop()
    assert platform.calls == ["open", "close", "open"]
    assert platform.loops == ()
    time.sleep(0.05)
    assert not robot.stopped


def test_a_watchdog_that_crashes_stops_the_robot_and_watches_again_once_that_is_cleared(robot: HardwareRobot) -> None:
    platform = controller(robot, "platform")
    platform.broken = True
    until(lambda: robot.stopped)
    assert "watchdog stopped working: ZeroDivisionError" in robot.diagnostics()["stopped"]
    platform.broken = False
    robot.clear_stop()
    assert not robot.stopped
    platform.told = Failure(MotionErrorCode.FAULT, "a wheel is blocked")
    until(lambda: robot.stopped)


def test_a_stop_reaches_every_part_and_its_moment_is_the_first(robot: HardwareRobot) -> None:
    motions = [robot.part("base", MobileBase).rotate(1.0), robot.part("gripper", Gripper).move(0.0)]
    assert robot.stopped_at is None
    robot.stop()
    first = robot.stopped_at
    assert first is not None
    assert all(motion.status is MotionStatus.CANCELED for motion in motions)
    robot.clock.sleep(0.01)
    robot.stop()
    assert robot.stopped_at == first
    robot.clear_stop()
    assert robot.stopped_at == first
    robot.clock.sleep(0.01)
    robot.stop()
    assert robot.stopped_at is not None
    assert robot.stopped_at > first


def test_connecting_is_all_or_nothing_and_a_stop_from_before_stays(unconnected: HardwareRobot) -> None:
    unconnected.stop()
    controller(unconnected, "hand").reachable = False
    with pytest.raises(ConnectionFailedError, match="hand"):
        unconnected.connect()
    for name in ("platform", "hand"):
        assert controller(unconnected, name).calls[:2] == ["open", "close"]
    assert not controller(unconnected, "platform").connected
    assert unconnected.diagnostics()["connected"] == "no"
    controller(unconnected, "hand").reachable = True
    with unconnected:
        assert unconnected.stopped
        with pytest.raises(CommandRefusedError):
            unconnected.part("base", MobileBase).rotate(1.0)
    assert unconnected.stopped


@pytest.mark.parametrize("parts", [("base",), ("gripper", "base")])
def test_disconnecting_waits_until_all_parts_rest(
    robot_model: RobotModel, monkeypatch: pytest.MonkeyPatch, parts: tuple[str, ...]
) -> None:
    """And not for ever: nothing drives this base any more."""
    monkeypatch.setattr(CONNECTIONS, "resolve", lambda driver: Controller)
    robot = HardwareRobot(replace(robot_model, connections={"platform": ConnectionConfig("any", parts)}))
    robot.connect()
    base = robot.part("base", DrivenBase)
    base.set_velocity(0.3, 0.0, 0.0)
    base.cycle(0.02)
    begun = time.monotonic()
    controller(robot, "platform").disconnect()
    assert time.monotonic() - begun > 0.5
    robot.disconnect()
    assert controller(robot, "platform").calls[-1] == "close"
    assert not controller(robot, "platform").connected


def test_parts_that_cannot_be_attached_leave_nothing_open(
    unconnected: HardwareRobot, monkeypatch: pytest.MonkeyPatch
) -> None:
    platform = controller(unconnected, "platform")

    def out_of_range() -> None:
        raise ConnectionFailedError("base: outside of its range")

    def opened() -> None:
        platform.add_loop("base", 10.0, lambda elapsed: None)

    monkeypatch.setattr(platform, "open", opened)
    with monkeypatch.context() as failing:
        failing.setattr(platform.parts["base"], "attach", out_of_range)
        for _ in range(2):
            with pytest.raises(ConnectionFailedError, match="range"):
                platform.connect()
            assert platform.loops == ()
            assert platform.calls[-1] == "close"
    platform.connect()
    assert len(platform.loops) == 1
    platform.disconnect()


def test_disconnecting_goes_on_after_the_error_of_a_controller_and_can_be_repeated(robot: HardwareRobot) -> None:
    platform, hand = controller(robot, "platform"), controller(robot, "hand")
    platform.closes = False
    with pytest.raises(OSError, match="platform: broken pipe"):
        robot.disconnect()
    assert not hand.connected
    assert robot.connected
    platform.closes = True
    robot.disconnect()
    assert platform.calls == ["open", "close", "close"]
    assert not robot.connected


def test_a_stop_reaches_the_controllers_after_one_that_cannot_be_stopped(
    robot: HardwareRobot, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken() -> None:
        raise OSError("broken pipe")

    monkeypatch.setattr(controller(robot, "platform"), "stop", broken)
    motion = robot.part("gripper", Gripper).move(0.0)
    with pytest.raises(OSError, match="broken pipe"):
        robot.stop()
    assert motion.status is MotionStatus.CANCELED
