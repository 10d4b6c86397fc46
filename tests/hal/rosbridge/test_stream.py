"""What came last on a topic, how old it is, and how late it comes, by a clock of the test's own."""

from __future__ import annotations

import time
from collections.abc import Mapping
from functools import partial
from typing import Any

import pytest

from bestman_bt.robot_model.model import RobotModel
from bestman_bt.robot_model.sensor_parts import CameraPart
from hal.api import NoDataError
from hal.hardware.clock import LatencyMonitor, RemoteTime, SynchronisedTime
from hal.parts.simulated_clock import SimulatedClock
from hal.parts.stop_latch import StopLatch
from hal.rosbridge.connection import RosCamera
from hal.rosbridge.link import RosLink, TopicStream
from hal.rosbridge.options import RosbridgeOptions


class Clock(SimulatedClock):
    """Stands still until it is told."""

    time = 100.0

    def now(self) -> float:
        return self.time


def message(stamp: float, value: int | None = 1) -> Mapping[str, Any]:
    return {"header": {"stamp": {"sec": int(stamp), "nanosec": round(1e9 * (stamp % 1.0))}}, "value": value}


@pytest.fixture
def clock() -> Clock:
    return Clock(0.01)


@pytest.fixture
def stream(clock: Clock) -> TopicStream[int]:
    return TopicStream("lidar", "/scan", lambda told, at: told["value"], clock, RemoteTime(), longest_age=0.4)


def test_a_silent_sensor_has_no_reading_once_its_last_one_is_too_old(stream: TopicStream[int], clock: Clock) -> None:
    with pytest.raises(NoDataError, match="no message on /scan yet"):
        stream.read()
    stream.take(message(7.0, 1), 100.0)
    assert stream.read() == 1
    clock.time = 100.39
    assert stream.read() == 1
    assert stream.age == pytest.approx(0.39)
    clock.time = 100.41
    with pytest.raises(NoDataError, match=r"lidar: the newest message on /scan is 0\.41 s old"):
        stream.read()
    assert stream.latest() == 1
    stream.take(message(7.41, 2), 100.41)
    assert stream.read() == 2
    stream.forget()
    with pytest.raises(NoDataError):
        stream.latest()
    assert stream.age == float("inf")


def test_a_message_that_was_long_under_way_is_as_old_as_its_stamp_says(stream: TopicStream[int], clock: Clock) -> None:
    stream.take(message(7.0, 1), 100.0)
    clock.time = 101.0
    stream.take(message(7.5, 2), 101.0)  # of 100.5 by our clock
    assert stream.age == pytest.approx(0.5, abs=1e-3)
    with pytest.raises(NoDataError, match="old"):
        stream.read()
    stream.take(message(8.0, None), 101.0)  # about something else
    assert stream.latest() == 2
    stream.take({"header": {"stamp": {"sec": 0, "nanosec": 0}}, "value": 3}, 101.0)  # without a stamp: of now
    assert stream.age == 0.0


def test_messages_that_come_late_for_a_while_are_late(stream: TopicStream[int], clock: Clock) -> None:
    stream.take(message(7.0), 100.0)
    for step in range(1, 60):
        clock.time = 100.0 + 0.01 * step + (0.2 if step > 20 else 0.0)
        stream.take(message(7.0 + 0.01 * step), clock.time)
        late = stream.late(0.1)
        if step not in (36, 37):  # a rounding away from the limit
            assert (late is not None) is (step > 36)


def test_a_new_connection_is_not_late_for_what_the_one_before_it_was(stream: TopicStream[int], clock: Clock) -> None:
    stream.take(message(7.0), 100.0)
    for step in range(21):
        clock.time = 100.5 + 0.01 * step
        stream.take(message(7.2 + 0.01 * step), clock.time)
        late = stream.late(0.1)
    assert late == pytest.approx(0.3, abs=1e-3)
    stream.forget()
    assert stream.late(0.1) is None
    stream.take(message(7.5), 100.8)
    assert stream.late(0.1) is None  # late, but not for a while


def test_a_clock_that_is_set_back_is_followed_at_once(stream: TopicStream[int], clock: Clock) -> None:
    for step in range(100):
        clock.time = 100.0 + 0.02 * step
        stream.take(message(7.0 + 0.02 * step - (0.5 if step > 20 else 0.0), step), clock.time)
        assert stream.late(0.1) is None
        assert stream.age == pytest.approx(0.0, abs=1e-3)
        assert stream.read() == step


def test_what_says_nothing_of_a_part_and_what_is_malformed_does_not_set_its_clock(
    stream: TopicStream[int], clock: Clock
) -> None:
    stream.take(message(7.0), 100.0)
    stream.take(message(8.0, None), 100.0)  # dated ahead by a second, about something else
    with pytest.raises(KeyError):
        stream.take({"header": message(9.0)["header"]}, 100.0)
    stream.take(message(7.1), 100.1)
    clock.time = 100.1
    assert stream.age == pytest.approx(0.0, abs=1e-3)


def test_a_single_late_message_is_none_and_counting_begins_anew() -> None:
    watch = LatencyMonitor()
    for start in (10.0, 20.0):
        watch.lag = 0.2
        assert watch.late(0.1, start) is None
        assert watch.late(0.1, start + 0.14) is None
        watch.lag = 0.1
        assert watch.late(0.1, start + 0.2) is None
    watch.lag = 0.2
    assert watch.late(0.1, 30.0) is None
    assert watch.late(0.1, 30.16) == 0.2
    watch.forget()
    assert watch.late(0.1, 31.0) is None


def test_waiting_for_a_newer_reading_never_returns_an_older_one(stream: TopicStream[int]) -> None:
    stream.take(message(7.0, 1), 100.0)
    assert stream.newer_than(99.9, time.monotonic()) == (1, 100.0)
    assert stream.newer_than(100.0, time.monotonic() + 0.01) is None
    assert stream.newer_than(100.1, time.monotonic()) is None


def test_the_other_clock_is_that_of_the_fastest_message_and_may_drift_a_little() -> None:
    remote = RemoteTime()
    assert remote.here(5.0, 100.3) == pytest.approx(100.3)
    assert remote.here(6.0, 101.1) == pytest.approx(101.1)  # faster: the first one took 0.2 s
    assert remote.here(7.0, 102.3) == pytest.approx(102.1, abs=1e-3)
    assert remote.here(1006.0, 1101.2) == pytest.approx(1101.2, abs=0.01)  # 0.1 s in 1000 s
    remote.forget()
    assert remote.here(5.0, 100.3) == pytest.approx(100.3)


def test_stamps_of_a_synchronised_clock_are_believed_and_those_that_cannot_be_of_one_are_reported(
    clock: Clock, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(time, "time", lambda: clock.time + 1000.0)
    stream = TopicStream("lidar", "/scan", lambda told, at: at, clock, SynchronisedTime(clock), longest_age=0.4)
    for _ in range(20):  # always 40 ms late, which an estimate would take for the clocks' difference
        clock.time += 0.1
        stream.take(message(clock.time + 999.96), clock.time)
        assert stream.age == pytest.approx(0.04, abs=1e-3)
        assert stream.read() == pytest.approx(clock.time - 0.04, abs=1e-3)
        assert stream.unlike_clock == ""
    stream.take(message(clock.time + 1000.01), clock.time)  # synchronised to some milliseconds
    assert stream.unlike_clock == ""
    assert stream.age == pytest.approx(0.0, abs=1e-3)
    stream.take(message(clock.time + 1000.3), clock.time)
    assert stream.unlike_clock == "is stamped 0.30 s later than its arrival"
    stream.take(message(clock.time + 999.5), clock.time)
    assert stream.unlike_clock == "is stamped 0.50 s before its arrival"
    stream.take(message(clock.time + 999.7), clock.time)  # late, not another clock
    assert stream.unlike_clock == ""
    stream.forget_time()
    stream.take(message(clock.time + 999.9), clock.time)
    assert stream.age == pytest.approx(0.1, abs=1e-3)


@pytest.mark.parametrize(
    ("colors", "depths"), [((1.0, 1.1), (1.1,)), ((1.1,), (1.0, 1.1)), ((1.0, 1.1, 1.3), (1.2, 1.3))]
)
def test_of_colour_and_depth_that_do_not_belong_together_the_newer_one_is_kept(
    robot_model: RobotModel,
    clock: Clock,
    monkeypatch: pytest.MonkeyPatch,
    colors: tuple[float, ...],
    depths: tuple[float, ...],
) -> None:
    (name, model), *_ = robot_model.of(CameraPart).items()
    camera = RosCamera(name, model, RosLink("robot", clock), clock, RosbridgeOptions(), StopLatch())
    for stream, stamps in ((camera._color, colors), (camera._depth, depths)):
        monkeypatch.setattr(stream, "newer_than", partial(_newer, [({"at": at}, at) for at in stamps]))
    color, depth, at = camera._pair(0.5, time.monotonic())
    assert color["at"] == depth["at"] == at == colors[-1]


def _newer(images: list[tuple[Any, float]], moment: float, deadline: float) -> tuple[Any, float] | None:
    return next((image for image in images if image[1] > moment), None)
