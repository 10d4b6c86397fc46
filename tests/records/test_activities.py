from __future__ import annotations

import numpy as np

from bestman_bt.engine.logs.btlog import Transitions
from bestman_bt.engine.status import FAILURE, IDLE, RUNNING, SKIPPED, SUCCESS
from bestman_bt.records.timeline import WorkOfNode, activities, work_of_nodes

A, B = 1, 2


def changes(*told: tuple[float, int, int]) -> Transitions:
    times, uids, states = np.array(told).T
    return Transitions(times, uids.astype(np.uint32), states.astype(np.uint8))


def worked(*told: tuple[float, int, int]) -> list[tuple[int, float, float, int]]:
    """(node, begin, end, result) of a log that ends at 4 s."""
    done = activities(changes(*told), 4.0)
    return list(zip(*(part.tolist() for part in (done.uids, done.begins, done.ends, done.results)), strict=True))


def test_a_node_works_from_running_to_its_result() -> None:
    assert worked((1.0, A, RUNNING), (3.5, A, SUCCESS), (3.5, A, IDLE)) == [(A, 1.0, 3.5, SUCCESS)]


def test_a_node_that_is_reset_while_it_runs_was_halted() -> None:
    assert worked((1.0, A, RUNNING), (2.0, A, IDLE)) == [(A, 1.0, 2.0, IDLE)]


def test_a_node_that_returns_at_once_works_for_no_time() -> None:
    done = worked((1.0, A, FAILURE), (1.0, A, IDLE), (2.0, A, SKIPPED))

    assert done == [(A, 1.0, 1.0, FAILURE), (A, 2.0, 2.0, SKIPPED)]


def test_what_the_log_ends_within_is_still_running() -> None:
    assert worked((1.0, A, RUNNING), (2.0, B, SUCCESS)) == [(A, 1.0, 4.0, RUNNING), (B, 2.0, 2.0, SUCCESS)]


def test_the_work_of_a_node_adds_up() -> None:
    told = changes((0.0, A, RUNNING), (0.0, B, RUNNING), (1.0, A, FAILURE), (2.0, A, RUNNING), (5.0, A, SUCCESS))

    work = work_of_nodes(activities(told, 6.0))

    assert work == {A: WorkOfNode(2, 1, 1, 4.0, 3.0), B: WorkOfNode(1, 0, 0, 6.0, 6.0)}
