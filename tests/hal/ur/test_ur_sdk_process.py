"""The process of the UR's SDK while its parent is silent; the SDK's modules are scripted and write down their calls."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from hal.hardware.clock import RealTimeClock
from hal.parts.part_connection import ConnectionFailedError
from hal.ur.link import URLink
from tests.hal.twinned import PATIENCE, wait_for

SDK = '''
import os, time

class Scripted:
    """Rests, runs, and answers all that it is asked, but for what its address stands for."""

    FLAG_UPLOAD_SCRIPT = 1
    zeros = [0.0] * 6
    answers = {
        "isInRemoteControl": True, "safetymode": "Safetymode: NORMAL", "robotmode": "Robotmode: RUNNING",
        "isProgramRunning": True, "getRuntimeState": 2, "getRobotMode": 7, "getSafetyMode": 1,
        "getActualQ": zeros, "getActualQd": zeros, "getTargetMoment": zeros, "getActualTCPPose": zeros,
        "getFtRawWrench": zeros, "getActualDigitalInputBits": 0, "getActualDigitalOutputBits": 0,
        "getSpeedScalingCombined": 1.0, "isAsyncOperationRunning": False, "speedJ": True,
    }

    def __init__(self, address, *_):
        self.address = address

    def connect(self, _):
        if self.address == "192.168.7.7":
            raise RuntimeError("no route to " + self.address)

    def getAsyncOperationProgressEx(self):
        return self

    def getTimestamp(self):
        return time.monotonic()

    def getTCPOffset(self):
        time.sleep(3600.0)

    def __getattr__(self, name):
        with open(os.environ["SDK_CALLS"], "a") as calls:
            calls.write(name + "\\n")
        return lambda *_: self.answers.get(name)

DashboardClient = RTDEControlInterface = RTDEReceiveInterface = Scripted
'''
SETTINGS = {
    "connect_timeout": 1.0,
    "rate": 100.0,
    "deceleration": 4.0,
    "lookahead": 0.1,
    "gain": 300.0,
    "heartbeat": 0.3,
    "longest_step": 0.2,
    "watchdog": 1.0 / PATIENCE,  # a motion of the controller's own may go on for so long without being renewed
}
UNHURRIED = {**SETTINGS, "heartbeat": PATIENCE}
ARM = [0.1] * 6


@pytest.fixture
def calls(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The file that has the names of the SDK's functions that were called, a line each."""
    for module in ("dashboard_client", "rtde_control", "rtde_receive"):
        (tmp_path / f"{module}.py").write_text(SDK)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    monkeypatch.setenv("SDK_CALLS", str(tmp_path / "calls"))
    return tmp_path / "calls"


@pytest.fixture
def link(calls: Path) -> Iterator[URLink]:
    made = URLink("arm_controller", RealTimeClock())
    yield made
    made.kill()


def count(calls: Path, name: str) -> int:
    return calls.read_text().split().count(name)


def lapsed(link: URLink) -> bool:
    report = link.pump()
    return report is not None and report.lapsed != ""


def test_an_arm_that_was_braked_for_a_silent_program_follows_nothing_until_it_is_recovered(
    link: URLink, calls: Path
) -> None:
    link.open("127.0.0.1", SETTINGS, PATIENCE)
    link.send(ARM)
    wait_for(lambda: count(calls, "servoJ") == 1, "the set-point is followed")
    wait_for(lambda: lapsed(link), "the arm is braked")
    assert count(calls, "servoStop") == 1
    link.send(ARM)
    link.call("arm", timeout=PATIENCE)  # answered after the set-point was read
    assert count(calls, "servoJ") == 1
    link.call("recover", timeout=PATIENCE)
    link.send(ARM)
    wait_for(lambda: count(calls, "servoJ") == 2, "the set-point is followed again")


def test_a_set_point_that_is_too_far_from_the_last_one_is_not_sent_and_the_arm_is_braked(
    link: URLink, calls: Path
) -> None:
    """As after this process was held up: of all set-points that wait, only the newest counts."""
    link.open("127.0.0.1", UNHURRIED, PATIENCE)
    for target in (ARM, [0.29] * 6, [*[0.29] * 5, 0.51]):
        link.send(target)
        link.call("arm", timeout=PATIENCE)  # answered after the set-point was read
    wait_for(lambda: lapsed(link), "the arm is braked")
    assert (count(calls, "servoJ"), count(calls, "servoStop")) == (2, 1)
    report = link.pump()
    assert report is not None
    assert "held up" in report.lapsed
    link.call("recover", timeout=PATIENCE)
    link.send(ARM)
    wait_for(lambda: count(calls, "servoJ") == 3, "set-points are followed again")


@pytest.mark.parametrize("between", ["speed_joints", "recover"])
def test_a_stream_that_begins_anew_is_measured_from_where_the_arm_is(link: URLink, calls: Path, between: str) -> None:
    """The scripted arm is at 0 throughout, as one that was stopped, or moved by hand, since the last set-point."""
    link.open("127.0.0.1", UNHURRIED, PATIENCE)
    for position in (0.15, 0.3, 0.45):
        link.send([position] * 6)
        link.call("arm", timeout=PATIENCE)
    if between == "recover":
        link.call("recover", timeout=PATIENCE)
    else:
        link.call("speed_joints", ARM, 1.0, timeout=PATIENCE)
        link.call("stop_speed", timeout=PATIENCE)
    link.send([0.05] * 6)
    wait_for(lambda: count(calls, "servoJ") == 4, "the set-point is followed")
    assert not lapsed(link)


def test_the_first_set_point_may_not_be_far_from_the_arm(link: URLink, calls: Path) -> None:
    link.open("127.0.0.1", SETTINGS, PATIENCE)
    link.send([0.3] * 6)
    wait_for(lambda: lapsed(link), "the arm is braked")
    assert "servoJ" not in calls.read_text()


def test_a_motion_of_the_controllers_own_is_braked_when_the_program_is_silent(link: URLink, calls: Path) -> None:
    link.open("127.0.0.1", SETTINGS, PATIENCE)
    link.call("speed_joints", ARM, 1.0, timeout=PATIENCE)
    before = count(calls, "servoStop")
    link.send(None)
    wait_for(lambda: lapsed(link), "the arm is braked")
    link.call("arm", timeout=PATIENCE)  # the program is read again once it has braked
    assert (count(calls, "speedStop"), count(calls, "servoStop")) == (1, before)
    with pytest.raises(ConnectionFailedError, match="was not renewed in time"):
        link.call("renew", timeout=PATIENCE)


def test_errors_of_the_sdk_have_no_addresses(link: URLink) -> None:
    with pytest.raises(ConnectionFailedError, match="arm_controller: .*: no route to its address"):
        link.open("192.168.7.7", SETTINGS, PATIENCE)


def test_an_sdk_that_does_not_answer_is_killed_before_it_can_act(link: URLink) -> None:
    link.open("127.0.0.1", SETTINGS, PATIENCE)
    with pytest.raises(ConnectionFailedError, match=r"does not answer within 0\.2 s"):
        link.call("identity", timeout=0.2)
    assert not link.alive
    with pytest.raises(ConnectionFailedError, match="is not connected"):
        link.call("arm", timeout=PATIENCE)
