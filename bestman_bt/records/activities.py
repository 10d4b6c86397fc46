"""When each node was at work, and how that ended, from its changes of state."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bestman_bt.engine.logs import Transitions
from bestman_bt.engine.status import FAILURE, IDLE, RUNNING, SUCCESS
from bestman_bt.records.states import NO


@dataclass(frozen=True, eq=False)
class Activities:
    """Activity i: node ``uids[i]`` was at work from ``begins[i]`` to ``ends[i]``, seconds; in the order of beginning.

    ``results``: SUCCESS, FAILURE, NO or SKIPPED; IDLE where it was halted; RUNNING where the record ends before.
    """

    uids: NDArray[np.unsignedinteger]
    begins: NDArray[np.float64]
    ends: NDArray[np.float64]
    results: NDArray[np.uint8]

    def __len__(self) -> int:
        return len(self.uids)

    def by_node(self) -> Iterator[tuple[int, Activities]]:
        """Each node with its own activities, in the order of the tree."""
        order = np.argsort(self.uids, kind="stable")
        nodes, begins = np.unique(self.uids[order], return_index=True)
        for uid, mine in zip(nodes.tolist(), np.split(order, begins[1:]), strict=False):
            yield uid, self[mine]

    def __getitem__(self, which: NDArray[np.integer] | NDArray[np.bool_]) -> Activities:
        return Activities(self.uids[which], self.begins[which], self.ends[which], self.results[which])


def activities(changes: Transitions, end: float) -> Activities:
    """What changes of state, in the order of time and without repetitions, amount to; ``end``: of the record, seconds.

    A result that follows a result without IDLE or RUNNING between them is a new activity: a node that returns at once
    is not seen running.
    """
    order = np.argsort(changes.uids, kind="stable")
    uids, times, states = changes.uids[order], changes.times[order], changes.statuses[order]
    follows = np.zeros(len(uids), bool)
    follows[1:] = uids[1:] == uids[:-1]
    ran = np.zeros(len(uids), bool)
    ran[1:] = follows[1:] & (states[:-1] == RUNNING)
    begins = times.copy()
    begins[ran] = times[np.flatnonzero(ran) - 1]
    ended = (states != RUNNING) & (ran | (states != IDLE))
    lasting = (states == RUNNING) & ~np.append(follows[1:], False)[: len(uids)]
    times[lasting] = np.maximum(end, times[lasting])
    kept = np.flatnonzero(ended | lasting)
    kept = kept[np.argsort(begins[kept], kind="stable")]
    return Activities(uids[kept], begins[kept], times[kept], states[kept])


@dataclass(frozen=True)
class WorkOfNode:
    """All activities of a node together; ``seconds``: in all; ``longest``: of one of them."""

    count: int
    successes: int
    failures: int
    seconds: float
    longest: float


def work_of_nodes(done: Activities) -> dict[int, WorkOfNode]:
    """Node → what it did; that a condition does not hold counts among the failures."""
    return {
        uid: WorkOfNode(
            count=len(mine),
            successes=int((mine.results == SUCCESS).sum()),
            failures=int(((mine.results == FAILURE) | (mine.results == NO)).sum()),
            seconds=float((mine.ends - mine.begins).sum()),
            longest=float((mine.ends - mine.begins).max()),
        )
        for uid, mine in done.by_node()
    }


def outcomes(changes: Transitions) -> Transitions:
    """What was returned, in order: SUCCESS and FAILURE.

    A node that repeats what it last returned, without having run in between, is left out: how often a condition is
    asked while an action runs depends on the action's duration alone.
    """
    states = np.where(changes.statuses == NO, FAILURE, changes.statuses).astype(np.uint8)
    told = np.flatnonzero((states == RUNNING) | (states == SUCCESS) | (states == FAILURE))
    news = Transitions(changes.times[told], changes.uids[told], states[told]).without_repetitions()
    returned = news.statuses != RUNNING
    return Transitions(news.times[returned], news.uids[returned], news.statuses[returned])
