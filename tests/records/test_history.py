"""What is known of a run besides its states, and that all of it has bounds."""

from __future__ import annotations

import dataclasses
import json
import sys
from types import SimpleNamespace
from typing import Any

import pytest

from bestman_bt.monitor.viewer import Updates, compare, encoded
from bestman_bt.records.events import (
    BlackboardEvent,
    EndEvent,
    Event,
    EventError,
    ImageEvent,
    LogEvent,
    PausedEvent,
    RobotEvent,
    ShownEntry,
    StatesEvent,
    from_line,
)
from bestman_bt.records.history import (
    MAX_LOG_LINES,
    MAX_PICTURES,
    MAX_VALUES_A_KEY,
    SERIES_POINTS,
    Freshness,
    RunHistory,
    Samples,
)
from bestman_bt.records.shown_value import REMOVED
from bestman_bt.records.timeline import outcomes
from tests.monitor.conftest import tree_event

IDLE, RUNNING, SUCCESS, FAILURE, NO = 0, 1, 2, 3, 5
LOOK, AGAIN, GRASP = 2, 3, 4


def as_event(document: dict[str, Any]) -> Event:
    return from_line(json.dumps(document))


def history_of(*changes: tuple[float, int, int], messages: dict[int, str] | None = None) -> RunHistory:
    """A history of the tree of four nodes: (time, uid, state)."""
    history = RunHistory()
    history.take(as_event(tree_event()))
    for time, uid, state in changes:
        said = {uid: text for uid, text in (messages or {}).items() if state == FAILURE}
        history.take(StatesEvent(time, round(time * 20), [(uid, state)], said))
    return history


def test_samples_thin_the_old_half_and_keep_the_first_and_the_newest() -> None:
    samples: Samples[int] = Samples(100)
    for number in range(10_000):
        samples.add(float(number), number)
    times = [time for time, _ in samples]
    assert len(samples) <= 100
    assert (times[0], times[-1]) == (0.0, 9999.0)
    assert times[-40:] == [float(number) for number in range(9960, 10_000)]
    assert samples.at(9980.5) == (9980.0, 9980)
    assert samples.at(-1.0) is None


def test_freshness_names_what_changed_since() -> None:
    freshness: Freshness[str] = Freshness()
    for version, key in enumerate("abcab", 1):
        freshness.touch(key, version)
    assert freshness.since(3) == ["b", "a"]
    assert freshness.since(0) == ["b", "a", "c"]
    assert freshness.since(5) == []


def test_logs_pictures_and_values_are_bounded() -> None:
    history = history_of()
    for number in range(MAX_LOG_LINES + 10):
        history.take(LogEvent(float(number), "info", f"line {number}"))
    for number in range(MAX_PICTURES + 10):
        history.take(ImageEvent(float(number), "head", 1, 1, "AAAA"))
    for number in range(MAX_VALUES_A_KEY + 10):
        history.take(BlackboardEvent(float(number), number, {"": {"x": ShownEntry("int", str(number))}}))
    assert len(history.log) == MAX_LOG_LINES
    assert len(history.pictures) == MAX_PICTURES
    assert len(history._entries["", "x"]) <= MAX_VALUES_A_KEY
    assert [line["message"] for line in history.lines_since(-1, 2)] == [
        f"line {MAX_LOG_LINES + 8}",
        f"line {MAX_LOG_LINES + 9}",
    ]


@pytest.mark.parametrize(
    "damaged",
    [
        {**tree_event(), "tree": 5, "nodes": [{**tree_event()["nodes"][1], "uid": 1, "parent": 7}]},
        {**tree_event(), "tree": 5, "under": 99},
        {**tree_event(), "nodes": tree_event()["nodes"][:2]},
        {"event": "states", "time": 1e12, "tick": 1, "changes": []},
        {"event": "states", "time": 1.0, "tick": 1, "changes": [], "tree": 9},
        {"event": "image", "time": 1.0, "camera": "c", "width": 1, "height": 1, "jpeg": "no base64!"},
    ],
)
def test_an_event_that_does_not_fit_is_refused_and_nothing_is_lost(damaged: dict[str, Any]) -> None:
    history = history_of((1.0, LOOK, SUCCESS))
    with pytest.raises(EventError):
        history.take(as_event(damaged))
    assert list(history.states.now.states) == [0, IDLE, SUCCESS, IDLE, IDLE]
    assert (len(history.nodes), history.last) == (4, 1.0)


def robot_event(time: float, **joints: float) -> RobotEvent:
    return RobotEvent(time, 0, (time, 0.0, 0.0), (0.0, 0.0), joints)


def test_ticks_count_on_while_leaves_run_and_nothing_changes() -> None:
    history = history_of((1.0, LOOK, RUNNING))
    history.take(dataclasses.replace(robot_event(1.5), tick=30))
    assert (history.tick, history.states.tick) == (30, 20)
    history.take(StatesEvent(1.4, 28, []))
    assert history.tick == 30


def test_joints_are_reported_by_the_names_that_they_had_then() -> None:
    history = RunHistory()
    history.take(robot_event(1.0, lift=0.5))
    history.take(robot_event(2.0, elbow=0.25))
    told = [history.robot.at(time) for time in (1.5, 2.5)]
    assert [one["joints"] for one in told if one is not None] == [{"lift": 0.5}, {"elbow": 0.25}]
    assert history.robot.joint_names() == ["elbow"]
    assert history.robot.series(["lift", "elbow"]) == {"lift": [[1.0, 0.5]], "elbow": [[2.0, 0.25]]}


def test_curves_and_ways_of_a_long_run_are_bounded_and_a_curve_ends_with_the_newest_sample() -> None:
    history = RunHistory()
    for number in range(2 * SERIES_POINTS + 2):
        history.take(robot_event(float(number), lift=float(number)))
    curve, way = history.robot.series(["lift"])["lift"], history.robot.driven(1e6)
    assert SERIES_POINTS / 2 < len(curve) <= SERIES_POINTS + 1
    assert (curve[0], curve[-1]) == ([0.0, 0.0], [2 * SERIES_POINTS + 1.0, 2 * SERIES_POINTS + 1.0])
    assert SERIES_POINTS / 2 < len(way) <= SERIES_POINTS
    assert history.robot.driven(1.0) == [[0.0, 0.0], [1.0, 0.0]]


def test_an_entry_that_was_removed_is_there_no_more_and_was_there_before() -> None:
    history = history_of()
    history.take(BlackboardEvent(1.0, 20, {"": {"cup": ShownEntry("Pose", "here")}}))
    history.take(BlackboardEvent(2.0, 40, {"": {"cup": REMOVED}}))
    assert [sorted(history.blackboard_at(time)) for time in (0.5, 1.0, 1.9, 2.0)] == [[], [""], [""], []]
    assert history.entry_at("", "cup", 2.0) is None


def test_the_timeline_has_spans_of_leaves_and_marks() -> None:
    history = history_of((1.0, GRASP, RUNNING), (1.0, AGAIN, RUNNING), (3.0, GRASP, FAILURE), (4.0, GRASP, IDLE))
    history.take(LogEvent(3.0, "error", "slipped", "main/grasp", "not_held"))
    history.take(PausedEvent(3.5, "asked"))
    timeline = history.timeline.document(4.0)
    assert timeline["spans"] == [
        {"uid": GRASP, "state": RUNNING, "from": 1.0, "to": 3.0},
        {"uid": GRASP, "state": FAILURE, "from": 3.0, "to": 4.0},
    ]
    assert [(mark["time"], mark["kind"], mark["text"]) for mark in timeline["marks"]] == [
        (3.0, "error", "main/grasp: not_held: slipped"),
        (3.5, "paused", "asked"),
    ]


ASKING = [
    (1, None, "main", "Sequence", "control"),
    (2, 1, "held", "Holding", "condition"),
    (3, 1, "grasp", "Grasp", "action"),
]


def asked(*batches: list[tuple[int, int]]) -> RunHistory:
    """A history of the tree of a condition and an action: what changed in each second."""
    history = RunHistory()
    history.take(as_event(tree_event(ASKING)))
    for second, changes in enumerate(batches):
        history.take(StatesEvent(float(second), second, changes))
    return history


def test_a_condition_that_does_not_hold_has_answered_no_and_an_action_has_failed() -> None:
    history = asked([(1, RUNNING), (2, FAILURE), (2, IDLE), (3, RUNNING)], [(3, FAILURE), (3, IDLE)])
    nodes = history.states.at(9.0).nodes
    assert [nodes.results[uid] for uid in (2, 3)] == [NO, FAILURE]
    assert [nodes.failures[uid] for uid in (2, 3)] == [1, 1], "counted as before"
    assert [span["state"] for span in history.timeline.document(9.0)["spans"]] == [NO, RUNNING, FAILURE]
    told = outcomes(history.states.changes())
    assert [one.status for one in told if one.uid > 1] == [FAILURE, FAILURE], "stories are compared as before"


def test_the_condition_by_which_the_tree_fails_has_failed_and_one_before_it_has_not() -> None:
    ending = [(2, FAILURE), (3, FAILURE), (1, FAILURE)]
    assert list(asked(ending).states.now.states[1:]) == [FAILURE, NO, FAILURE]
    assert list(asked([(2, FAILURE), (1, FAILURE)]).states.now.states[1:3]) == [FAILURE, FAILURE]
    begun_anew = asked([(2, FAILURE), (1, FAILURE)], [(2, IDLE), (1, IDLE)], [(1, RUNNING), (2, FAILURE)])
    assert begun_anew.states.now.states[2] == NO


def test_equal_stories_at_different_speeds_do_not_part() -> None:
    slow = history_of((1.0, LOOK, RUNNING), (9.0, LOOK, SUCCESS), (9.0, LOOK, IDLE), (10.0, GRASP, SUCCESS))
    fast = history_of((0.1, LOOK, RUNNING), (0.2, LOOK, SUCCESS), (0.2, LOOK, IDLE), (0.3, GRASP, SUCCESS))
    told = compare(slow, fast)
    assert told["parted"] is None
    assert "2 outcomes" in told["words"]


def test_how_often_a_condition_is_asked_does_not_part_runs() -> None:
    asked = [(float(second), LOOK, state) for second in range(5) for state in (SUCCESS, IDLE)]
    assert (
        compare(history_of(*asked, (6.0, GRASP, SUCCESS)), history_of(*asked[:4], (6.0, GRASP, SUCCESS)))["parted"]
        is None
    )


def test_runs_part_where_a_leaf_first_returned_something_else() -> None:
    a = history_of((1.0, LOOK, SUCCESS), (2.0, GRASP, FAILURE), messages={GRASP: "slipped"})
    b = history_of((1.5, LOOK, SUCCESS), (3.0, GRASP, SUCCESS))
    parted = compare(a, b)["parted"]
    assert (parted["time_a"], parted["time_b"], parted["path"]) == (2.0, 3.0, "main/grasp")
    assert (parted["state_a"], parted["state_b"]) == (FAILURE, SUCCESS)
    assert "in A 'main/grasp' failed at 2.00 s (slipped); in B 'main/grasp' succeeded at 3.00 s" in parted["words"]


def test_a_run_that_was_cut_off_parts_where_it_ends() -> None:
    a = history_of((1.0, LOOK, SUCCESS))
    b = history_of((1.0, LOOK, SUCCESS), (3.0, GRASP, SUCCESS))
    parted = compare(a, b)["parted"]
    assert (parted["time_a"], parted["time_b"], parted["path"], parted["state_a"]) == (1.0, 3.0, "main/grasp", None)
    assert compare(history_of(), history_of())["words"].startswith("no leaf")


def test_a_run_that_ends_while_it_is_paused_is_not_paused_any_more() -> None:
    history = history_of((1.0, LOOK, RUNNING))
    history.take(PausedEvent(3.0, "asked"))
    updates = Updates(SimpleNamespace(id="run", history=history, is_live=True))
    updates.messages(0.0)
    history.take(EndEvent(4.0, "cancelled", "RUNNING"))
    assert history.paused is None
    (delta,) = [message for message in updates.messages(0.1) if message["type"] == "delta"]
    assert delta["paused"] is None


def test_a_page_at_an_earlier_time_does_not_show_the_present_pause() -> None:
    history = history_of((1.0, LOOK, RUNNING), (2.0, LOOK, SUCCESS))
    history.take(PausedEvent(3.0, "asked"))
    updates = Updates(SimpleNamespace(id="run", history=history, is_live=True))

    def told() -> Any:
        return next(message for message in updates.messages(0.0) if message["type"] == "state")

    assert told()["paused"]["time"] == 3.0
    updates.look_at(1.5)
    assert told()["paused"] is None
    updates.look_at(None)
    assert told()["paused"]["time"] == 3.0


def test_what_a_tick_costs_a_page_does_not_grow_with_the_nodes_that_it_changes() -> None:
    """Counted in calls: of 10,000 nodes that change at 20 Hz, a page is told ten times a second at least."""
    nodes = [(uid, 1 if uid > 1 else None, f"n{uid}", "AlwaysSuccess", "action") for uid in range(1, 2001)]
    history = RunHistory()
    history.take(as_event(tree_event(nodes)))
    updates = Updates(SimpleNamespace(id="run", history=history, is_live=True))
    updates.messages(0.0)
    history.take(StatesEvent(1.0, 1, [(uid, SUCCESS) for uid, *_ in nodes]))
    updates.messages(1.0)
    event, calls = StatesEvent(1.1, 2, [(uid, RUNNING) for uid, *_ in nodes]), 0

    def count(frame: object, what: str, argument: object) -> None:
        nonlocal calls
        calls += what in ("call", "c_call")

    sys.setprofile(count)
    try:
        history.take(event)
        (delta, *_) = updates.messages(1.1)
        text = encoded(delta)
    finally:
        sys.setprofile(None)
    told = json.loads(text)
    assert (told["changes"][0], told["changes"][-1]) == ([1, RUNNING, 0, IDLE], [2000, RUNNING, 0, IDLE])
    assert len(told["changes"]) == len(told["running"]) == len(nodes)
    assert calls < 500


def test_numbers_that_are_none_and_halves_of_characters_reach_a_page() -> None:
    assert json.loads(encoded({"a": float("nan"), "b": (float("-inf"), 1)})) == {"a": None, "b": [None, 1]}
    assert json.loads(encoded({"a": float("nan"), "b": "\udcff"})) == {"a": None, "b": "\udcff"}
