"""What Groot2 asks of the states: how all nodes stand now, and what changed since a recording began."""

from __future__ import annotations

import struct
import time
from collections import deque

from bestman_bt.engine import IDLE, StateChanges, Tree

IDLE_AFTER = 10
"""Added to the state that a node had before it became idle: Groot2 draws it faintly."""
MOST_TRANSITIONS = 1000
"""Kept of a recording that nobody fetches; older ones are dropped."""
_STATE = struct.Struct("<HB")
_MOST_MICROSECONDS = 2**48 - 1


class ObservedStates:
    """Takes the state changes of ``tree`` in its thread, where it only keeps them; answers in another one."""

    def __init__(self, tree: Tree) -> None:
        self._clock = tree.clock
        self._kept: deque[StateChanges] = deque()
        scopes = {board: position for position, board in enumerate(tree.blackboards.values())}
        nodes = sorted(tree.nodes, key=lambda node: (scopes[node.board], node.uid))
        self._states = {node.uid: node.state for node in nodes}
        self._shown = dict(self._states)
        self._transitions: deque[bytes] = deque(maxlen=MOST_TRANSITIONS)
        self._recording_since: float | None = None

    def on_changes(self, changes: StateChanges) -> None:
        """Take the changes of a tick."""
        self._kept.append(changes)

    def take_in(self) -> None:
        """Look through what was kept; to be called now and then, else it piles up."""
        while self._kept:
            changes = self._kept.popleft()
            stamp = b""
            if self._recording_since is not None:
                passed = round((changes.stamp - self._recording_since) * 1e6)
                stamp = min(max(0, passed), _MOST_MICROSECONDS).to_bytes(6, "little")
            for uid, state in changes:
                self._shown[uid] = IDLE_AFTER + self._states[uid] if state == IDLE else state
                self._states[uid] = state
                if stamp:
                    self._transitions.append(stamp + _STATE.pack(uid, state))

    def status_bytes(self) -> bytes:
        """Three bytes a node, SubTree by SubTree, in the order of their making: u16 uid, u8 state."""
        self.take_in()
        return b"".join(_STATE.pack(uid, state) for uid, state in self._shown.items())

    def start_recording(self) -> bytes:
        """Record from now on, on the tree's clock; returns the time of day in microseconds since the epoch, as text."""
        self.take_in()
        self._transitions.clear()
        self._recording_since = self._clock.now()
        return str(time.time_ns() // 1000).encode()

    def stop_recording(self) -> None:
        """Record no longer; what was recorded stays until it is fetched."""
        self.take_in()
        self._recording_since = None

    def take_transitions(self) -> bytes:
        """What was recorded since the last call: u48 microseconds since the start, u16 uid, u8 state each."""
        self.take_in()
        taken = b"".join(self._transitions)
        self._transitions.clear()
        return taken
