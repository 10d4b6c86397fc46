"""When each node was at work, and how that ended, from a log of state changes."""

from __future__ import annotations

from collections.abc import Collection, Hashable, Iterable
from dataclasses import dataclass
from typing import Generic, TypeVar

from bestman_bt.engine.status import FAILURE, IDLE, RUNNING, SKIPPED, SUCCESS

K = TypeVar("K", bound=Hashable)
RESULTS = (SUCCESS, FAILURE, SKIPPED)


@dataclass(frozen=True)
class Activity(Generic[K]):
    """Node ``key`` was at work from ``begin`` to ``end``, seconds.

    ``result``: SUCCESS, FAILURE or SKIPPED; IDLE where it was halted; RUNNING where the log ends before it does.
    """

    key: K
    begin: float
    end: float
    result: int

    @property
    def duration(self) -> float:
        """Seconds; 0 for a node that returned at once."""
        return self.end - self.begin


def activities(changes: Iterable[tuple[float, K, int]], end: float) -> list[Activity[K]]:
    """What ``changes`` (time, node, new state), in the order of time, amount to; ``end``: of the log, seconds.

    A result that follows a result without IDLE or RUNNING between them is a new activity: a node that returns at once
    is not seen running. In the order in which they began.
    """
    begun: dict[K, float] = {}
    found: list[Activity[K]] = []
    for time, key, state in changes:
        if state == RUNNING:
            begun.setdefault(key, time)
        elif state in RESULTS:
            found.append(Activity(key, begun.pop(key, time), time, state))
        elif state == IDLE and key in begun:
            found.append(Activity(key, begun.pop(key), time, IDLE))
    found += [Activity(key, begin, max(end, begin), RUNNING) for key, begin in begun.items()]
    return sorted(found, key=lambda activity: activity.begin)


def ended_by(changes: Iterable[tuple[float, K, int]], root: K, leaves: Collection[K]) -> tuple[K, float] | None:
    """The leaf by which a tree failed, and when: of what failed at the moment at which ``root`` did, the last leaf."""
    failed = [(time, key) for time, key, state in changes if state == FAILURE]
    end = next((time for time, key in reversed(failed) if key == root), None)
    return next(((key, time) for time, key in reversed(failed) if time == end and key in leaves), None)


@dataclass(frozen=True)
class WorkOfNode:
    """All activities of a node together; ``seconds``: in all; ``longest``: of one of them."""

    count: int
    successes: int
    failures: int
    seconds: float
    longest: float


def work_of_nodes(done: Iterable[Activity[K]]) -> dict[K, WorkOfNode]:
    """Node → what it did."""
    by_node: dict[K, list[Activity[K]]] = {}
    for activity in done:
        by_node.setdefault(activity.key, []).append(activity)
    return {
        key: WorkOfNode(
            count=len(mine),
            successes=sum(activity.result == SUCCESS for activity in mine),
            failures=sum(activity.result == FAILURE for activity in mine),
            seconds=sum(activity.duration for activity in mine),
            longest=max(activity.duration for activity in mine),
        )
        for key, mine in by_node.items()
    }
