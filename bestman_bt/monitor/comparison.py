"""Where two runs parted: the first leaf that returned something else, or another leaf that returned first."""

from __future__ import annotations

from itertools import islice, zip_longest
from typing import Any

from bestman_bt.engine.logs import Transition
from bestman_bt.engine.status import FAILURE, STATUS_NAMES, SUCCESS
from bestman_bt.records.activities import outcomes
from bestman_bt.records.history import RunHistory

MAX_OUTCOMES = 100_000
"""That are compared."""


def compare(a: RunHistory, b: RunHistory) -> dict[str, Any]:
    """``parted`` (None where they never do) and ``words``.

    Compared are the outcomes of the leaves in their order, not their times: two runs that differ in speed alone do not
    part. Leaves are the same where their paths are.
    """
    common = 0
    for mine, other in zip_longest(_story(a), _story(b)):
        if _key(a, mine) != _key(b, other):
            return _parted(a, b, mine, other, common)
        common += 1
    if not common:
        return {"parted": None, "words": "no leaf has returned anything in either of them"}
    return {"parted": None, "words": f"the same {common} outcomes of leaves in the same order"}


def _story(history: RunHistory) -> list[Transition]:
    """What leaves returned."""
    told = outcomes(history.states.changes())
    return list(islice((one for one in told if history.nodes.node(one.uid).is_leaf), MAX_OUTCOMES))


def _key(history: RunHistory, outcome: Transition | None) -> tuple[str, int] | None:
    return None if outcome is None else (history.nodes.path_of(outcome.uid), outcome.status)


def _parted(
    a: RunHistory, b: RunHistory, mine: Transition | None, other: Transition | None, common: int
) -> dict[str, Any]:
    words = [f"after {common} equal outcomes of leaves: " if common else "from the beginning: "]
    words.append(f"in A {_words(a, mine)}; in B {_words(b, other)}")
    first = mine if mine is not None else other
    owner = a if mine is not None else b
    parted = {
        "time_a": mine.time if mine is not None else a.last,
        "time_b": other.time if other is not None else b.last,
        "path": owner.nodes.path_of(first.uid) if first is not None else "",
        "state_a": mine.status if mine is not None else None,
        "state_b": other.status if other is not None else None,
        "path_b": b.nodes.path_of(other.uid) if other is not None else None,
        "words": "".join(words),
    }
    return {"parted": parted, "words": parted["words"]}


def _words(history: RunHistory, outcome: Transition | None) -> str:
    if outcome is None:
        return "no leaf returned anything more"
    result = {SUCCESS: "succeeded", FAILURE: "failed"}.get(outcome.status, STATUS_NAMES[outcome.status])
    told = f"'{history.nodes.path_of(outcome.uid)}' {result} at {outcome.time:.2f} s"
    message = history.message_at(outcome.uid, outcome.time)
    return f"{told} ({message})" if message else told
