"""Grounding: from operators to actions bound to things of the world, if reachable under the delete relaxation.

Parameters are bound by a join of the conditions with the facts that hold or were reached (as Helmert, "Concise
finite-domain representations for PDDL planning tasks", 2009): each new fact is tried in each matching condition.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import product

from bestman_bt.task_planning.symbolic.problem import (
    EQUAL,
    Action,
    Condition,
    Fact,
    GoalError,
    Literal,
    Operator,
    PlanningError,
    PlanningProblem,
    Unsolvable,
    with_article,
)


def instantiate(problem: PlanningProblem, operator: Operator, arguments: Sequence[str]) -> Action:
    """Return the action of an operator for given arguments. Raises PlanningError for a wrong number or type."""
    if len(arguments) != len(operator.parameters):
        named = ", ".join(operator.parameters)
        raise PlanningError(f"{operator.name} takes ({named}), got ({', '.join(arguments)})")
    for (port, kind), name in zip(operator.parameters.items(), arguments, strict=True):
        if name not in problem.objects:
            raise PlanningError(f"{operator.name}: {port} is {name!r}, which does not exist")
        if not problem.is_a(name, kind):
            kinds = with_article(kind), with_article(problem.objects[name])
            raise PlanningError(f"{operator.name}: {port} should be {kinds[0]}, {name} is {kinds[1]}")
    return bind(problem, operator, arguments)


def bind(problem: PlanningProblem, operator: Operator, arguments: Sequence[str]) -> Action:
    """Return the action for valid arguments. Raises PlanningError if a ``forall`` depends on changing facts."""
    if problem.unsound:
        raise PlanningError(problem.unsound)
    values = {f"{{{name}}}": value for name, value in zip(operator.parameters, arguments, strict=True)}
    hold = frozenset(written_out(problem, operator.hold, values))
    pre = hold.union(written_out(problem, operator.pre, values))
    effects = written_out(problem, operator.effects, values)
    add = frozenset(one.fact for one in effects if not one.negated)
    delete = frozenset(one.fact for one in effects if one.negated) - add
    needed = frozenset(one for one in pre if one.fact.predicate != EQUAL or not one.holds_in(()))
    return Action(operator, tuple(arguments), needed, hold, add, delete)


def written_out(problem: PlanningProblem, conditions: Iterable[Condition], values: Mapping[str, str]) -> list[Literal]:
    """Return the conditions with parameters replaced by ``values``; ``forall`` becomes a literal per object that
    satisfies ``given``."""
    literals: list[Literal] = []
    for condition in conditions:
        bound = condition.bound(values)
        if isinstance(bound, Literal):
            literals.append(bound)
            continue
        each = (bound.of(name, problem.state) for name in problem.of_type(bound.type))
        literals += [literal for literal in each if literal is not None]
    return literals


class GroundProblem:
    """STRIPS on bits: bit i of a state is ``literals[i]``; the negation of a fact has its own bit.

    Only changing facts that some action or the goal needs have bits. ``pre``, ``add``, ``delete``: bits of each of the
    ``actions``. ``needs``, ``gives``: the bit numbers in ``pre`` and ``add``. ``needed_by``: the numbers of the actions
    that need each bit.
    """

    def __init__(self, problem: PlanningProblem, actions: Sequence[Action]) -> None:
        changing = {effect.fact for action in actions for effect in action.effects}
        asked = {need for action in actions for need in action.pre}.union(problem.goal)
        self.literals = sorted(literal for literal in asked if literal.fact in changing)
        bit = {literal: 1 << number for number, literal in enumerate(self.literals)}

        def bits(literals: Iterable[Literal]) -> int:
            return sum(bit.get(literal, 0) for literal in frozenset(literals))

        self.initial = bits(literal for literal in self.literals if literal.holds_in(problem.state))
        self.goal = bits(problem.goal)
        self.actions = tuple(actions)
        self.pre = [bits(action.pre) for action in actions]
        self.add = [bits(action.effects) for action in actions]
        self.delete = [bits(~effect for effect in action.effects) for action in actions]
        self.needs = list(map(self.numbers, self.pre))
        self.gives = list(map(self.numbers, self.add))
        self.needed_by: list[list[int]] = [[] for _ in self.literals]
        for action, needs in enumerate(self.needs):
            for need in needs:
                self.needed_by[need].append(action)

    def numbers(self, bits: int) -> list[int]:
        """Return the bit numbers that are set."""
        found = []
        while bits:
            lowest = bits & -bits
            found.append(lowest.bit_length() - 1)
            bits ^= lowest
        return found

    def after(self, state: int, action: int) -> int:
        """Return the state after an action."""
        return state & ~self.delete[action] | self.add[action]


def ground(problem: PlanningProblem) -> GroundProblem:
    """Return the relevant ground actions. Raises Unsolvable if the goal is unreachable even under the delete
    relaxation.
    """
    for literal in sorted(problem.goal):
        if ~literal in problem.goal:
            raise GoalError(f"the goal contradicts itself: {literal.fact} and not {literal.fact}")
    if problem.unsound:
        raise PlanningError(problem.unsound)
    actions, reached = _joined(problem)
    missing = tuple(goal for goal in problem.unmet_in(problem.state) if goal not in reached)
    if missing:
        raise Unsolvable(f"no action achieves that {' and '.join(map(str, missing))}", missing)
    return GroundProblem(problem, actions)


def reachable_actions(possible: Iterable[Action], state: frozenset[Fact]) -> tuple[list[Action], set[Literal]]:
    """Return the actions that are reachable under the delete relaxation, and the facts that they may add to
    ``state``.
    """
    actions, reach = list(possible), _Reach(state)
    for action in actions:
        reach.add(action)
    return [action for action in actions if id(action) in reach.done], reach.reached


class _Reach:
    """Actions that wait for their preconditions. ``reached``: effects of the ready ones (``done``, by id).

    ``news``: reached facts that have not been processed yet.
    """

    def __init__(self, state: frozenset[Fact]) -> None:
        self._state = state
        self._waiting = defaultdict[Literal, list[Action]](list)
        self._missing: dict[int, int] = {}
        self.reached = set[Literal]()
        self.done = dict[int, Action]()
        self.news: list[Fact] = []

    def add(self, action: Action) -> None:
        missing = [need for need in action.pre if not need.holds_in(self._state) and need not in self.reached]
        self._missing[id(action)] = len(missing)
        for need in missing:
            self._waiting[need].append(action)
        if not missing:
            self._do(action)

    def _do(self, action: Action) -> None:
        ready = [action]
        while ready:
            action = ready.pop()
            self.done[id(action)] = action
            for effect in action.effects - self.reached:
                self.reached.add(effect)
                if not effect.negated and effect.fact not in self._state:
                    self.news.append(effect.fact)
                for waiting in self._waiting.pop(effect, ()):
                    self._missing[id(waiting)] -= 1
                    if not self._missing[id(waiting)]:
                        ready.append(waiting)


def _joined(problem: PlanningProblem) -> tuple[list[Action], set[Literal]]:
    """Return the reachable actions of all instances of the operators, without creating these; in the order of their
    things.
    """
    reach, join, order = _Reach(problem.state), _Join(problem), dict[int, tuple[int, ...]]()
    numbers = {name: number for number, name in enumerate(problem.objects)}

    def add(found: Iterable[tuple[int, tuple[str, ...]]]) -> None:
        for number, arguments in found:
            action = bind(problem, problem.operators[number], arguments)
            order[id(action)] = (number, *(numbers[name] for name in arguments))
            made.append(action)
            reach.add(action)

    made: list[Action] = []  # kept, so that each has an id of its own
    add(join.without_facts())
    for fact in sorted(problem.state):
        add(join.with_fact(fact))
    while reach.news:
        add(join.with_fact(reach.news.pop()))
    return sorted(reach.done.values(), key=lambda action: order[id(action)]), reach.reached


class _Join:
    """Finds every binding of the operators whose conditions are among the added facts, each once."""

    def __init__(self, problem: PlanningProblem) -> None:
        self._problem = problem
        self._changing = frozenset[str]().union(*(operator.changes for operator in problem.operators))
        self._kinds = [{f"{{{name}}}": kind for name, kind in one.parameters.items()} for one in problem.operators]
        kinds = {kind for one in self._kinds for kind in one.values()}
        self._members = {kind: frozenset(problem.of_type(kind)) for kind in kinds}
        self._wanted: list[list[Fact]] = []
        self._checked: list[list[Literal]] = []
        self._asking = defaultdict[str, list[tuple[int, Fact]]](list)
        for number, operator in enumerate(problem.operators):
            asked = [one for one in (*operator.pre, *operator.hold) if isinstance(one, Literal)]
            wanted = [one.fact for one in asked if not one.negated and one.fact.predicate != EQUAL]
            self._wanted.append(list(dict.fromkeys(wanted)))
            self._checked.append([one for one in asked if one.negated or one.fact.predicate == EQUAL])
            for fact in self._wanted[-1]:
                self._asking[fact.predicate].append((number, fact))
        self._known = defaultdict[str, list[Fact]](list)
        self._having = defaultdict[tuple[str, int, str], list[Fact]](list)
        self._found = set[tuple[int, tuple[str, ...]]]()

    def without_facts(self) -> Iterator[tuple[int, tuple[str, ...]]]:
        """Yield the operator's number and arguments for operators without a required fact."""
        for number, wanted in enumerate(self._wanted):
            if not wanted:
                yield from self._bound(number, (), {})

    def with_fact(self, fact: Fact) -> list[tuple[int, tuple[str, ...]]]:
        """Return the bindings that ask for a new fact, and otherwise for known ones."""
        self._known[fact.predicate].append(fact)
        for place, name in enumerate(fact.arguments):
            self._having[fact.predicate, place, name].append(fact)
        found: list[tuple[int, tuple[str, ...]]] = []
        for number, asked in self._asking[fact.predicate]:
            values = self._unified(number, asked, fact, {})
            if values is not None:
                rest = tuple(one for one in self._wanted[number] if one is not asked)
                found += self._bound(number, rest, values)
        return found

    def _bound(
        self, number: int, rest: tuple[Fact, ...], values: dict[str, str]
    ) -> Iterator[tuple[int, tuple[str, ...]]]:
        """Bind the remaining conditions, the most selective first, then unconstrained parameters."""
        if rest:
            candidates = {fact: self._candidates(fact, values) for fact in rest}
            first = min(rest, key=lambda fact: len(candidates[fact]))
            later = tuple(fact for fact in rest if fact is not first)
            for fact in candidates[first]:
                more = self._unified(number, first, fact, values)
                if more is not None:
                    yield from self._bound(number, later, more)
            return
        free = [name for name in self._kinds[number] if name not in values]
        for names in product(*(self._problem.of_type(self._kinds[number][name]) for name in free)):
            all_values = values | dict(zip(free, names, strict=True))
            key = number, tuple(all_values[name] for name in self._kinds[number])
            if key not in self._found and self._possible(number, all_values):
                self._found.add(key)
                yield key

    def _possible(self, number: int, values: Mapping[str, str]) -> bool:
        """Return whether what never changes allows it."""
        return all(
            one.bound(values).holds_in(self._problem.state)
            for one in self._checked[number]
            if one.fact.predicate not in self._changing
        )

    def _candidates(self, asked: Fact, values: Mapping[str, str]) -> list[Fact]:
        fitting = self._known[asked.predicate]
        for place, argument in enumerate(asked.arguments):
            name = values.get(argument, argument)
            if not name.startswith("{"):
                fitting = min(fitting, self._having[asked.predicate, place, name], key=len)
        return fitting

    def _unified(self, number: int, asked: Fact, fact: Fact, values: dict[str, str]) -> dict[str, str] | None:
        """Return ``values`` extended such that a condition matches the fact, or None if they do not unify."""
        if len(asked.arguments) != len(fact.arguments):
            return None
        more = dict(values)
        for argument, name in zip(asked.arguments, fact.arguments, strict=True):
            kind = self._kinds[number].get(argument)
            if kind is None:
                if argument != name:
                    return None
            elif more.setdefault(argument, name) != name or name not in self._members[kind]:
                return None
        return more
