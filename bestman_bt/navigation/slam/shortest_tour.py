"""The shortest way that visits all of a few places (M. Held, R. Karp, "A dynamic programming approach", 1962)."""

from __future__ import annotations

import itertools

import numpy as np
from numpy.typing import NDArray


def shortest_tour(distances: NDArray[np.float64]) -> list[int]:
    """The order 1, 2, … in which to visit the places of ``distances`` (N, N) from place 0 on; it ends anywhere.

    Its cost grows with 2**N: for a dozen places at most. What cannot be got to at all comes last.
    """
    count = len(distances)
    if count < 2:
        return []
    # Ways that do not exist count as very long ones, so that the others are still ordered.
    table = np.where(np.isfinite(distances), distances, 1e6).tolist()
    best: dict[tuple[int, int], tuple[float, int]] = {
        (1 << place, place): (table[0][place], 0) for place in range(1, count)
    }
    for size in range(2, count):
        for visited in itertools.combinations(range(1, count), size):
            bits = sum(1 << place for place in visited)
            for last in visited:
                rest = bits ^ (1 << last)
                best[bits, last] = min(
                    (best[rest, place][0] + table[place][last], place) for place in visited if place != last
                )
    bits = (1 << count) - 2
    last = min(range(1, count), key=lambda place: best[bits, place])
    order = []
    while last:
        order.append(last)
        bits, last = bits ^ (1 << last), best[bits, last][1]
    return order[::-1]
