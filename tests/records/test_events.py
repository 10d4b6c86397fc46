"""Events are lines of JSON, and what is none is refused in words."""

from __future__ import annotations

import json

import pytest

from bestman_bt.records.events import (
    BlackboardEvent,
    EventError,
    LogEvent,
    ScanEvent,
    ShownEntry,
    StatesEvent,
    from_line,
    to_line,
    topic_of,
)
from tests.monitor.conftest import run_event, states_event


@pytest.mark.parametrize(
    "event",
    [
        StatesEvent(0.05, 1, [(2, 1), (1, 3)], {2: "the <b>cup</b> slipped"}),
        BlackboardEvent(1.0, 20, {"": {"speed": ShownEntry("float", "0.5", 0.5)}}),
        LogEvent(2.0, "warning", "nothing\nis there", "pick/grasp", "no_grasp"),
        ScanEvent(0.0, (1.0, 2.0, 0.5), [(0.25, 0.5)]),
    ],
)
def test_an_event_comes_back_from_its_line(event: StatesEvent) -> None:
    line = to_line(event)
    assert line.count(b"\n") == 1
    assert from_line(line) == event


@pytest.mark.parametrize(
    "number",
    [{"tick_rate": 1e308}, {"tick_rate": -1.0}, {"tick_rate": "NaN"}, {"started": 1e18}, {"started": "Infinity"}],
)
def test_a_run_whose_numbers_mean_nothing_is_refused(number: dict[str, object]) -> None:
    line = json.dumps(run_event() | number).replace('"NaN"', "NaN").replace('"Infinity"', "Infinity")
    with pytest.raises(EventError, match="|".join(number)):
        from_line(line)


@pytest.mark.parametrize("tick", [-1, 1 << 64])
def test_a_tick_that_no_executor_counts_is_refused(tick: int) -> None:
    with pytest.raises(EventError, match="tick"):
        from_line(json.dumps(states_event(1.0) | {"tick": tick}))


def test_a_line_says_its_kind_and_has_plain_json() -> None:
    assert json.loads(to_line(StatesEvent(0.05, 1, [(2, 1)]))) == {
        "event": "states",
        "time": 0.05,
        "tick": 1,
        "changes": [[2, 1]],
        "messages": {},
        "tree": 0,
    }


@pytest.mark.parametrize(
    ("line", "words"),
    [
        (b"", "Invalid JSON"),
        (b"[]", "should be an object"),
        (b"{}", "discriminator 'event'"),
        (b'{"event": "jump"}', "'jump'"),
        (b'{"event": "states", "time": 0, "tick": 1}', "states.changes: Field required"),
        (b'{"event": "states", "time": 0, "tick": 1, "changes": [[1, "x"]]}', "states.changes.0.1"),
        (b'{"event": "log", "time": 0, "level": "loud", "message": ""}', "log.level"),
        (b"[" * 5000, "Invalid JSON"),
    ],
)
def test_what_is_no_event_is_refused_and_reports_where(line: bytes, words: str) -> None:
    with pytest.raises(EventError, match="no event") as error:
        from_line(line)
    assert words in str(error.value)


def test_events_for_all_subscribers_have_no_topic() -> None:
    assert topic_of(from_line('{"event": "resumed", "time": 1.5}')) is None
    assert topic_of(from_line('{"event": "path", "time": 1.5, "planned": []}')) == "robot"
