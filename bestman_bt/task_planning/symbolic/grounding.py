"""Grounding: from operators to actions bound to things of the world, if reachable under the delete relaxation.

Parameters are bound by a join of the conditions with the facts that hold or were reached (as Helmert, "Concise
finite-domain representations for PDDL planning tasks", 2009): each new fact is tried in each matching condition.
Disjunctions become derived facts (S. Thiébaux, J. Hoffmann, B. Nebel, "In defense of PDDL axioms", 2005): their number
grows with the formula and the objects, not exponentially as a disjunctive normal form does.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product

from bestman_bt.task_planning.symbolic.problem import (
    EQUAL,
    Action,
    AnyOf,
    Condition,
    Fact,
    Formula,
    Ground,
    Joined,
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
    formulas = ground_formula(problem, Joined(True, operator.formulas).bound(values))
    parts = formulas if formulas is not None else [AnyOf(())]
    pre = hold.union(written_out(problem, operator.pre, values), (one for one in parts if isinstance(one, Literal)))
    any_of = sorted((one for one in parts if isinstance(one, AnyOf)), key=str)
    effects, when = _effects(problem, operator, values)
    add = frozenset(one.fact for one in effects if not one.negated)
    delete = frozenset(one.fact for one in effects if one.negated) - add
    when = [(given, one) for given, one in when if one.fact not in add]  # what is added holds, though it is deleted too
    needed = frozenset(one for one in pre if one.fact.predicate != EQUAL or not one.holds_in(()))
    return Action(operator, tuple(arguments), needed, hold, add, delete, tuple(any_of), tuple(when))


def _effects(
    problem: PlanningProblem, operator: Operator, values: Mapping[str, str]
) -> tuple[list[Literal], list[tuple[Ground, Literal]]]:
    """Return the effects that always occur, and the others with their conditions."""
    always, conditional = written_out(problem, operator.effects, values), list[tuple[Ground, Literal]]()
    for one in operator.when:
        for names in product(*map(problem.of_type, one.variables.values())):
            inside = {**values, **dict(zip(one.variables, names, strict=True))}
            given, effect = ground_formula(problem, one.given.bound(inside)), one.effect.bound(inside)
            if given:
                conditional.append((given, effect))
            elif given is not None:
                always.append(effect)
    return always, conditional


def ground_formula(problem: PlanningProblem, formula: Formula) -> Ground | None:
    """Return the literals that must hold for a formula without parameters, except facts that never change; None: the
    formula can never hold.
    """
    if isinstance(formula, Literal):
        if formula.fact.predicate in problem.changing:
            return frozenset({formula})
        return frozenset() if formula.holds_in(problem.state) else None
    found = [ground_formula(problem, part) for part in problem.parts(formula)]
    possible = [part for part in found if part is not None]
    if formula.every:
        return Ground().union(*possible) if len(possible) == len(found) else None
    if Ground() in possible:
        return Ground()
    ways = tuple(dict.fromkeys(possible))
    return Ground({AnyOf(ways)}) if len(ways) > 1 else next(iter(ways), None)


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


@dataclass(eq=False)
class Rule:
    """A rule: if all of ``needs`` hold, ``gives`` follow. ``missing``: how many of ``needs`` were not reached."""

    needs: frozenset[Literal]
    gives: frozenset[Literal]
    missing: int = 0


class GroundProblem:
    """STRIPS on bits: bit i of a state is ``literals[i]``; the negation of a fact has its own bit.

    Only changing facts that some action or the goal needs have bits. ``pre``, ``add``, ``delete``: bits of each of the
    ``actions``. Rules are the actions, with the same numbers, then their conditional effects, then derived facts.
    ``needs``, ``gives``: the bit numbers of each rule. ``needed_by``: the numbers of the rules that need each bit.
    ``doers``: the action of each rule, None for derived facts.
    """

    def __init__(self, problem: PlanningProblem, goal: frozenset[Literal], reach: Reach) -> None:
        done = [(action, rule) for action, rule in reach.actions if not rule.missing]
        numbers = {id(action): number for number, (action, _) in enumerate(done)}
        conditional = [(numbers[id(action)], rule) for action, rule in reach.conditional if not rule.missing]
        conditional.sort(key=lambda one: not any(effect.negated for effect in one[1].gives))  # added facts win: last
        derived = [rule for rule in reach.derived if not rule.missing]
        rules = [*(rule for _, rule in done), *(rule for _, rule in conditional), *derived]
        changing = {effect.fact for rule in rules for effect in rule.gives}
        asked = goal.union(*(rule.needs for rule in rules))
        self.literals = sorted(literal for literal in asked if literal.fact in changing)
        bit = {literal: 1 << number for number, literal in enumerate(self.literals)}

        def bits(literals: Iterable[Literal]) -> int:
            return sum(bit.get(literal, 0) for literal in frozenset(literals))

        ways: dict[int, list[int]] = {}
        for rule in derived:
            if fact := bits(rule.gives):  # else nothing that can be reached asks for it
                ways.setdefault(fact, []).append(bits(rule.needs))
        self._derived = list(ways.items())
        self._derived_from = [
            sum(1 << number for number, (_, needs) in enumerate(self._derived) if any(need & one for need in needs))
            for one in bit.values()
        ]
        begins = bits(literal for literal in self.literals if literal.holds_in(problem.state))
        self.initial = self._derive(begins, (1 << len(self._derived)) - 1)
        self.goal = bits(goal)
        self.actions = tuple(action for action, _ in done)
        self.pre = [bits(rule.needs) for _, rule in done]
        self.add = [bits(rule.gives) for _, rule in done]
        self.delete = [bits(~effect for effect in rule.gives) for _, rule in done]
        self._when: list[list[tuple[int, int, int]]] = [[] for _ in done]
        for number, rule in conditional:
            undone = bits(~effect for effect in rule.gives)
            self._when[number].append((bits(rule.needs), undone, bits(rule.gives)))
        self.needs = [self.numbers(bits(rule.needs)) for rule in rules]
        self.gives = [self.numbers(bits(rule.gives)) for rule in rules]
        self.doers = [*range(len(done)), *(number for number, _ in conditional), *(None for _ in derived)]
        self.needed_by: list[list[int]] = [[] for _ in self.literals]
        for number, needs in enumerate(self.needs):
            for need in needs:
                self.needed_by[need].append(number)

    def numbers(self, bits: int) -> list[int]:
        """Return the bit numbers that are set."""
        found = []
        while bits:
            lowest = bits & -bits
            found.append(lowest.bit_length() - 1)
            bits ^= lowest
        return found

    def after(self, state: int, action: int) -> int:
        """Return the state after an applicable action."""
        after = state & ~self.delete[action] | self.add[action]
        for needs, undone, done in self._when[action]:
            if needs & ~state == 0:
                after = after & ~undone | done
        if not self._derived:
            return after
        affected = 0
        for number in self.numbers(after ^ state):
            affected |= self._derived_from[number]
        return self._derive(after, affected)

    def _derive(self, state: int, affected: int) -> int:
        """Return the state with the ``affected`` derived facts (bits by their numbers), and those that follow, as
        they are now.
        """
        while affected:  # a fact that follows from another has a higher number
            first = affected & -affected
            affected ^= first
            fact, ways = self._derived[first.bit_length() - 1]
            if bool(state & fact) != any(needs & ~state == 0 for needs in ways):
                state ^= fact
                affected |= self._derived_from[fact.bit_length() - 1]
        return state


def ground(problem: PlanningProblem) -> GroundProblem:
    """Return the relevant ground actions.

    Raises Unsolvable if the goal is unreachable even under the delete relaxation, GoalError if it is contradictory, and
    PlanningError if the problem is ``unsound``.
    """
    problem.refuse_contradictory_goal()
    if problem.unsound:
        raise PlanningError(problem.unsound)
    reach = _joined(problem)
    goal, missing = frozenset[Literal](), list[Formula]()
    for formula in problem.goal:
        needed = ground_formula(problem, formula)
        literals = reach.literals(needed) if needed is not None else frozenset()
        goal |= literals
        if needed is None or not all(map(reach.has, literals)):
            missing.append(formula)
    if missing:
        raise Unsolvable(f"no action achieves that {' and '.join(map(str, missing))}", tuple(missing))
    return GroundProblem(problem, goal, reach)


def reachable_actions(possible: Iterable[Action], state: frozenset[Fact]) -> tuple[list[Action], set[Literal]]:
    """Return the actions that are reachable under the delete relaxation, and the facts that they may add to
    ``state``.
    """
    reach = Reach(state)
    for action in possible:
        reach.add(action)
    return [action for action, rule in reach.actions if not rule.missing], reach.reached


class Reach:
    """Everything that can be reached under the delete relaxation. ``reached``: the literals that the rules without
    missing needs give.

    ``derived``: rules for the facts that stand for disjunctions; a rule that needs another's fact comes after it.
    ``news``: reached facts that have not been processed yet.
    """

    def __init__(self, state: frozenset[Fact]) -> None:
        self._state = state
        self._waiting = defaultdict[Literal, list[Rule]](list)
        self._known: dict[AnyOf, Literal] = {}
        self.actions: list[tuple[Action, Rule]] = []
        self.conditional: list[tuple[Action, Rule]] = []
        self.derived: list[Rule] = []
        self.reached = set[Literal]()
        self.news: list[Fact] = []

    def add(self, action: Action) -> None:
        """Add an action and its conditional effects."""
        needs = action.pre | self.literals(action.any_of)
        self.actions.append((action, self._rule(needs, action.effects)))
        for given, effect in action.when:
            rule = self._rule(needs | self.literals(given), frozenset({effect}))
            self.conditional.append((action, rule))

    def literals(self, parts: Iterable[Literal | AnyOf]) -> frozenset[Literal]:
        """Return the parts with a derived fact for each disjunction."""
        return frozenset(part if isinstance(part, Literal) else self._fact(part) for part in parts)

    def has(self, literal: Literal) -> bool:
        """Return whether a literal is reached or holds at the start."""
        return literal in self.reached or literal.holds_in(self._state)

    def _fact(self, part: AnyOf) -> Literal:
        if part not in self._known:
            ways = [self.literals(way) for way in part.ways]
            fact = self._known[part] = Literal(Fact(f"({len(self._known)})"))
            self.derived += [self._rule(way, frozenset({fact})) for way in ways]
        return self._known[part]

    def _rule(self, needs: frozenset[Literal], gives: frozenset[Literal]) -> Rule:
        missing = [need for need in needs if not self.has(need)]
        rule = Rule(needs, gives, len(missing))
        for need in missing:
            self._waiting[need].append(rule)
        if not missing:
            self._give(rule)
        return rule

    def _give(self, rule: Rule) -> None:
        ready = [rule]
        while ready:
            for effect in ready.pop().gives - self.reached:
                self.reached.add(effect)
                if not effect.negated and effect.fact not in self._state:
                    self.news.append(effect.fact)
                for waiting in self._waiting.pop(effect, ()):
                    waiting.missing -= 1
                    if not waiting.missing:
                        ready.append(waiting)


def _joined(problem: PlanningProblem) -> Reach:
    """Return the literals that the instances of all operators reach, without creating the instances; in the order of
    their things.
    """
    reach, join, order = Reach(problem.state), _Join(problem), dict[int, tuple[int, ...]]()
    numbers = {name: number for number, name in enumerate(problem.objects)}

    def add(found: Iterable[tuple[int, tuple[str, ...]]]) -> None:
        for number, arguments in found:
            action = bind(problem, problem.operators[number], arguments)
            order[id(action)] = (number, *(numbers[name] for name in arguments))
            reach.add(action)

    add(join.without_facts())
    for fact in sorted(problem.state):
        add(join.with_fact(fact))
    while reach.news:
        add(join.with_fact(reach.news.pop()))
    reach.actions.sort(key=lambda one: order[id(one[0])])
    reach.conditional.sort(key=lambda one: order[id(one[0])])
    return reach


class _Join:
    """Finds every binding of the operators whose conditions are among the added facts, each once."""

    def __init__(self, problem: PlanningProblem) -> None:
        self._problem = problem
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
        """Return the bindings that need a new fact, and otherwise known ones."""
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
        """Return whether the facts that never change allow the binding."""
        return all(
            one.bound(values).holds_in(self._problem.state)
            for one in self._checked[number]
            if one.fact.predicate not in self._problem.changing
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
