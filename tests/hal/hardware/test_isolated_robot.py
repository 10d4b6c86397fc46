"""A robot in another process: answers belong to their questions, and a stop outlives the process."""

from __future__ import annotations

import multiprocessing
import signal
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from bestman_bt.robot_model import load_robot_model
from hal.api import Arm, MotionErrorCode, MotionStatus, NotConnectedError
from hal.hardware.isolated_robot import IsolatedRobot, RpcClient, RpcConnection
from hal.hardware.robot_process import ROBOT, Call, MotionNumber, Setup


@pytest.fixture
def _interruptible() -> Iterator[None]:
    """Tests that are started in the background begin with the signal ignored."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.usefixtures("_interruptible")
def test_after_an_interrupt_between_question_and_answer_the_next_question_gets_its_own_answer() -> None:
    ours, theirs = multiprocessing.Pipe()
    main, was_interrupted = threading.main_thread().ident, threading.Event()
    assert main is not None

    def serve() -> None:
        question = theirs.recv()
        signal.pthread_kill(main, signal.SIGINT)
        was_interrupted.wait(60.0)
        theirs.send(f"answer to {question}")
        theirs.send(f"answer to {theirs.recv()}")

    wire = RpcConnection(ours)
    server = threading.Thread(target=serve)
    server.start()
    threads = set(threading.enumerate())
    with pytest.raises(KeyboardInterrupt):
        wire.ask("the first")
    was_interrupted.set()
    assert wire.ask("the second") == "answer to the second"
    # Where a question began a thread, an interrupt in the middle of that could leave two on the wire.
    assert set(threading.enumerate()) <= threads
    server.join()
    wire.close()
    with pytest.raises(NotConnectedError):
        wire.ask("the third")


class ScriptedProcess:
    """The other side of a robot: ``stopped``: what it says of its stop; ``asked``: over which wire for what."""

    def __init__(self) -> None:
        self.open = self.stopped = False
        self.asked: list[tuple[str, object, str]] = []

    def start(self, setup: Setup) -> None:
        self.open = True

    def call(self, call: Call) -> object:
        self.asked.append(("calls", call.target, call.method))
        return self.stopped if call.method == "stopped" else None

    def stop(self, call: Call) -> None:
        self.asked.append(("stops", call.target, call.method))

    def close(self) -> None:
        self.open = False


@pytest.fixture
def process(monkeypatch: pytest.MonkeyPatch) -> ScriptedProcess:
    process = ScriptedProcess()
    monkeypatch.setattr("hal.hardware.isolated_robot.RpcClient", lambda: process)
    return process


@pytest.fixture
def robot(process: ScriptedProcess) -> IsolatedRobot:
    return IsolatedRobot(load_robot_model(Path(__file__).parents[1] / "xarm/xarm6_on_a_base.yaml"))


@pytest.mark.parametrize("stopped", [True, False])
def test_a_stop_that_the_other_process_has_latched_outlives_it(
    robot: IsolatedRobot, process: ScriptedProcess, stopped: bool
) -> None:
    robot.connect()
    process.stopped = stopped
    assert robot.stopped is stopped
    robot.disconnect()
    assert not process.open
    assert robot.stopped is stopped


def test_a_stop_without_a_connection_latches_and_is_told_to_the_other_process_as_soon_as_there_is_one(
    robot: IsolatedRobot, process: ScriptedProcess
) -> None:
    robot.connect()
    assert [wire for wire, *_ in process.asked] == ["calls"]
    robot.disconnect()
    robot.stop()
    assert robot.stopped
    assert [wire for wire, *_ in process.asked].count("stops") == 0
    robot.connect()
    assert process.asked[-1] == ("stops", ROBOT, "stop")
    robot.clear_stop()
    robot.disconnect()
    assert not robot.stopped


def test_stops_go_past_what_else_is_asked(robot: IsolatedRobot, process: ScriptedProcess) -> None:
    robot.connect()
    robot.stop()
    robot.part("arm", Arm).stop()
    robot.part("arm", Arm).positions()
    assert process.asked[-3:] == [("stops", ROBOT, "stop"), ("stops", "arm", "stop"), ("calls", "arm", "positions")]


@pytest.mark.parametrize("dies", [True, False])
def test_a_motion_fails_with_the_process_that_it_is_in(dies: bool) -> None:
    ours, theirs = multiprocessing.Pipe()
    client = RpcClient()
    client._calls = RpcConnection(ours)
    theirs.send(MotionNumber(1))
    motion = client.call(Call("arm", "move_to"))
    if dies:
        theirs.close()
    else:
        client.close()
    assert motion.done
    assert (motion.status, motion.failure.code) == (MotionStatus.FAILED, MotionErrorCode.DISCONNECTED)
    client.close()
