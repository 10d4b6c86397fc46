"""From operators to actions: bound to things of the world, pruned by what never changes and by relaxed reachability."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

from bestman_bt.task_planning.symbolic.binding import EQUAL, bind, holds
from bestman_bt.task_planning.symbolic.problem import (
    Action,
    Fact,
    Forall,
    GoalError,
    Literal,
    Operator,
    Problem,
    Unsolvable,
)


@dataclass(frozen=True, eq=False)
class GroundProblem:
    """STRIPS on bits: bit i of a state is ``literals[i]``; what is asked to be false is a bit of its own.

    ``pre``, ``add``, ``delete``: bits of each of the ``actions``.
    """

    literals: tuple[Literal, ...]
    actions: tuple[Action, ...]
    initial: int
    goal: int
    pre: tuple[int, ...]
    add: tuple[int, ...]
    delete: tuple[int, ...]

    @cached_property
    def needs(self) -> tuple[tuple[int, ...], ...]:
        """The numbers of the literals that each action needs."""
        return tuple(bits_of(bits) for bits in self.pre)

    @cached_property
    def gives(self) -> tuple[tuple[int, ...], ...]:
        """The numbers of the literals that each action brings about."""
        return tuple(bits_of(bits) for bits in self.add)

    @cached_property
    def needed_by(self) -> tuple[tuple[int, ...], ...]:
        """The numbers of the actions that need each literal."""
        users: list[list[int]] = [[] for _ in self.literals]
        for number, needs in enumerate(self.needs):
            for literal in needs:
                users[literal].append(number)
        return tuple(map(tuple, users))


def bits_of(number: int) -> tuple[int, ...]:
    """The places of the bits that are set, lowest first."""
    found = []
    while number:
        lowest = number & -number
        found.append(lowest.bit_length() - 1)
        number ^= lowest
    return tuple(found)


def ground(problem: Problem) -> GroundProblem:
    """All actions that may matter; Unsolvable where the goal is out of reach even if nothing were ever undone."""
    _check_consistent(problem.goal)
    changing = frozenset(
        literal.fact.predicate
        for operator in problem.operators
        for literal in (effect.then if isinstance(effect, Forall) else effect for effect in operator.effects)
    )
    possible = [action for operator in problem.operators for action in _instances(problem, operator, changing)]
    actions, reached = reachable_actions(possible, problem.state)
    missing = tuple(goal for goal in problem.goal if not _may_hold(goal, problem.state, reached))
    if missing:
        raise Unsolvable(f"nothing brings about that {' and '.join(map(str, missing))}", missing)
    return _in_bits(problem, actions)


def reachable_actions(possible: Iterable[Action], state: frozenset[Fact]) -> tuple[list[Action], frozenset[Literal]]:
    """Those that can be done if nothing is ever undone, and what may come to hold beside ``state``."""
    actions = list(possible)
    done, reached = [False] * len(actions), set[Literal]()
    while True:
        ready = [
            number
            for number, action in enumerate(actions)
            if not done[number] and all(_may_hold(need, state, reached) for need in action.pre)
        ]
        if not ready:
            return [action for action, can in zip(actions, done, strict=True) if can], frozenset(reached)
        for number in ready:
            done[number] = True
            reached.update(map(Literal, actions[number].add))
            reached.update(Literal(fact, negated=True) for fact in actions[number].delete)


def _may_hold(literal: Literal, state: frozenset[Fact], reached: set[Literal] | frozenset[Literal]) -> bool:
    return literal in reached or literal.holds_in(state)


def _check_consistent(goal: Iterable[Literal]) -> None:
    wanted = set(goal)
    for literal in sorted(wanted):
        if ~literal in wanted:
            raise GoalError(f"the goal contradicts itself: {literal.fact} and not {literal.fact}")
        if literal.fact.predicate == EQUAL and not holds(literal, frozenset()):
            raise GoalError(f"the goal asks for {literal}")


def _instances(problem: Problem, operator: Operator, changing: frozenset[str]) -> Iterator[Action]:
    """Bind one parameter after the other; a condition that never changes is checked once its parameters are bound."""
    names = [f"{{{name}}}" for name in operator.parameters]
    fixed: list[list[Literal]] = [[] for _ in range(len(names) + 1)]
    for condition in (*operator.pre, *operator.hold):
        if isinstance(condition, Literal) and condition.fact.predicate not in changing:
            used = [names.index(name) + 1 for name in condition.fact.arguments if name in names]
            fixed[max(used, default=0)].append(condition)
    candidates = [problem.of_type(kind) for kind in operator.parameters.values()]

    def extend(values: dict[str, str]) -> Iterator[Action]:
        depth = len(values)
        if not all(holds(condition.bound(values), problem.state) for condition in fixed[depth]):
            return
        if depth == len(names):
            yield bind(problem, operator, tuple(values.values()))
            return
        for name in candidates[depth]:
            yield from extend({**values, names[depth]: name})

    return extend({})


def _in_bits(problem: Problem, actions: Sequence[Action]) -> GroundProblem:
    """Only what changes, and of that only what some action or the goal asks for, is a bit."""
    changing = {fact for action in actions for fact in action.add | action.delete}
    asked = {need for action in actions for need in action.pre} | set(problem.goal)
    literals = tuple(sorted(literal for literal in asked if literal.fact in changing))
    bit = {literal: 1 << number for number, literal in enumerate(literals)}

    def bits(these: Iterable[Literal]) -> int:
        return sum(bit.get(literal, 0) for literal in set(these))

    add, delete = [], []
    for action in actions:
        gains = {*map(Literal, action.add), *(Literal(fact, negated=True) for fact in action.delete)}
        add.append(bits(gains))
        delete.append(bits(~gain for gain in gains))
    return GroundProblem(
        literals,
        tuple(actions),
        bits(literal for literal in literals if literal.holds_in(problem.state)),
        bits(problem.goal),
        tuple(bits(action.pre) for action in actions),
        tuple(add),
        tuple(delete),
    )
