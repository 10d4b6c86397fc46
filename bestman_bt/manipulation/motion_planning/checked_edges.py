"""Straight joint motions, each checked once: coarsely during planning, finely before the result is returned."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from enum import IntEnum
from functools import lru_cache
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from bestman_bt.manipulation.collision.base import CollisionWorld
from bestman_bt.manipulation.motion_planning.base import MotionPlanningError, PathConstraint, PlanningErrorCode

_CHECKS_BETWEEN_LOOKS_AT_THE_CLOCK = 256


class CountedValidity:
    """Checks a configuration for collisions and the constraint; returns a Python ``bool`` (OMPL rejects numpy's).

    ``wall_limit``: seconds after which it raises MotionPlanningError (``timeout``). A result never depends on it.
    """

    def __init__(self, world: CollisionWorld, constraint: PathConstraint | None, wall_limit: float) -> None:
        self._is_free = world.is_free
        self._constraint = constraint
        self._wall_limit = wall_limit
        self._end = time.monotonic() + wall_limit
        self.checks = 0

    def __call__(self, positions: NDArray[np.float64]) -> bool:
        """Return whether the arm may stand at ``positions`` (n,)."""
        self.checks += 1
        if self.checks % _CHECKS_BETWEEN_LOOKS_AT_THE_CLOCK == 0 and time.monotonic() > self._end:
            raise MotionPlanningError(
                PlanningErrorCode.TIMEOUT,
                f"planning was aborted after {self._wall_limit:g} s and {self.checks} checks",
            )
        if self._constraint is not None and not self._constraint.satisfied(positions):
            return False
        return bool(self._is_free(positions))


def dense_points(path: NDArray[np.float64], step: float) -> Iterator[NDArray[np.float64]]:
    """Yield points (n,) along ``path`` (N, n), at most ``step`` rad (Euclidean) apart, including all waypoints."""
    yield path[0]
    for a, b in pairwise(path):
        count = max(1, math.ceil(float(np.linalg.norm(b - a)) / step))
        for i in range(1, count + 1):
            yield a + (i / count) * (b - a)


@lru_cache(maxsize=1024)
def halving_order(count: int) -> tuple[float, ...]:
    """Return the fractions i / count, 0 < i < count, from coarse to fine."""
    order: list[float] = []
    ranges = [(0, count)]
    for low, high in ranges:
        middle = (low + high) // 2
        if middle > low:
            order.append(middle / count)
            ranges += [(low, middle), (middle, high)]
    return tuple(order)


class Proof(IntEnum):
    """The level of checks of an edge. ``PART``: part of a coarsely checked edge."""

    NONE = 0
    PART = 1
    COARSE = 2
    FINE = 3


class CheckedEdges:
    """Caches the checks of edges, so that no point is checked twice at the same resolution.

    ``coarse``, ``fine``: rad (Euclidean) between the points of a coarse and a fine check, ends included.
    """

    def __init__(self, is_valid: CountedValidity, coarse: float, fine: float) -> None:
        self.is_valid = is_valid
        self._valid: set[bytes] = set()
        self._coarse = coarse
        self._ratio = max(1, math.ceil(coarse / fine - 1e-9))
        self._proofs: dict[tuple[bytes, bytes], Proof] = {}
        self._blocked: set[tuple[bytes, bytes]] = set()

    @property
    def checks(self) -> int:
        """The number of configurations checked so far."""
        return self.is_valid.checks

    def is_free(self, a: NDArray[np.float64], b: NDArray[np.float64], fine: bool = False) -> bool:
        """Return whether the straight edge from ``a`` to ``b``, each (n,), radians or metres, is valid. ``fine``: check
        at the fine resolution. Results are stored: a blocked edge stays blocked.
        """
        key = _key(a, b)
        if key in self._blocked:
            return False
        proof = self._proofs.get(key, Proof.NONE)
        if proof is Proof.FINE or (proof is not Proof.NONE and not fine):
            return True
        if not self._check(a, b, proof, fine):
            self._blocked.add(key)
            return False
        self._proofs[key] = Proof.FINE if fine else Proof.COARSE
        self._valid.update(key)
        return True

    def is_path_free(self, path: NDArray[np.float64]) -> bool:
        """Return whether all edges of ``path`` (N, n) are valid, checked finely."""
        return all(self.is_free(a, b, fine=True) for a, b in pairwise(path))

    def split(self, a: NDArray[np.float64], b: NDArray[np.float64], point: NDArray[np.float64]) -> None:
        """Record that ``point`` lies on the edge from ``a`` to ``b``, so that both parts inherit its checks."""
        proof = self._proofs.get(_key(a, b), Proof.NONE)
        if proof is Proof.NONE:
            return
        for key in (_key(a, point), _key(point, b)):
            inherited = proof if proof is Proof.FINE else Proof.PART
            self._proofs[key] = max(inherited, self._proofs.get(key, Proof.NONE))

    def _check(self, a: NDArray[np.float64], b: NDArray[np.float64], proof: Proof, fine: bool) -> bool:
        difference = b - a
        count = max(1, math.ceil(math.sqrt(difference.dot(difference)) / self._coarse))
        is_valid = self.is_valid
        if proof is not Proof.COARSE:
            if not all(point.tobytes() in self._valid or is_valid(point) for point in (b, a)):
                return False
            if not all(is_valid(a + fraction * difference) for fraction in halving_order(count)):
                return False
        if not fine:
            return True
        total = count * self._ratio
        return all(is_valid(a + (i / total) * difference) for i in range(1, total) if i % self._ratio)


def _key(a: NDArray[np.float64], b: NDArray[np.float64]) -> tuple[bytes, bytes]:
    """Return the same for both directions."""
    one, other = a.tobytes(), b.tobytes()
    return (one, other) if one < other else (other, one)
