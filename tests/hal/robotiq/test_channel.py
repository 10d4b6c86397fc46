"""What a Robotiq gripper's numbers mean, and which of its statuses count; its wire is scripted."""

from __future__ import annotations

from dataclasses import replace

import pytest

from bestman_bt.robot_model.model import GripperModel, RobotModel
from hal.api import MotionErrorCode, NoDataError
from hal.hardware.clock import RealTimeClock
from hal.parts.part_connection import ConnectionFailedError
from hal.robotiq.connection import RobotiqChannel, RobotiqOptions
from hal.robotiq.wire import RobotiqStatus, RobotiqWire


class Wire(RobotiqWire):
    """Answers with ``told``; ``error`` instead, where it is set. ``too_early``: activations that it does not take."""

    def __init__(self) -> None:
        self.told = status()
        self.error: OSError | None = None
        self.calls: list[object] = []
        self.too_early = 0

    def open(self) -> None:
        self._say("open")

    def close(self) -> None:
        self.calls.append("close")

    def reset(self) -> None:
        self._say("reset")
        self.told = replace(self.told, activation=0)

    def activate(self) -> None:
        self._say("activate")
        self.too_early -= 1
        if self.too_early < 0:
            self.told = replace(self.told, activation=3, fault=0, object=3)

    def go(self, position: int, speed: int, force: int) -> None:
        self._say((position, speed, force))

    def halt(self) -> None:
        self._say("halt")

    def status(self) -> RobotiqStatus:
        if self.error is not None:
            raise self.error
        return self.told

    def _say(self, what: object) -> None:
        if self.error is not None:
            raise self.error
        self.calls.append(what)


def status(**values: int) -> RobotiqStatus:
    return replace(RobotiqStatus(activation=3, object=3, fault=0, echo=0, position=3, goes=True), **values)


@pytest.fixture(autouse=True)
def _no_waiting(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("hal.robotiq.connection.RESET_TIME", 0.0)


@pytest.fixture
def wire() -> Wire:
    return Wire()


@pytest.fixture
def channel(robot_model: RobotModel, wire: Wire) -> RobotiqChannel:
    made = RobotiqChannel("hand", robot_model.of(GripperModel)["gripper"], RobotiqOptions(), RealTimeClock())
    made.open(wire)
    return made


def test_an_object_counts_only_in_answer_to_the_last_order(channel: RobotiqChannel, wire: Wire) -> None:
    options = RobotiqOptions()
    for position, width in ((100, 0.0), (60, 0.02)):
        channel.send(width, 30.0, 0.1)
        sent = wire.calls[-1]
        assert isinstance(sent, tuple)
        for felt in (0, 1, 2, 3):
            wire.told = status(object=felt, echo=sent[0], position=position)
            channel.refresh()
            assert channel.read().object_held is (felt in (1, 2))
            wire.told = status(object=felt, echo=sent[0] - 1, position=position)  # of before the order
            channel.refresh()
            assert channel.read().object_held is False
    wire.told = status(object=2, echo=sent[0])
    channel.activate()
    assert channel.read().object_held is False  # nothing was asked since
    assert options.open_position < options.closed_position


@pytest.mark.parametrize("told", [{"activation": 0}, {"goes": False}, {"position": 4}], ids=str)
def test_a_gripper_without_power_one_that_goes_nowhere_and_fingers_that_have_not_moved_hold_nothing(
    channel: RobotiqChannel, wire: Wire, told: dict[str, int]
) -> None:
    channel.send(0.0, 30.0, 0.1)
    (asked, _, _) = wire.calls[-1]  # type: ignore[misc]
    wire.told = status(object=2, echo=asked, position=100)
    channel.refresh()
    assert channel.read().object_held
    channel.send(0.04, 30.0, 0.1)
    channel.send(0.0, 30.0, 0.1)
    wire.told = status(object=2, echo=asked, **{"position": 150, **told})
    if "position" in told:
        channel._from, channel._moved = 3, False
    channel.refresh()
    assert channel.read().object_held is False


def test_a_gripper_that_is_not_active_any_more_is_a_fault(channel: RobotiqChannel, wire: Wire) -> None:
    assert channel.fault is None
    wire.told = status(activation=0)
    channel.refresh()
    assert channel.fault is not None
    assert channel.fault.vendor_code == "gSTA 0"


def test_a_hand_that_may_hold_something_is_activated_only_where_that_is_allowed(
    robot_model: RobotModel, wire: Wire
) -> None:
    for allowed in (False, True):
        options = RobotiqOptions(activate_holding=allowed)
        channel = RobotiqChannel("hand", robot_model.of(GripperModel)["gripper"], options, RealTimeClock())
        wire.told = status(object=2, position=100)
        channel.open(wire)
        wire.told = status(activation=0, object=0, position=100)
        channel.refresh()
        wire.calls.clear()
        if allowed:
            channel.activate()
            assert wire.calls == ["reset", "activate"]
        else:
            with pytest.raises(ConnectionFailedError, match="activate_holding: true"):
                channel.activate()
            assert wire.calls == []


def test_widths_forces_and_speeds_become_its_numbers_and_widths_come_back(
    channel: RobotiqChannel, wire: Wire, robot_model: RobotModel
) -> None:
    model, options = robot_model.of(GripperModel)["gripper"], RobotiqOptions()
    for width, position in ((model.max_width, options.open_position), (model.part.min_width, options.closed_position)):
        channel.send(width, model.part.max_force, options.least_speed)
        assert wire.calls[-1] == (position, 0, 255)
        wire.told = status(position=position)
        channel.refresh()
        assert channel.read().width == pytest.approx(width)
    channel.send((model.part.min_width + model.max_width) / 2, options.least_force, model.part.max_speed)
    assert wire.calls[-1] == (round((options.open_position + options.closed_position) / 2), 255, 0)
    wire.told = status(position=255)  # closed beyond where it closes
    channel.refresh()
    assert channel.read().width == model.part.min_width


def test_a_gripper_that_is_active_and_well_is_not_activated_again(channel: RobotiqChannel, wire: Wire) -> None:
    assert wire.calls == ["open"]
    wire.told = status(activation=1)
    channel.activate()
    assert wire.calls == ["open", "reset", "activate"]
    wire.told = status(fault=14)
    channel.refresh()
    assert channel.fault is not None
    assert channel.fault.code is MotionErrorCode.FAULT
    channel.activate()
    assert wire.calls[-2:] == ["reset", "activate"]
    assert channel.fault is None


def test_an_activation_that_comes_too_early_is_repeated(channel: RobotiqChannel, wire: Wire) -> None:
    wire.told, wire.too_early = status(activation=0), 2
    channel.activate()
    assert wire.calls[1:] == ["reset", "activate", "activate", "activate"]


def test_what_is_not_answered_closes_the_wire_and_keeps_the_last_status(channel: RobotiqChannel, wire: Wire) -> None:
    heard = channel.heard
    wire.error = TimeoutError("no answer")
    channel.send(0.0, 30.0, 0.1)
    assert channel.heard == heard
    assert wire.calls[-1] == "close"
    assert channel.read().width > 0.0
    channel.close()
    wire.calls.clear()
    channel.halt()
    channel.close()
    assert wire.calls == []


def test_a_gripper_that_cannot_be_reached_or_says_nothing_is_reported_in_words(
    robot_model: RobotModel, wire: Wire
) -> None:
    channel = RobotiqChannel("hand", robot_model.of(GripperModel)["gripper"], RobotiqOptions(), RealTimeClock())
    with pytest.raises(NoDataError, match="hand"):
        channel.read()
    wire.error = ConnectionRefusedError("192.168.7.7 refused")
    with pytest.raises(ConnectionFailedError, match="ConnectionRefusedError") as refusal:
        channel.open(wire)
    assert "192.168" not in str(refusal.value)
