"""What the text-like logs share: state changes with paths and previous states, from attach to close."""

from __future__ import annotations

from collections.abc import Iterator
from types import TracebackType
from typing import Self

from bestman_bt.engine.status import IDLE
from bestman_bt.engine.tree import StateChanges, Tree


class TransitionLog:
    """Listens to a tree between ``open`` and ``close``; a context manager. Derived classes write."""

    def __init__(self, tree: Tree) -> None:
        self._tree = tree
        self._states: dict[int, int] = {}

    def open(self) -> Self:
        """Begin to listen."""
        self._states = {node.uid: node.state for node in self._tree.nodes}
        self._begin()
        self._tree.subscribe(self._listen)
        return self

    def close(self) -> None:
        """Stop listening and finish the log."""
        self._tree.unsubscribe(self._listen)
        self._end()

    def _begin(self) -> None:
        """Make the log."""

    def _end(self) -> None:
        """Finish the log."""

    def _listen(self, changes: StateChanges) -> None:
        """Write the changes of one tick."""
        raise NotImplementedError

    def _with_previous(self, changes: StateChanges) -> Iterator[tuple[int, int, int]]:
        """Yield uid, previous and new state."""
        states = self._states
        for uid, state in changes:
            previous = states.get(uid, IDLE)
            states[uid] = state
            yield uid, previous, state

    def __enter__(self) -> Self:
        return self.open()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
