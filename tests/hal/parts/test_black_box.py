"""The last minute of a part in bounded memory, written down at stops and failed motions."""

from __future__ import annotations

import json
import threading
from pathlib import Path

import numpy as np
import pytest

from bestman_bt.messages.black_box import BlackBox, BlackBoxError, PartTrace
from hal.api import MotionStatus
from hal.parts.black_box import AFTERWARDS, HIGHEST_RATE, MOST_FILES, SPAN, StopRecorder, Trace
from hal.parts.channels import traces
from hal.parts.stop_latch import StopLatch
from hal.parts.streamed_joints import StreamedJointGroup
from tests.hal.parts.test_streamed_joints import MODEL, PERIOD, Joints


class Clock:
    def __init__(self) -> None:
        self.time = 100.0

    def now(self) -> float:
        return self.time


def test_a_trace_keeps_a_minute_in_bounded_memory_whatever_the_rate() -> None:
    clock = Clock()
    trace = Trace(("set width",), clock.now)
    for step in range(300_000):
        clock.time = 100.0 + step * 1e-3  # twice as often as rows are kept
        row = trace.row()
        if row is not None:
            row[:] = step
    taken = trace.taken()
    assert clock.time - taken.times[0] == pytest.approx(SPAN + AFTERWARDS, abs=0.01)
    assert np.all(np.diff(taken.times) > 0.9 / HIGHEST_RATE)
    assert taken.of("set width")[-1] == pytest.approx(299_999, abs=2)
    kept = sum(block.times.nbytes + block.values.nbytes for block in trace._blocks)
    assert kept < 1.1 * (SPAN + 3.0) * HIGHEST_RATE * (8 + 4)


def recorded(tmp_path: Path) -> tuple[StreamedJointGroup, Joints, StopRecorder, Clock]:
    clock, channel = Clock(), Joints(2)
    group = StreamedJointGroup("head", MODEL, channel, StopLatch(), PERIOD)
    group.attach()
    recorder = StopRecorder(traces({"head": group}, clock.now), clock.now)
    recorder.keep_in(tmp_path)
    return group, channel, recorder, clock


def run(group: StreamedJointGroup, recorder: StopRecorder, clock: Clock, seconds: float) -> None:
    for _ in range(round(seconds / PERIOD)):
        group.cycle(PERIOD)
        clock.time += PERIOD
        recorder.look()


def test_a_stop_is_written_with_what_led_to_it_and_how_the_joints_came_to_rest(tmp_path: Path) -> None:
    group, channel, recorder, clock = recorded(tmp_path)
    group.move_to([1.0, 0.0])
    run(group, recorder, clock, 1.0)
    channel.off = np.array([0.02, 0.0])
    group.stop()
    recorder.stopped("stop() was called")
    stopped = clock.time
    recorder.stopped("a fault that came of it")
    run(group, recorder, clock, AFTERWARDS / 2)
    assert not list(tmp_path.iterdir())
    run(group, recorder, clock, 1.0)
    (file,) = tmp_path.iterdir()
    box = BlackBox.load(file)
    assert (file.name, box.stopped_at, box.reason) == ("black_box_1.npz", stopped, "stop() was called")
    head = box.parts["head"]
    assert head.times[-1] == pytest.approx(stopped + AFTERWARDS, abs=2 * PERIOD)
    assert head.times[0] < stopped - 0.9
    off = head.of("measured position pan") - head.of("set position pan")
    assert off[np.searchsorted(head.times, stopped) - 2] == pytest.approx(0.0, abs=1e-6)
    assert off[-1] == pytest.approx(0.02, abs=1e-6)
    speeds = head.of("set velocity pan")
    assert speeds[np.searchsorted(head.times, stopped) - 2] > 0.2
    assert speeds[-1] == 0.0


def test_a_motion_that_fails_is_written_though_the_robot_does_not_stop(tmp_path: Path) -> None:
    group, channel, recorder, clock = recorded(tmp_path)
    motion = group.move_to([1.0, 0.0])
    run(group, recorder, clock, 0.5)
    channel.off = np.array([-0.3, 0.0])
    run(group, recorder, clock, 2.0)
    assert motion.status is MotionStatus.FAILED
    box = BlackBox.load(tmp_path / "black_box_1.npz")
    assert box.reason == "head: pan is 0.300 off its set-point, its tolerance is 0.15"
    group.brake()  # nothing is under way: nothing is written
    run(group, recorder, clock, 2.0)
    assert len(list(tmp_path.iterdir())) == 1


def test_what_is_to_be_written_is_written_at_the_end_and_no_run_fills_the_disk(tmp_path: Path) -> None:
    _, _, recorder, clock = recorded(tmp_path)
    recorder.stopped("first")
    recorder.keep_in(None)
    recorder.stopped("after the run")
    recorder.flush()
    assert [BlackBox.load(file).reason for file in tmp_path.iterdir()] == ["first"]
    recorder.keep_in(tmp_path)
    for _ in range(2 * MOST_FILES):
        recorder.stopped("again")
        clock.time += 1.0
        recorder.look()
    assert len(list(tmp_path.iterdir())) == 1 + MOST_FILES


def test_the_gates_reasons_are_reported_once_each_and_numbers_make_no_other_one() -> None:
    clock = Clock()
    trace = Trace(("set width",), clock.now)
    for reason in (
        "",
        "the tool would be at x = 0.1 m",
        "the tool would be at x = 0.2 m",
        "",
        "pan would leave its range",
    ):
        clock.time += 1.0
        trace.note(reason)
    assert trace.taken().reasons == (
        (102.0, "the tool would be at x = 0.1 m"),
        (104.0, ""),
        (105.0, "pan would leave its range"),
    )


def test_a_damaged_file_is_reported(tmp_path: Path) -> None:
    path = tmp_path / "black_box_1.npz"
    BlackBox(1.0, "x", {"arm": PartTrace(np.zeros(2), np.zeros((2, 1), np.float32), ("set width",))}).save(path)
    good = path.read_bytes()
    for content in (b"", good[:100], b"PK\x03\x04" + b"0" * 100, good.replace(b"arm", b"leg")):
        path.write_bytes(content)
        with pytest.raises(BlackBoxError, match="black_box_1.npz is not a black box"):
            BlackBox.load(path)
    np.savez(path, about=np.frombuffer(json.dumps({"parts": []}).encode(), np.uint8))
    with pytest.raises(BlackBoxError):
        BlackBox.load(path)


def test_a_file_whose_thread_is_just_being_started_can_be_waited_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    group, _, recorder, clock = recorded(tmp_path)
    recorder.background = True
    run(group, recorder, clock, 0.1)
    recorder.stopped("pressed")
    clock.time += AFTERWARDS
    starting, begin = threading.Event(), threading.Thread.start

    def start(thread: threading.Thread) -> None:
        if thread.name == "black box":
            starting.set()
            threading.Event().wait(0.2)
        begin(thread)

    monkeypatch.setattr(threading.Thread, "start", start)
    loop = threading.Thread(target=recorder.look)
    loop.start()
    assert starting.wait(5.0)
    recorder.flush()
    loop.join()
    assert BlackBox.load(tmp_path / "black_box_1.npz").reason == "pressed"
