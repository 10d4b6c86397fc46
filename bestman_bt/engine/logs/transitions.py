"""The state changes of a log: kept as arrays, told one by one."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import overload

import numpy as np
import numpy.typing as npt

from bestman_bt.engine.status import IDLE

PIECE = 1 << 14
"""Changes that are made objects at a time."""


@dataclass(frozen=True, slots=True)
class Transition:
    """One node's new status; ``time`` in seconds since the start of the log."""

    time: float
    uid: int
    status: int


class Transitions(Sequence[Transition]):
    """``times`` (N,) float64 in seconds, ``uids`` (N,) and ``statuses`` (N,) uint8; in the order of the log."""

    def __init__(
        self, times: npt.NDArray[np.float64], uids: npt.NDArray[np.unsignedinteger], statuses: npt.NDArray[np.uint8]
    ) -> None:
        self.times = times
        self.uids = uids
        self.statuses = statuses

    @classmethod
    def none(cls) -> Transitions:
        """No change at all."""
        return cls(np.zeros(0), np.zeros(0, np.uint32), np.zeros(0, np.uint8))

    @classmethod
    def joined(cls, parts: Sequence[Transitions]) -> Transitions:
        """All of ``parts``, one after the other."""
        return cls(
            np.concatenate([part.times for part in parts]),
            np.concatenate([part.uids for part in parts]),
            np.concatenate([part.statuses for part in parts]),
        )

    def without_repetitions(self) -> Transitions:
        """Those that changed something; at the beginning all nodes are IDLE."""
        if not len(self):
            return self
        order = np.argsort(self.uids, kind="stable")
        uids, statuses = self.uids[order], self.statuses[order]
        before = np.roll(statuses, 1)
        before[0] = IDLE
        before[1:][uids[1:] != uids[:-1]] = IDLE
        is_new = np.empty(len(self), dtype=bool)
        is_new[order] = statuses != before
        return Transitions(self.times[is_new], self.uids[is_new], self.statuses[is_new])

    def __len__(self) -> int:
        return len(self.uids)

    @overload
    def __getitem__(self, index: int) -> Transition: ...
    @overload
    def __getitem__(self, index: slice) -> Transitions: ...
    def __getitem__(self, index: int | slice) -> Transition | Transitions:
        if isinstance(index, slice):
            return Transitions(self.times[index], self.uids[index], self.statuses[index])
        return Transition(float(self.times[index]), int(self.uids[index]), int(self.statuses[index]))

    def __iter__(self) -> Iterator[Transition]:
        for at in range(0, len(self), PIECE):
            piece = slice(at, at + PIECE)
            columns = (self.times[piece].tolist(), self.uids[piece].tolist(), self.statuses[piece].tolist())
            yield from map(Transition, *columns)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Transitions):
            return NotImplemented
        return (
            np.array_equal(self.times, other.times)
            and np.array_equal(self.uids, other.uids)
            and np.array_equal(self.statuses, other.statuses)
        )

    __hash__ = None  # type: ignore[assignment]  # arrays can change
