"""A compact map from seeds to numbers, for millions of episodes."""

from __future__ import annotations

from array import array
from bisect import bisect_left
from collections.abc import Iterable, Iterator, Mapping
from itertools import pairwise

import numpy as np


class SeedMap(Mapping[int, int]):
    """Takes 16 bytes for each seed. Iteration is in ascending order; setting seeds in about this order is fast.

    Seeds and numbers are below 2⁶³; others raise OverflowError.
    """

    def __init__(self, seeds: Iterable[int] = (), numbers: Iterable[int] = ()) -> None:
        """Take seeds in any order with their numbers; the last number of a seed counts."""
        self._seeds, self._numbers = array("q", seeds), array("q", numbers)
        if any(seed >= after for seed, after in pairwise(self._seeds)):
            order = np.argsort(self._seeds, kind="stable")
            order = order[np.append(np.diff(np.array(self._seeds)[order]) > 0, True)]
            self._seeds, self._numbers = (
                array("q", np.array(one)[order].tobytes()) for one in (self._seeds, self._numbers)
            )

    def __getitem__(self, seed: int) -> int:
        place = bisect_left(self._seeds, seed)
        if place == len(self._seeds) or self._seeds[place] != seed:
            raise KeyError(seed)
        return self._numbers[place]

    def __setitem__(self, seed: int, number: int) -> None:
        place = bisect_left(self._seeds, seed)
        if place < len(self._seeds) and self._seeds[place] == seed:
            self._numbers[place] = number
        else:
            self._seeds.insert(place, seed)
            self._numbers.insert(place, number)

    def __iter__(self) -> Iterator[int]:
        return iter(self._seeds)

    def __len__(self) -> int:
        return len(self._seeds)
