"""The states of all nodes over time: what is remembered, and what is given up when there is too much."""

from __future__ import annotations

import numpy as np
import pytest

from bestman_bt.engine.logs.btlog import Transitions
from bestman_bt.records.states import BYTES_A_NODE, HistoryLimits, NodeStates, StateHistory

IDLE, RUNNING, SUCCESS, FAILURE = 0, 1, 2, 3


def recorded(ticks: int, nodes: int, limits: HistoryLimits | None = None) -> tuple[StateHistory, list[list[int]]]:
    """A history of random changes at 10 ticks a second, and the states that were true after each tick."""
    random = np.random.default_rng(4)
    history = StateHistory(limits)
    history.now = NodeStates(nodes)
    states, told = [0] * (nodes + 1), []
    drawn = random.integers([1, 0], [nodes + 1, 4], size=(ticks, 5, 2)).tolist()
    for tick in range(ticks):
        changes = [(uid, state) for uid, state in drawn[tick]]
        for uid, state in changes:
            states[uid] = state
        history.record(tick / 10, tick, changes)
        told.append(list(states))
    return history, told


def test_every_past_state_is_what_it_was() -> None:
    history, told = recorded(500, 20, HistoryLimits(chunk=100))
    for tick in range(500):
        moment = history.at(tick / 10 + 0.05)
        assert (list(moment.nodes.states), moment.tick) == (told[tick], tick)


def test_times_before_the_first_and_after_the_last_are_answered_with_those() -> None:
    history, told = recorded(10, 5)
    assert history.at(-3.0).tick == 0
    assert list(history.at(99.0).nodes.states) == told[-1]


def test_looking_back_changes_nothing() -> None:
    history, _told = recorded(300, 5, HistoryLimits(chunk=50))
    before = list(history.now.states), list(history.now.successes), list(history.now.seconds)
    for time in (3.0, 29.0, 0.0):
        history.at(time)
    assert (list(history.now.states), list(history.now.successes), list(history.now.seconds)) == before


def test_counts_and_durations_are_those_of_the_moment() -> None:
    history = StateHistory()
    history.now = NodeStates(1)
    for time, state in ((0.0, RUNNING), (2.0, SUCCESS), (3.0, IDLE), (4.0, RUNNING), (7.0, FAILURE)):
        history.record(time, int(time), [(1, state)])
    assert history.now.statistics([1], 9.0) == {"1": [2, 1, 1, 5.0]}
    assert history.at(5.5).nodes.statistics([1], 5.5) == {"1": [2, 1, 0, 3.5]}
    assert history.at(3.0).nodes.statistics([1], 3.0) == {"1": [1, 1, 0, 2.0]}


def test_a_result_stays_until_the_node_starts_again() -> None:
    history = StateHistory()
    history.now = NodeStates(1)
    shown = []
    for time, state in enumerate((SUCCESS, IDLE, RUNNING, IDLE, FAILURE, IDLE)):
        history.record(float(time), time, [(1, state)])
        shown.append(history.now.results[1])
    assert shown == [SUCCESS, SUCCESS, IDLE, IDLE, FAILURE, FAILURE]


def test_a_state_that_is_told_twice_counts_once() -> None:
    history = StateHistory()
    history.now = NodeStates(1)
    assert [(new.uid, new.status) for new in history.record(0.0, 0, [(1, SUCCESS)])] == [(1, SUCCESS)]
    assert len(history.record(1.0, 1, [(1, SUCCESS)])) == 0
    assert history.now.successes[1] == 1


def test_beyond_the_limit_old_parts_keep_their_keyframes_and_new_ones_everything() -> None:
    history, told = recorded(2000, 10, HistoryLimits(changes=4000, chunk=200))
    assert history.first == 0.0
    assert all(list(history.at(tick / 10 + 0.05).nodes.states) == told[tick] for tick in range(1500, 2000, 7))
    early = [history.at(tick / 10 + 0.05).tick for tick in range(500)]
    assert 5 < len(set(early)) < 50  # coarse, but not gone
    held = sum(len(chunk.codes) for chunk in history._chunks)
    assert held <= 4200


@pytest.mark.slow
def test_keyframes_have_a_limit_too() -> None:
    limit = 20 * BYTES_A_NODE * 11
    history, told = recorded(6000, 10, HistoryLimits(changes=2000, keyframe_bytes=limit, chunk=200))
    assert len(history._chunks) <= 21
    assert history.first == 0.0
    assert all(list(history.at(tick / 10 + 0.05).nodes.states) == told[tick] for tick in range(5800, 6000, 7))


@pytest.mark.parametrize("time", [5.0, 4.0])
def test_time_never_runs_back(time: float) -> None:
    history = StateHistory()
    history.now = NodeStates(1)
    history.record(5.0, 1, [(1, RUNNING)])
    history.record(time, 2, [(1, SUCCESS)])
    assert history.time == 5.0
    history.record(time, 3)
    assert (history.time, history.tick) == (5.0, 3)
    assert history.at(5.0).nodes.states[1] == SUCCESS


def test_nodes_that_come_later_are_idle_before() -> None:
    history = StateHistory()
    history.now = NodeStates(1)
    history.record(0.0, 0, [(1, RUNNING)])
    history.now = history.now.grown(3)
    history.record(1.0, 1, [(3, SUCCESS)])
    assert list(history.at(0.5).nodes.states) == [0, RUNNING, IDLE, IDLE]
    assert list(history.at(1.0).nodes.states) == [0, RUNNING, IDLE, SUCCESS]


def test_changes_that_are_taken_over_at_once_count_as_those_that_came_tick_by_tick() -> None:
    random = np.random.default_rng(7)
    times = np.repeat(np.arange(400) / 10, 5)
    changes = Transitions(
        times, random.integers(1, 9, 2000, np.uint32), random.choice([0, 1, 2, 3, 5], 2000).astype("u1")
    )
    one, other = StateHistory(HistoryLimits(chunk=64)), StateHistory()
    one.now, other.now = NodeStates(8), NodeStates(8)
    for tick in range(400):
        mine = changes[5 * tick : 5 * tick + 5]
        one.record(tick / 10, tick, list(zip(mine.uids.tolist(), mine.statuses.tolist(), strict=True)))
    other.extend(changes, np.repeat(np.arange(400), 5))
    for time in (0.05, 13.37, 39.9):
        told, expected = other.at(time), one.at(time)
        assert told.tick == expected.tick
        for name, values in vars(expected.nodes).items():
            np.testing.assert_allclose(getattr(told.nodes, name), values, err_msg=name)
    assert other.changes() == one.changes()
