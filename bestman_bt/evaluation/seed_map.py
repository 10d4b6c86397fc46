"""A compact map from seeds to numbers, for millions of episodes."""

from __future__ import annotations

from array import array
from bisect import bisect_left
from collections.abc import Iterable, Iterator, Mapping
from itertools import pairwise

import numpy as np

LIMIT = 2**63
"""Seeds and numbers are below it, and not below its negative."""
WAITING = 1 / 16
"""Seeds that may wait to be sorted in, as a fraction of the others."""


class SeedMap(Mapping[int, int]):
    """Takes 16 bytes for each seed, and about 25 if they are set in another than ascending order. Iteration is in
    ascending order.

    Seeds and numbers are from -2⁶³ to 2⁶³ - 1; others raise OverflowError.
    """

    def __init__(self, seeds: Iterable[int] = (), numbers: Iterable[int] = ()) -> None:
        """Take seeds in any order with their numbers; the last number of a seed counts."""
        self._seeds, self._numbers = array("q", seeds), array("q", numbers)
        self._waiting: dict[int, int] = {}
        """Seeds to be sorted in later, together: one at a time, each would move all seeds behind it."""
        if any(seed >= after for seed, after in pairwise(self._seeds)):
            self._sort()

    def __getitem__(self, seed: int) -> int:
        place = self._place(seed)
        return self._waiting[seed] if place is None else self._numbers[place]

    def __setitem__(self, seed: int, number: int) -> None:
        if not (-LIMIT <= seed < LIMIT and -LIMIT <= number < LIMIT):
            raise OverflowError(f"the seed {seed} or its number {number} has more than 64 bits")
        place = self._place(seed)
        if place is not None:
            self._numbers[place] = number
        elif self._seeds and seed < self._seeds[-1]:
            self._waiting[seed] = number
            if len(self._waiting) > WAITING * len(self._seeds):
                self._sort()
        else:
            self._seeds.append(seed)
            self._numbers.append(number)

    def __iter__(self) -> Iterator[int]:
        if self._waiting:
            self._sort()
        return iter(self._seeds)

    def __len__(self) -> int:
        return len(self._seeds) + len(self._waiting)

    def _place(self, seed: int) -> int | None:
        place = bisect_left(self._seeds, seed)
        return place if place < len(self._seeds) and self._seeds[place] == seed else None

    def _sort(self) -> None:
        seeds = np.array(self._seeds + array("q", self._waiting))
        numbers = np.array(self._numbers + array("q", self._waiting.values()))
        order = np.argsort(seeds, kind="stable")
        order = order[np.append(np.diff(seeds[order]) > 0, True)]
        self._seeds, self._numbers = array("q", seeds[order].tobytes()), array("q", numbers[order].tobytes())
        self._waiting.clear()
