"""A robot in another process: answers belong to their questions, and a stop outlives the process."""

from __future__ import annotations

import contextlib
import multiprocessing
import signal
import subprocess
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from bestman_bt.robot_model.compose import load_robot_model
from hal.api import Arm, Failure, MotionErrorCode, MotionStatus, NotConnectedError
from hal.hardware.isolated_robot import PROCESS, STOP_TIME, IsolatedRobot, RpcClient, RpcConnection, WireEndedError
from hal.hardware.robot_process import ROBOT, STOPS, Call, MotionNumber, ServerSetup
from hal.parts.part_connection import ConnectionFailedError


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
        was_interrupted.wait(2.0)  # a signal just before the wait for the answer ends it only then
        theirs.send(f"answer to {question}")
        theirs.send(f"answer to {theirs.recv()}")

    wire = RpcConnection(ours)
    server = threading.Thread(target=serve)
    server.start()
    threads = set(threading.enumerate())
    with pytest.raises(KeyboardInterrupt):
        wire.ask("the first").result()
    was_interrupted.set()
    assert wire.ask("the second").result() == "answer to the second"
    # Where a question began a thread, an interrupt in the middle of that could leave two on the wire.
    assert set(threading.enumerate()) <= threads
    server.join()
    wire.close()
    with pytest.raises(WireEndedError):
        wire.ask("the third")


class ScriptedProcess:
    """The other side of a robot: ``stopped``: what it says of its stop; ``asked``: over which wire for what."""

    def __init__(self) -> None:
        self.open = self.stopped = False
        self.lost: Failure | None = None
        self.refuses = False
        self.asked: list[tuple[str, object, str]] = []

    def start(self, setup: ServerSetup) -> None:
        if self.refuses:
            raise NotConnectedError("no controller answers")
        self.open, self.lost = True, None

    def call(self, call: Call) -> object:
        self.asked.append(("calls", call.target, call.method))
        return self.stopped if call.method == "stopped" else None

    def stop(self, call: Call) -> None:
        if not self.open:
            return
        self.asked.append(("stops", call.target, call.method))

    def close(self) -> None:
        self.open = False


@pytest.fixture
def process(monkeypatch: pytest.MonkeyPatch) -> ScriptedProcess:
    process = ScriptedProcess()
    monkeypatch.setattr("hal.hardware.isolated_robot.RpcClient", lambda parts, when_lost: process)
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


def test_a_stop_without_a_connection_latches_and_is_sent_to_the_other_process_once_connected(
    robot: IsolatedRobot, process: ScriptedProcess
) -> None:
    robot.connect()
    assert process.asked == [("calls", ROBOT, "connect")]
    robot.disconnect()
    robot.stop()
    assert robot.stopped
    assert [wire for wire, *_ in process.asked].count("stops") == 0
    robot.connect()
    assert process.asked[-1] == ("stops", ROBOT, "stop")
    robot.clear_stop()
    robot.disconnect()
    assert not robot.stopped


def test_a_new_process_is_told_what_the_hand_holds_before_it_connects(
    robot: IsolatedRobot, process: ScriptedProcess
) -> None:
    robot.connect()
    robot.part("arm", Arm).carry(0.4, (0.0, 0.0, 0.02))
    assert process.asked[-1] == ("calls", "arm", "carry")
    process.lost, process.open = Failure(MotionErrorCode.DISCONNECTED, "it was killed"), False
    process.asked.clear()
    robot.connect()
    assert process.asked[:2] == [("calls", "arm", "carry"), ("calls", ROBOT, "connect")]


def test_a_new_process_is_told_the_operators_speed_and_where_the_black_box_belongs(
    robot: IsolatedRobot, process: ScriptedProcess, tmp_path: Path
) -> None:
    robot.set_speed(0.3)
    robot.keep_black_box_in(tmp_path)
    robot.connect()
    assert process.asked == [("calls", ROBOT, what) for what in ("connect", "set_speed", "keep_black_box_in")]
    robot.set_speed(0.0)
    assert process.asked[-1] == ("stops", ROBOT, "set_speed")


def test_stops_go_past_what_else_is_asked(robot: IsolatedRobot, process: ScriptedProcess) -> None:
    robot.connect()
    robot.stop()
    robot.part("arm", Arm).stop()
    robot.part("arm", Arm).positions()
    assert process.asked[-3:] == [("stops", ROBOT, "stop"), ("stops", "arm", "stop"), ("calls", "arm", "positions")]


class Wires:
    """A client of two parts whose other ends are here; ``lost``: what it tells when the process is lost."""

    def __init__(self) -> None:
        self.lost: list[Failure] = []
        self.client = RpcClient(("arm", "camera"), self.lost.append)
        names = (STOPS, ROBOT, "arm", "camera")
        pairs = [multiprocessing.Pipe() for _ in names]
        self.client._wires = {name: RpcConnection(ours) for name, (ours, _) in zip(names, pairs, strict=True)}
        self.theirs = {name: theirs for name, (_, theirs) in zip(names, pairs, strict=True)}
        self.client._process = self.process = subprocess.Popen(["sleep", "600"])
        threading.Thread(target=self._end_with_it, daemon=True).start()

    def _end_with_it(self) -> None:
        self.process.wait()
        for wire in self.theirs.values():
            wire.close()


@pytest.fixture
def wires() -> Iterator[Wires]:
    wires = Wires()
    yield wires
    wires.process.kill()
    wires.client.close()


@pytest.mark.parametrize("dies", [True, False])
def test_a_motion_fails_with_the_process_that_it_is_in(wires: Wires, dies: bool) -> None:
    wires.theirs["arm"].send(MotionNumber(1))
    motion = wires.client.call(Call("arm", "move_to"))
    wires.process.kill()
    if not dies:
        wires.client.close()
    assert motion.done
    assert (motion.status, motion.failure.code) == (MotionStatus.FAILED, MotionErrorCode.DISCONNECTED)
    assert [fault.code for fault in wires.lost] == ([MotionErrorCode.DISCONNECTED] if dies else [])


def test_a_process_that_does_not_answer_a_stop_is_killed_and_what_waited_for_it_hears_why(wires: Wires) -> None:
    heard: list[Exception] = []

    def ask_for_an_image() -> None:
        try:
            wires.client.call(Call("camera", "capture"))
        except NotConnectedError as error:
            heard.append(error)

    waiting = threading.Thread(target=ask_for_an_image)
    waiting.start()
    with pytest.raises(NotConnectedError, match=f"did not answer a stop within {STOP_TIME:g} s"):
        wires.client.stop(Call(ROBOT, "stop"))
    waiting.join(10.0)
    assert wires.process.wait(10.0) == -signal.SIGKILL
    assert "did not answer a stop" in str(heard[0])
    assert not wires.client.open
    assert [fault.text for fault in wires.lost] == [wires.client.lost.text] if wires.client.lost else False
    with pytest.raises(NotConnectedError, match="did not answer a stop"):
        wires.client.call(Call("arm", "positions"))


def test_neither_stop_nor_cancel_nor_readings_wait_for_an_image(wires: Wires) -> None:
    threading.Thread(target=lambda: suppressed(wires.client, Call("camera", "capture")), daemon=True).start()
    assert wires.theirs["camera"].recv().method == "capture"
    for name, answer in (("arm", [0.0] * 6), (STOPS, None)):
        wires.theirs[name].send(answer)
    assert wires.client.call(Call("arm", "positions")) == [0.0] * 6
    wires.client.stop(Call(1, "cancel"))
    assert wires.theirs[STOPS].recv().method == "cancel"


def suppressed(client: RpcClient, call: Call) -> None:
    with contextlib.suppress(NotConnectedError):
        client.call(call)


def test_a_robot_whose_process_is_lost_is_stopped_reports_why_and_is_connected_again_by_clearing_the_stop(
    robot: IsolatedRobot, process: ScriptedProcess
) -> None:
    robot.connect()
    process.lost, process.open = Failure(MotionErrorCode.DISCONNECTED, "it was killed"), False
    robot._description.stop(process.lost)
    robot.stop()
    assert robot.stopped
    assert robot.faults[PROCESS] == process.lost
    assert "it was killed" in robot.diagnostics()[PROCESS]
    assert "it was killed" in robot.diagnostics()["stopped"]
    process.refuses = True
    for _ in range(2):  # a first attempt that fails is not forgotten
        with pytest.raises(NotConnectedError):
            robot.clear_stop()
        assert robot.stopped
    process.refuses = False
    robot.clear_stop()
    assert process.open
    assert not robot.stopped


def test_a_stop_while_a_lost_process_is_begun_anew_is_not_cleared(
    robot: IsolatedRobot, process: ScriptedProcess, monkeypatch: pytest.MonkeyPatch
) -> None:
    robot.connect()
    process.lost, process.open = Failure(MotionErrorCode.DISCONNECTED, "it was killed"), False
    robot._description.stop(process.lost)
    starts = process.start

    def start(setup: ServerSetup) -> None:
        starts(setup)
        robot.stop()
        process.stopped = True

    monkeypatch.setattr(process, "start", start)
    with pytest.raises(ConnectionFailedError, match="stopped again"):
        robot.clear_stop()
    assert robot.stopped
    assert ("calls", ROBOT, "clear_stop") not in process.asked
    assert ("stops", ROBOT, "stop") in process.asked
    process.stopped = False  # the other process has cleared it, when it is asked to
    robot.clear_stop()
    assert ("calls", ROBOT, "clear_stop") in process.asked
    assert not robot.stopped
