"""Regression: the conditions at each point of a plan under which the rest of it reaches the goal.

R. E. Fikes, P. E. Hart, N. J. Nilsson, "Learning and Executing Generalized Robot Plans", Artificial Intelligence 3,
1972: the kernels of the triangle table, with which PLANEX chooses the last action that is ready.
"""

from __future__ import annotations

import functools
import operator
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from typing import NamedTuple

from bestman_bt.task_planning.builders.plan_tree import PlanStep
from bestman_bt.task_planning.symbolic.problem import Fact, Literal, PlanningError

Kernel = frozenset[Literal]
"""Literals that must all hold."""


def kernels(steps: Sequence[PlanStep], goal: Iterable[Literal]) -> tuple[Kernel, ...]:
    """Return len(steps) + 1 kernels: if ``kernels[i]`` holds, the steps from ``i`` on reach the goal; the last one is
    the goal.

    Raises PlanningError if a step undoes what a later one, or the goal, needs.
    """
    found = [frozenset(goal)]
    for step in reversed(steps):
        found.append(kernel(step, found[-1]))
    return tuple(reversed(found))


def kernel(step: PlanStep, after: Kernel) -> Kernel:
    """Return the weakest conditions before a step such that ``after`` holds after it. Raises PlanningError if there are
    none.
    """
    effects = step.effects
    undone = sorted(literal for literal in after if ~literal in effects)
    if undone:
        raise PlanningError(f"{step} undoes {undone[0]}, which is needed after it")
    before = (after - effects) | step.pre
    for literal in sorted(before):
        if literal.negated and ~literal in before:
            raise PlanningError(f"before {step}, {literal} and the contrary would have to hold")
    return before


class ReadyStep(NamedTuple):
    """A step, and the alternative conditions ``ways`` under which it leads to the goal."""

    step: PlanStep
    ways: tuple[Kernel, ...]

    def holds_in(self, state: Collection[Fact]) -> bool:
        """Return whether the step leads to the goal from a state."""
        return any(all(literal.holds_in(state) for literal in way) for way in self.ways)


def ready_steps(steps: Sequence[PlanStep], goal: Iterable[Literal], most_ways: int) -> tuple[ReadyStep, ...]:
    """Return for each step the conditions under which it leads to the goal, given that later steps may be skipped.
    Execute the last step whose conditions hold.

    Any later step, or the goal, may follow a step: an action with the mug does not depend on a drawer that must be shut
    later. Parallel actions are also separate steps, for the case that the others are done. ``most_ways``: alternatives
    per step, those that skip the fewest steps. Raises PlanningError as ``kernels`` does.
    """
    kernels(steps, goal)  # raises for a contradiction
    alone = [part for whole in steps for part in (*whole.alone, whole)]
    bits = _Bits(goal, *(step.pre | step.effects for step in alone))
    follower = {bits.of(goal): 0}  # way → the number of steps that it skips
    followers = [follower]  # of each later step, and of the goal
    later = set(follower)
    found: list[ReadyStep] = []
    for step in reversed(alone):
        pre, effects = bits.of(step.pre), bits.of(step.effects)
        ways: dict[int, int] = {}
        for skipped, after_step in enumerate(followers):
            for after, skips in after_step.items():
                before = bits.before(pre, effects, after)
                if before is not None:
                    ways[before] = min(ways.get(before, skipped + skips), skipped + skips)
        best = bits.fewest_skips(ways, later, most_ways)
        followers.insert(0, dict(best))
        later.update(dict(best))
        found.insert(0, ReadyStep(step, tuple(bits.kernel(way) for way, _ in best)))
    return tuple(found)


def _single(bits: int) -> Iterator[int]:
    """Yield the bits one by one, the lowest first."""
    while bits:
        one = bits & -bits
        yield one
        bits ^= one


class _Bits:
    """Kernels as whole numbers: bit 2i says that fact i must hold, bit 2i + 1 that it must not."""

    def __init__(self, *kernels: Iterable[Literal]) -> None:
        self._facts = sorted({literal.fact for kernel in kernels for literal in kernel})
        self._index = {fact: 2 * i for i, fact in enumerate(self._facts)}
        self._positive = sum(1 << index for index in self._index.values())

    def of(self, kernel: Iterable[Literal]) -> int:
        """Return a kernel as a number."""
        return sum(1 << (self._index[literal.fact] + literal.negated) for literal in kernel)

    def kernel(self, bits: int) -> Kernel:
        """Return the kernel of a number."""
        places = (one.bit_length() - 1 for one in _single(bits))
        return frozenset(Literal(self._facts[place // 2], negated=bool(place % 2)) for place in places)

    def contrary(self, bits: int) -> int:
        """Return the condition with positive and negative literals exchanged."""
        return (bits & self._positive) << 1 | (bits >> 1) & self._positive

    def before(self, pre: int, effects: int, after: int) -> int | None:
        """Return the condition before a step under which ``after`` holds after it, or None if there is none."""
        if self.contrary(after) & effects:
            return None
        before = after & ~effects | pre
        return None if before & before >> 1 & self._positive else before

    def covered(self, way: int, others: Iterable[int]) -> bool:
        """Return whether the other ways cover ``way``: directly, or by a case split on each fact (Shannon
        expansion).
        """
        missing = ~way
        if not all(other & missing for other in others):
            return True
        contrary = self.contrary(way)
        possible = [other for other in others if not other & contrary]
        asked = functools.reduce(operator.or_, possible, 0) & missing
        undecided = asked & self.contrary(asked)  # facts that some want to hold, and others not to
        if not undecided:
            return False
        one = undecided & -undecided
        return all(self.covered(way | literal, possible) for literal in (one, self.contrary(one)))

    def fewest_skips(self, ways: Mapping[int, int], later: Collection[int], most: int) -> list[tuple[int, int]]:
        """Return the first ``most`` of the simplified ways, each with the number of steps that it skips, the fewest
        first. Ways that ``later`` ones cover are dropped: if one of those holds, the step is not required.
        """
        either = functools.reduce(operator.or_, ways, 0)
        either &= self.contrary(either)  # facts that some want to hold, and others not to
        if any(way ^ one ^ self.contrary(one) in ways for way in ways for one in _single(way & either)):
            ways = self.simplified({way: left for way, left in ways.items() if not self.covered(way, later)})
        by_skips: dict[int, list[int]] = {}
        for way, skips in ways.items():
            by_skips.setdefault(skips, []).append(way)
        best: list[tuple[int, int]] = []
        for skips in sorted(by_skips):
            if len(best) >= most:
                break
            alike = [
                way
                for way in by_skips[skips]
                if not any(other & way == other and other != way for other in ways) and not self.covered(way, later)
            ]
            best += [(way, skips) for way in sorted(alike, key=lambda way: tuple(map(int.bit_length, _single(way))))]
        return best[:most]

    def simplified(self, ways: Mapping[int, int]) -> dict[int, int]:
        """Merge conditions that differ in the value of one fact, and drop those that another one implies."""
        found = dict(ways)
        while True:
            least: list[int] = []  # those that none of the others is a part of
            for way in sorted(found, key=int.bit_count):
                missing = ~way
                if all(other & missing for other in least):
                    least.append(way)
            found = {way: found[way] for way in least}
            merged: dict[int, int] = {}
            for way, skips in found.items():
                for literal in _single(way):
                    other = way ^ literal ^ self.contrary(literal)
                    if other in found:
                        merged[way ^ literal] = min(skips, found[other])
            if not merged:
                return found
            found |= merged
