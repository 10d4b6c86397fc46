"""From operators to actions: bound to things of the world, pruned by what never changes and by relaxed reachability."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence

from bestman_bt.task_planning.symbolic.problem import (
    EQUAL,
    Action,
    Condition,
    Fact,
    GoalError,
    Literal,
    Operator,
    PlanningError,
    Problem,
    Unsolvable,
    with_article,
)

# From operators to actions: parameters bound to things of the world, ``forall`` written out.


def instantiate(problem: Problem, operator: Operator, arguments: Sequence[str]) -> Action:
    """The action of an operator for things of the problem; PlanningError where their number or a type is wrong."""
    if len(arguments) != len(operator.parameters):
        named = ", ".join(operator.parameters)
        raise PlanningError(f"{operator.name} takes ({named}), got ({', '.join(arguments)})")
    for (port, kind), name in zip(operator.parameters.items(), arguments, strict=True):
        if name not in problem.objects:
            raise PlanningError(f"{operator.name}: {port} is {name!r}, and nothing is called so")
        if not problem.is_a(name, kind):
            kinds = with_article(kind), with_article(problem.objects[name])
            raise PlanningError(f"{operator.name}: {port} should be {kinds[0]}, {name} is {kinds[1]}")
    return bind(problem, operator, arguments)


def bind(problem: Problem, operator: Operator, arguments: Sequence[str]) -> Action:
    """As ``instantiate``, for arguments that fit; PlanningError where a ``forall`` depends on what changes."""
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


def written_out(problem: Problem, conditions: Iterable[Condition], values: Mapping[str, str]) -> list[Literal]:
    """Conditions with ``values`` for parameters; ``forall`` becomes a literal for each thing with ``given``."""
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
    """STRIPS on bits: bit i of a state is ``literals[i]``; that a fact does not hold is a bit of its own.

    Bits are for what changes, and of that for what some action or the goal asks for. ``pre``, ``add``, ``delete``: bits
    of each of the ``actions``. ``needs``, ``gives``: the numbers of the bits in ``pre`` and ``add``. ``needed_by``: the
    numbers of the actions that need each bit.
    """

    def __init__(self, problem: Problem, actions: Sequence[Action]) -> None:
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
        """The numbers of the literals that bits stand for."""
        return [number for number in range(len(self.literals)) if bits >> number & 1]

    def after(self, state: int, action: int) -> int:
        """The state that an action leads to."""
        return state & ~self.delete[action] | self.add[action]


def ground(problem: Problem) -> GroundProblem:
    """All actions that may matter; Unsolvable where the goal is out of reach even if nothing were ever undone."""
    for literal in sorted(problem.goal):
        if ~literal in problem.goal:
            raise GoalError(f"the goal contradicts itself: {literal.fact} and not {literal.fact}")
    if problem.unsound:
        raise PlanningError(problem.unsound)
    changing = frozenset[str]().union(*(operator.changes for operator in problem.operators))
    possible = [action for operator in problem.operators for action in _instances(problem, operator, changing)]
    actions, reached = reachable_actions(possible, problem.state)
    missing = tuple(goal for goal in problem.unmet_in(problem.state) if goal not in reached)
    if missing:
        raise Unsolvable(f"nothing brings about that {' and '.join(map(str, missing))}", missing)
    return GroundProblem(problem, actions)


def reachable_actions(possible: Iterable[Action], state: frozenset[Fact]) -> tuple[list[Action], set[Literal]]:
    """Those that can be done if nothing is ever undone, and what may come to hold beside ``state``."""
    actions = list(possible)
    waiting, reached = dict(enumerate(actions)), set[Literal]()
    while ready := [
        number
        for number, action in waiting.items()
        if all(need in reached or need.holds_in(state) for need in action.pre)
    ]:
        for number in ready:
            reached |= waiting.pop(number).effects
    return [action for number, action in enumerate(actions) if number not in waiting], reached


def _instances(problem: Problem, operator: Operator, changing: Collection[str]) -> list[Action]:
    """Bind one parameter after the other, as long as what never changes allows it."""
    conditions = [one for one in (*operator.pre, *operator.hold) if isinstance(one, Literal)]
    fixed = [one for one in conditions if one.fact.predicate not in changing]
    unbound = {f"{{{name}}}" for name in operator.parameters}

    def possible(values: Mapping[str, str]) -> bool:
        known = [one.bound(values) for one in fixed if unbound.intersection(one.fact.arguments) <= values.keys()]
        return all(one.holds_in(problem.state) for one in known)

    found: list[dict[str, str]] = [{}] if possible({}) else []
    for name, kind in operator.parameters.items():
        extended = ({**values, f"{{{name}}}": thing} for values in found for thing in problem.of_type(kind))
        found = [values for values in extended if possible(values)]
    return [bind(problem, operator, tuple(values.values())) for values in found]
