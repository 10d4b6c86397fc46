"""Planning problems: ADL, which is STRIPS with types, formulas and conditional effects, and action costs."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple, TypeAlias

from bestman_bt.errors import AlgorithmError, InputError

EQUAL = "="
"""The predicate that holds of a thing and itself, in any state."""
ROOT = "object"
"""PDDL's type of everything."""


def with_article(noun: str) -> str:
    """Return a noun with its indefinite article: ``an object``, ``a place``."""
    return f"{'an' if noun[0] in 'aeiou' else 'a'} {noun}"


class PlanningError(AlgorithmError):
    """Raised if no plan was found; the message gives the reason."""


class GoalError(PlanningError, InputError):
    """Raised for an invalid goal: an unknown name, a contradiction, or text that is not a formula.

    ``faults``: every fault found.
    """

    def __init__(self, *faults: str) -> None:
        super().__init__("; ".join(faults))
        self.faults = faults


@dataclass
class GoalFaults:
    """Collects the faults of several facts."""

    faults: list[str] = field(default_factory=list)

    @contextmanager
    def step(self) -> Iterator[None]:
        """Collect the faults of a GoalError raised by the body, and continue after it."""
        try:
            yield
        except GoalError as error:
            self.faults += error.faults

    def raise_if_any(self) -> None:
        """Raise GoalError with all faults, each once."""
        if self.faults:
            raise GoalError(*dict.fromkeys(self.faults))


class Unsolvable(PlanningError):
    """Raised if no plan reaches the goal. ``missing``: parts of the goal that cannot be achieved."""

    def __init__(self, why: str, missing: tuple[Formula, ...] = ()) -> None:
        super().__init__(why)
        self.missing = missing


class Fact(NamedTuple):
    """A fact ``on(mug, table)``. In an operator, the argument ``{object}`` refers to its parameter."""

    predicate: str
    arguments: tuple[str, ...] = ()

    def __str__(self) -> str:
        return f"{self.predicate}({', '.join(self.arguments)})" if self.arguments else self.predicate

    def bound(self, values: Mapping[str, str]) -> Fact:
        """Return the fact with parameters replaced by ``values``: ``{"{object}": "mug"}``."""
        return Fact(self.predicate, tuple(values.get(argument, argument) for argument in self.arguments))


class Literal(NamedTuple):
    """A fact or its negation."""

    fact: Fact
    negated: bool = False

    def __str__(self) -> str:
        return f"not {self.fact}" if self.negated else str(self.fact)

    def __invert__(self) -> Literal:
        return Literal(self.fact, not self.negated)

    def bound(self, values: Mapping[str, str]) -> Literal:
        """Return the literal with parameters replaced."""
        return Literal(self.fact.bound(values), self.negated)

    def holds_in(self, state: Collection[Fact]) -> bool:
        """Return whether the literal holds if exactly the facts of ``state`` are true."""
        if self.fact.predicate == EQUAL:
            return (self.fact.arguments[0] == self.fact.arguments[1]) != self.negated
        return (self.fact in state) != self.negated


@dataclass(frozen=True)
class Forall:
    """A universally quantified condition: ``forall c - container: behind({place}, c) -> open(c)``, or ``forall p -
    place: not near(p)``.

    ``given``: a static fact: no operator changes its predicate, so grounding gives a conjunction of literals.
    ``variable``: with braces; it shadows a parameter of the same name.
    """

    variable: str
    type: str
    given: Fact | None
    then: Literal

    def __str__(self) -> str:
        text = f"{self.then}" if self.given is None else f"{self.given} -> {self.then}"
        return f"forall {self.variable[1:-1]} - {self.type}: {text.replace(self.variable, self.variable[1:-1])}"

    def bound(self, values: Mapping[str, str]) -> Forall:
        """Return the condition with parameters replaced."""
        outside = {name: value for name, value in values.items() if name != self.variable}
        given = self.given.bound(outside) if self.given is not None else None
        return Forall(self.variable, self.type, given, self.then.bound(outside))

    def at(self, name: str) -> tuple[Fact | None, Literal]:
        """Return ``given`` and ``then`` with the variable replaced by ``name``."""
        values = {self.variable: name}
        return self.given.bound(values) if self.given is not None else None, self.then.bound(values)

    def of(self, name: str, state: Collection[Fact]) -> Literal | None:
        """Return ``then`` for ``name``, or None if ``given`` does not hold for it in ``state``."""
        given, then = self.at(name)
        return then if given is None or Literal(given).holds_in(state) else None


Condition = Literal | Forall
"""The elements of preconditions and effects."""


@dataclass(frozen=True)
class Joined:
    """Formulas joined by ``and`` (``every``) or ``or``; without ``parts``: true, or false."""

    every: bool
    parts: tuple[Formula, ...]

    def __str__(self) -> str:
        joined = " and " if self.every else " or "
        return f"({joined.join(map(str, self.parts)) or str(self.every).lower()})"

    def __invert__(self) -> Joined:
        return Joined(not self.every, tuple(~part for part in self.parts))

    def bound(self, values: Mapping[str, str]) -> Joined:
        """Return the formula with parameters replaced."""
        return Joined(self.every, tuple(part.bound(values) for part in self.parts))


@dataclass(frozen=True)
class Quantified:
    """A formula for all objects of a type (``every``), or for at least one. ``variable``: with braces; it shadows a
    parameter of the same name.
    """

    every: bool
    variable: str
    type: str
    body: Formula

    def __str__(self) -> str:
        body = str(self.body).replace(self.variable, self.variable[1:-1])
        return f"({'forall' if self.every else 'exists'} {self.variable[1:-1]} - {self.type}: {body})"

    def __invert__(self) -> Quantified:
        return Quantified(not self.every, self.variable, self.type, ~self.body)

    def bound(self, values: Mapping[str, str]) -> Quantified:
        """Return the formula with parameters replaced."""
        outside = {name: value for name, value in values.items() if name != self.variable}
        return Quantified(self.every, self.variable, self.type, self.body.bound(outside))


Formula: TypeAlias = Literal | Joined | Quantified
"""A condition of PDDL's ``:adl``; ``not`` stands before facts only."""


@dataclass(frozen=True)
class When:
    """A conditional effect, for all objects of ``variables``, name with braces → type."""

    given: Formula
    effect: Literal
    variables: Mapping[str, str] = field(default_factory=dict, hash=False)


@dataclass(frozen=True)
class AnyOf:
    """A ground condition: all parts of at least one of the ``ways`` hold. Without ways it never holds."""

    ways: tuple[Ground, ...]

    def __str__(self) -> str:
        return f"({' or '.join(' and '.join(sorted(map(str, way))) for way in self.ways) or 'false'})"

    def holds_in(self, state: Collection[Fact]) -> bool:
        """Return whether the condition holds if exactly the facts of ``state`` are true."""
        return any(all(part.holds_in(state) for part in way) for way in self.ways)


Ground: TypeAlias = frozenset[Literal | AnyOf]
"""A ground formula: all parts hold."""


@dataclass(frozen=True)
class Operator:
    """An ability for planners; its facts use its parameters: ``on({object}, {place})``.

    ``parameters``: name → type, in order. ``pre``: must hold at the start; ``hold``: throughout. ``add``, ``delete``:
    facts that hold, and no longer hold, afterwards; ``each``: the same for all things of a type. ``cost``: not
    negative; positive for abilities. ``parts``: parts of the robot in use. ``formulas``: must hold at the start too;
    ``when``: conditional effects.
    """

    name: str
    parameters: Mapping[str, str] = field(default_factory=dict, hash=False)
    pre: tuple[Condition, ...] = ()
    hold: tuple[Condition, ...] = ()
    add: tuple[Fact, ...] = ()
    delete: tuple[Fact, ...] = ()
    each: tuple[Forall, ...] = ()
    cost: float = 1.0
    parts: tuple[str, ...] = ()
    formulas: tuple[Formula, ...] = ()
    when: tuple[When, ...] = ()

    @property
    def effects(self) -> tuple[Condition, ...]:
        """The added facts, then the deleted ones; not the conditional effects."""
        return (*map(Literal, self.add), *(Literal(fact, negated=True) for fact in self.delete), *self.each)

    @property
    def assumed(self) -> Iterator[Forall]:
        """Yield the conditions and effects that have ``given``; they apply only to objects for which ``given``
        holds."""
        conditions = (*self.pre, *self.hold, *self.each)
        return (one for one in conditions if isinstance(one, Forall) and one.given is not None)

    @property
    def changes(self) -> frozenset[str]:
        """The predicates of the operator's effects."""
        effects = (one.then if isinstance(one, Forall) else one for one in self.effects)
        return frozenset(effect.fact.predicate for effect in (*effects, *(one.effect for one in self.when)))


@dataclass(frozen=True)
class Action:
    """A ground action: an operator with its parameters bound.

    ``pre`` includes the hold-conditions. ``any_of``: must hold at the start too. ``when``: conditional effects, each
    with what it needs.
    """

    operator: Operator = field(repr=False)
    arguments: tuple[str, ...]
    pre: frozenset[Literal] = field(compare=False, repr=False)
    hold: frozenset[Literal] = field(compare=False, repr=False)
    add: frozenset[Fact] = field(compare=False, repr=False)
    delete: frozenset[Fact] = field(compare=False, repr=False)
    any_of: tuple[AnyOf, ...] = field(default=(), compare=False, repr=False)
    when: tuple[tuple[Ground, Literal], ...] = field(default=(), compare=False, repr=False)

    def __str__(self) -> str:
        return f"{self.name}({', '.join(self.arguments)})"

    @cached_property
    def effects(self) -> frozenset[Literal]:
        """The literals that hold afterwards because of the action, whatever holds before it."""
        return frozenset(map(Literal, self.add)).union(Literal(fact, negated=True) for fact in self.delete)

    @property
    def name(self) -> str:
        """The operator's name, which is also the name of the executing node."""
        return self.operator.name

    @property
    def ports(self) -> dict[str, str]:
        """Port → value of the executing node."""
        return dict(zip(self.operator.parameters, self.arguments, strict=True))

    @property
    def cost(self) -> float:
        """The operator's cost."""
        return self.operator.cost

    @property
    def parts(self) -> tuple[str, ...]:
        """The parts of the robot in use."""
        return self.operator.parts

    def broken_in(self, state: Collection[Fact]) -> tuple[Literal | AnyOf, ...]:
        """Return the violated preconditions, sorted; empty: the action is applicable."""
        broken = sorted(literal for literal in self.pre if not literal.holds_in(state))
        return (*broken, *(one for one in self.any_of if not one.holds_in(state)))

    def applied_to(self, state: Iterable[Fact]) -> frozenset[Fact]:
        """Return the state afterwards; a fact that is both deleted and added holds, as in PDDL."""
        before = frozenset(state)
        occurring = [effect for given, effect in self.when if all(part.holds_in(before) for part in given)]
        deleted = self.delete.union(effect.fact for effect in occurring if effect.negated)
        return (before - deleted) | self.add.union(effect.fact for effect in occurring if not effect.negated)


@dataclass(frozen=True)
class PlanningProblem:
    """A planning problem. ``objects``: name → type. ``state``: all facts that hold. ``goal``: all to be achieved.

    ``supertypes``: type → its supertypes: a drawer is a place and a container. ``predicates``: name → declared types of
    its arguments. ``instruction``: the goal in the user's words, if given.
    """

    objects: Mapping[str, str] = field(hash=False)
    state: frozenset[Fact]
    goal: tuple[Formula, ...]
    operators: tuple[Operator, ...]
    supertypes: Mapping[str, tuple[str, ...]] = field(default_factory=dict, hash=False)
    predicates: Mapping[str, tuple[str, ...]] = field(default_factory=dict, hash=False)
    instruction: str = ""

    def is_a(self, name: str, kind: str) -> bool:
        """Return whether an object is of a type or one of its subtypes."""
        pending, seen = [self.objects[name]], set[str]()
        while pending:
            own = pending.pop()
            if own == kind:
                return True
            if own not in seen:
                seen.add(own)
                pending += self.supertypes.get(own, ())
        return False

    @cached_property
    def unsound(self) -> str:
        """Return the ``forall`` that depends on a fact that an operator changes. Empty if there is none: then grounding
        is correct.
        """
        for operator in self.operators:
            for condition in operator.assumed:
                given = "" if condition.given is None else condition.given.predicate
                changing = [one.name for one in self.operators if given in one.changes]
                if changing:
                    return (
                        f"{operator.name}: '{condition}' asks for {given}, which {changing[0]} changes; before '->' "
                        f"only facts that no ability changes are accepted; name the things, or leave '->' out"
                    )
        return ""

    def of_type(self, kind: str) -> list[str]:
        """Return the names of all objects of a type, in order."""
        if kind not in self._of_type:
            self._of_type[kind] = [name for name in self.objects if self.is_a(name, kind)]
        return self._of_type[kind]

    @cached_property
    def _of_type(self) -> dict[str, list[str]]:
        return {}

    @cached_property
    def changing(self) -> frozenset[str]:
        """The predicates that some operator changes."""
        return frozenset[str]().union(*(operator.changes for operator in self.operators))

    def parts(self, formula: Joined | Quantified) -> tuple[Formula, ...]:
        """Return the formulas of which all (``every``) or one must hold: a quantifier gives one for each object."""
        if isinstance(formula, Joined):
            return formula.parts
        return tuple(formula.body.bound({formula.variable: name}) for name in self.of_type(formula.type))

    def holds(self, formula: Formula, state: Collection[Fact]) -> bool:
        """Return whether a formula without parameters holds in a state."""
        if isinstance(formula, Literal):
            return formula.holds_in(state)
        holding = (self.holds(part, state) for part in self.parts(formula))
        return all(holding) if formula.every else any(holding)

    def unmet_in(self, state: Collection[Fact]) -> tuple[Formula, ...]:
        """Return the unsatisfied parts of the goal."""
        return tuple(formula for formula in self.goal if not self.holds(formula, state))

    @property
    def goal_literals(self) -> tuple[Literal, ...]:
        """The goal of a robot, which consists of literals. Raises PlanningError if it has formulas."""
        literals = tuple(one for one in self.goal if isinstance(one, Literal))
        if len(literals) < len(self.goal):
            formula = next(one for one in self.goal if not isinstance(one, Literal))
            raise PlanningError(f"the goal should consist of facts and negated facts; {formula} is a formula")
        return literals

    def refuse_contradictory_goal(self) -> None:
        """Raise GoalError if the goal contains a fact and its negation."""
        for literal in sorted(one for one in self.goal if isinstance(one, Literal)):
            if ~literal in self.goal:
                raise GoalError(f"the goal contradicts itself: {literal.fact} and not {literal.fact}")


@dataclass(frozen=True)
class TaskPlan:
    """A sequence of actions."""

    actions: tuple[Action, ...]

    @property
    def cost(self) -> float:
        """The sum of the actions' costs."""
        return sum(action.cost for action in self.actions)

    def __len__(self) -> int:
        return len(self.actions)

    def __str__(self) -> str:
        return "\n".join(str(action) for action in self.actions)
