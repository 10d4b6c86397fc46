"""What stops a robot from outside reaches every controller, and silence of it does, too."""

from __future__ import annotations

import socket
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from bestman_bt.configuration.errors import ConfigurationError
from bestman_bt.registry import CONNECTIONS
from bestman_bt.robot_model.compose import load_robot_model
from bestman_bt.robot_model.connection_config import ConnectionConfig, SafetyConfig, StopInputConfig
from bestman_bt.robot_model.model import RobotModel
from hal.api import Arm, Gripper, MobileBase, MotionErrorCode
from hal.hardware.robot import STOP_INPUT, HardwareRobot
from hal.hardware.stop_input import StopInput
from hal.parts.part_connection import ConnectionFailedError
from hal.twins.process import TwinProcess
from tests.hal.hardware.test_stop_of_a_robot import Controller, until
from tests.hal.twinned import twin_settings, wait_for

SILENCE = 0.3


class Button:
    """Says its word every 50 ms."""

    def __init__(self, port: int) -> None:
        self.word = b"run\n"
        self._port, self._end = port, threading.Event()
        self._thread = threading.Thread(target=self._speak, daemon=True)
        self._thread.start()

    def _speak(self) -> None:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as wire:
            while not self._end.wait(0.05):
                if self.word:
                    wire.sendto(self.word, ("127.0.0.1", self._port))

    def close(self) -> None:
        self._end.set()
        self._thread.join()


def free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as wire:
        wire.bind(("127.0.0.1", 0))
        return int(wire.getsockname()[1])


@contextmanager
def pressed_by(port: int) -> Iterator[Button]:
    button = Button(port)
    try:
        yield button
    finally:
        button.close()


def two_controllers(model: RobotModel, monkeypatch: pytest.MonkeyPatch, port: int) -> HardwareRobot:
    monkeypatch.setattr(CONNECTIONS, "resolve", lambda driver: Controller)
    connections = {"platform": ConnectionConfig("any", ("base",)), "hand": ConnectionConfig("any", ("gripper",))}
    safety = SafetyConfig(stop_input=StopInputConfig(f"127.0.0.1:{port}", SILENCE))
    return HardwareRobot(replace(model, connections=connections, safety=safety))


@pytest.mark.parametrize(
    ("word", "why"), [(b"stop", "the stop input reports stop"), (b"", "the stop input has sent nothing for 0.3 s")]
)
def test_a_stop_and_silence_reach_all_controllers_and_hold_until_it_says_run(
    robot_model: RobotModel, monkeypatch: pytest.MonkeyPatch, word: bytes, why: str
) -> None:
    port = free_port()
    with pressed_by(port) as button, two_controllers(robot_model, monkeypatch, port) as robot:
        motions = robot.part("base", MobileBase).rotate(1.0), robot.part("gripper", Gripper).move(0.0)
        button.word = word
        until(lambda: all(motion.done for motion in motions))
        for motion in motions:
            assert motion.failure is not None
            assert (motion.failure.code, why in motion.failure.text) == (MotionErrorCode.STOPPED, True)
        assert robot.faults[STOP_INPUT].text == why
        with pytest.raises(ConnectionFailedError, match=why):
            robot.clear_stop()
        assert robot.stopped
        button.word = b"run"
        until(lambda: _cleared(robot))
        assert robot.faults == {}


class Wire:
    """In place of a socket: datagrams that wait to be read."""

    def __init__(self, *of: object) -> None:
        self.words: list[bytes] = [b"run"]

    def setblocking(self, blocks: bool) -> None:
        pass

    def bind(self, address: tuple[str, int]) -> None:
        pass

    def recv(self, most: int) -> bytes:
        if not self.words:
            raise BlockingIOError
        return self.words.pop(0)

    def close(self) -> None:
        pass


@pytest.fixture
def wires(monkeypatch: pytest.MonkeyPatch) -> tuple[StopInput, list[Wire], Callable[[float], None]]:
    """A stop input, the wires that it has opened, and what lets seconds pass."""
    now, opened = [100.0], list[Wire]()

    def wait(seconds: float) -> None:
        now[0] += seconds

    names = {"AF_INET": socket.AF_INET, "AF_INET6": socket.AF_INET6, "SOCK_DGRAM": socket.SOCK_DGRAM}
    made = SimpleNamespace(socket=lambda *of: opened.append(Wire()) or opened[-1], **names)
    monkeypatch.setattr("hal.hardware.stop_input.socket", made)
    monkeypatch.setattr("hal.hardware.stop_input.time", SimpleNamespace(monotonic=lambda: now[0], sleep=wait))
    return StopInput(StopInputConfig("127.0.0.1:5005", SILENCE)), opened, wait


def test_of_words_that_come_together_a_stop_is_not_missed(wires) -> None:
    heard, opened, _ = wires
    heard.open()
    for words, says_stop in (([b"stop", b"run"], True), ([], False), ([b"run", b" STOP\n"], True), ([], True)):
        opened[-1].words += words
        assert (heard.look() == "the stop input reports stop") == says_stop, words


def test_what_is_no_word_is_no_sign_of_life_and_a_word_of_before_a_reconnection_does_not_count(wires) -> None:
    heard, opened, wait = wires
    heard.open()
    wait(0.9 * SILENCE)
    opened[-1].words += [b"hello", b"runs"]
    assert heard.look() is None
    wait(0.2 * SILENCE)
    opened[-1].words += [b"hello"]
    assert heard.look() == "the stop input has sent nothing for 0.3 s"
    opened[-1].words += [b"run"]
    assert heard.look() is None
    heard.close()
    assert heard.look() == "the stop input has sent nothing for 0.3 s"


def _cleared(robot: HardwareRobot) -> bool:
    try:
        robot.clear_stop()
    except ConnectionFailedError:
        return False
    return not robot.stopped


def test_without_a_word_of_it_nothing_is_connected_and_two_robots_cannot_hear_the_same(
    robot_model: RobotModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    port = free_port()
    robot = two_controllers(robot_model, monkeypatch, port)
    with pytest.raises(ConnectionFailedError, match="and motion requires its 'run'"):
        robot.connect()
    with pressed_by(port), robot:
        with pytest.raises(ConnectionFailedError, match="cannot listen at"):
            two_controllers(robot_model, monkeypatch, port).connect()
        assert not robot.stopped


@pytest.mark.parametrize(
    ("written", "told"),
    [
        ("{address: 5005}", "stop_input.address: "),
        ("{address: 'here:99999'}", "should be HOST:PORT, as 127.0.0.1:5005, got 'here:99999'"),
        ("{address: '127.0.0.1:5005', silence: 0 s}", "stop_input.silence: should be greater than 0"),
        ("{silence: 1 s}", "stop_input.address: is missing"),
    ],
)
def test_a_wrong_input_is_reported_with_its_line(tmp_path: Path, written: str, told: str) -> None:
    path = tmp_path / "robot.yaml"
    path.write_text(f"parts:\n  base: {{part: differential_base}}\nsafety:\n  stop_input: {written}\n")
    with pytest.raises(ConfigurationError) as error:
        load_robot_model(path)
    assert "robot.yaml:4: safety.stop_input" in str(error.value)
    assert told in str(error.value)


@pytest.mark.slow
@pytest.mark.real_time
@pytest.mark.alone
def test_a_stop_of_one_vendors_controller_and_one_from_outside_stop_those_of_all_vendors() -> None:
    for sdk in ("xarm", "roslibpy"):
        pytest.importorskip(sdk, reason="the vendors' SDKs are not installed")
    port = free_port()
    with TwinProcess("diff_xarm6", "pick_place_table", 3) as twin, pressed_by(port) as button:
        settings = twin_settings(twin, safety__stop_input={"address": f"127.0.0.1:{port}"})
        with HardwareRobot(load_robot_model("diff_xarm6", settings)) as robot:
            arm, base = robot.part("arm", Arm), robot.part("base", MobileBase)

            def stops_both(strike: str) -> None:
                here = arm.positions()
                motions = (
                    arm.move_to(here + 0.6 * np.eye(6)[0] * (-1.0 if here[0] > 0.0 else 1.0), 0.1),
                    base.rotate(3.0),
                )
                wait_for(lambda: abs(float(arm.positions()[0] - here[0])) > 0.02, "the arm moves")
                wait_for(lambda: abs(base.velocity().wz) > 0.05, "the base turns")
                if strike == "button":
                    button.word = b"stop"
                else:
                    twin.fault(strike, "protective_stop" if strike == "arm_controller" else "cut")
                wait_for(lambda: all(motion.done for motion in motions), "both are stopped")
                assert robot.stopped
                wait_for(lambda: float(np.max(np.abs(arm.velocities()))) < 0.01, "the arm rests")

            stops_both("button")
            button.word = b"run"
            wait_for(lambda: _cleared(robot), "the stop is cleared")
            wait_for(lambda: abs(base.velocity().wz) < 0.01, "the base rests")
            stops_both("arm_controller")
            assert "arm_controller" in robot.faults
            wait_for(lambda: abs(base.velocity().wz) < 0.01, "the base rests")
