"""What leaves returned, in order: the story of a run, by which two runs are compared."""

from __future__ import annotations

from dataclasses import dataclass

from bestman_bt.engine.status import FAILURE, RUNNING, STATUS_NAMES, SUCCESS

MAX_OUTCOMES = 100_000


@dataclass(frozen=True)
class Outcome:
    """A leaf returned SUCCESS or FAILURE."""

    time: float
    uid: int
    state: int


class Outcomes:
    """Outcomes of leaves.

    A leaf that repeats what it last returned, without having run in between, is left out: how often a condition is
    asked while an action runs depends on the action's duration alone. The story ends after ``MAX_OUTCOMES``.
    """

    def __init__(self) -> None:
        self.told: list[Outcome] = []
        self._leaves: set[int] = set()
        self._last: dict[int, int] = {}

    def add_leaf(self, uid: int) -> None:
        """Follow a leaf."""
        self._leaves.add(uid)

    def change(self, uid: int, state: int, time: float) -> None:
        """A node has taken a state."""
        if uid not in self._leaves:
            return
        if state == RUNNING:
            self._last.pop(uid, None)
        elif state in (SUCCESS, FAILURE) and self._last.get(uid) != state:
            self._last[uid] = state
            if len(self.told) < MAX_OUTCOMES:
                self.told.append(Outcome(time, uid, state))


def result_words(state: int) -> str:
    """``succeeded``, ``failed`` or the state's name."""
    return {SUCCESS: "succeeded", FAILURE: "failed"}.get(state, STATUS_NAMES[state])
