"""Planning problems: STRIPS with types, negative conditions, action costs, and ADL's ``forall``."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

from bestman_bt.errors import AlgorithmError, InputError

EQUAL = "="
"""The predicate that holds of a thing and itself, in any state."""


def with_article(noun: str) -> str:
    """``an object``, ``a place``."""
    return f"{'an' if noun[0] in 'aeiou' else 'a'} {noun}"


class PlanningError(AlgorithmError):
    """No plan came about; the text says why."""


class GoalError(PlanningError, InputError):
    """A goal that does not make sense: a name that nothing has, a contradiction, text that is no formula.

    ``faults``: each that was found.
    """

    def __init__(self, *faults: str) -> None:
        super().__init__("; ".join(faults))
        self.faults = faults


@dataclass
class GoalFaults:
    """Gathers what is wrong with several facts."""

    faults: list[str] = field(default_factory=list)

    @contextmanager
    def step(self) -> Iterator[None]:
        """Note the faults of a GoalError that the body raises, and go on behind it."""
        try:
            yield
        except GoalError as error:
            self.faults += error.faults

    def raise_if_any(self) -> None:
        """GoalError with all of them, each once."""
        if self.faults:
            raise GoalError(*dict.fromkeys(self.faults))


class Unsolvable(PlanningError):
    """No plan reaches the goal. ``missing``: the facts that nothing brings about."""

    def __init__(self, why: str, missing: tuple[Literal, ...] = ()) -> None:
        super().__init__(why)
        self.missing = missing


class Fact(NamedTuple):
    """``on(mug, table)``. In an operator, ``{object}`` among the arguments stands for its parameter."""

    predicate: str
    arguments: tuple[str, ...] = ()

    def __str__(self) -> str:
        return f"{self.predicate}({', '.join(self.arguments)})" if self.arguments else self.predicate

    def bound(self, values: Mapping[str, str]) -> Fact:
        """Return the fact with ``values`` in the places of the parameters; ``values``: ``{"{object}": "mug"}``."""
        return Fact(self.predicate, tuple(values.get(argument, argument) for argument in self.arguments))


class Literal(NamedTuple):
    """A fact, or that it does not hold."""

    fact: Fact
    negated: bool = False

    def __str__(self) -> str:
        return f"not {self.fact}" if self.negated else str(self.fact)

    def __invert__(self) -> Literal:
        return Literal(self.fact, not self.negated)

    def bound(self, values: Mapping[str, str]) -> Literal:
        """As ``Fact.bound``."""
        return Literal(self.fact.bound(values), self.negated)

    def holds_in(self, state: Collection[Fact]) -> bool:
        """Return whether it holds where exactly the facts of ``state`` do."""
        if self.fact.predicate == EQUAL:
            return (self.fact.arguments[0] == self.fact.arguments[1]) != self.negated
        return (self.fact in state) != self.negated


@dataclass(frozen=True)
class Forall:
    """``forall c - container: behind({place}, c) -> open(c)``, or ``forall p - place: not near(p)``.

    ``given`` must be of a predicate that no operator changes, so that grounding leaves a conjunction of literals.
    ``variable`` is written with braces; within the condition it hides a parameter of the same name.
    """

    variable: str
    type: str
    given: Fact | None
    then: Literal

    def __str__(self) -> str:
        text = f"{self.then}" if self.given is None else f"{self.given} -> {self.then}"
        return f"forall {self.variable[1:-1]} - {self.type}: {text.replace(self.variable, self.variable[1:-1])}"

    def bound(self, values: Mapping[str, str]) -> Forall:
        """As ``Fact.bound``."""
        outside = {name: value for name, value in values.items() if name != self.variable}
        given = self.given.bound(outside) if self.given is not None else None
        return Forall(self.variable, self.type, given, self.then.bound(outside))

    def at(self, name: str) -> tuple[Fact | None, Literal]:
        """``given`` and ``then`` for one thing."""
        values = {self.variable: name}
        return self.given.bound(values) if self.given is not None else None, self.then.bound(values)

    def of(self, name: str, state: Collection[Fact]) -> Literal | None:
        """What it says of one thing in a state: nothing where ``given`` does not hold of it."""
        given, then = self.at(name)
        return then if given is None or Literal(given).holds_in(state) else None


Condition = Literal | Forall
"""What pre-conditions and effects are made of."""


@dataclass(frozen=True)
class Operator:
    """An ability as a planner sees it; its facts name its parameters: ``on({object}, {place})``.

    ``parameters``: name → type, in order. ``pre``: must hold at the start; ``hold``: from the start to the end.
    ``add``, ``delete``: hold, and no longer hold, afterwards; ``each``: the same for all things of a type.
    ``cost``: not negative; of abilities more than 0. ``parts``: of the robot that it keeps busy.
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

    @property
    def effects(self) -> tuple[Condition, ...]:
        """What it brings about, then what it undoes."""
        return (*map(Literal, self.add), *(Literal(fact, negated=True) for fact in self.delete), *self.each)

    @property
    def assumed(self) -> Iterator[Forall]:
        """Its conditions and effects that hold of some things only."""
        conditions = (*self.pre, *self.hold, *self.each)
        return (one for one in conditions if isinstance(one, Forall) and one.given is not None)

    @property
    def changes(self) -> frozenset[str]:
        """The predicates of its effects."""
        effects = (one.then if isinstance(one, Forall) else one for one in self.effects)
        return frozenset(effect.fact.predicate for effect in effects)


@dataclass(frozen=True)
class Action:
    """An operator with things of the world for its parameters; everything in it is ground.

    ``pre`` has the hold-conditions, too: what must hold all the way must hold at the start.
    """

    operator: Operator = field(repr=False)
    arguments: tuple[str, ...]
    pre: frozenset[Literal] = field(compare=False, repr=False)
    hold: frozenset[Literal] = field(compare=False, repr=False)
    add: frozenset[Fact] = field(compare=False, repr=False)
    delete: frozenset[Fact] = field(compare=False, repr=False)

    def __str__(self) -> str:
        return f"{self.name}({', '.join(self.arguments)})"

    @cached_property
    def effects(self) -> frozenset[Literal]:
        """What holds afterwards because of it: what it brings about, and that what it undoes does not hold."""
        return frozenset(map(Literal, self.add)).union(Literal(fact, negated=True) for fact in self.delete)

    @property
    def name(self) -> str:
        """The operator's name: that of the node which carries it out."""
        return self.operator.name

    @property
    def ports(self) -> dict[str, str]:
        """Port → value of the node which carries it out."""
        return dict(zip(self.operator.parameters, self.arguments, strict=True))

    @property
    def cost(self) -> float:
        """The operator's cost."""
        return self.operator.cost

    @property
    def parts(self) -> tuple[str, ...]:
        """The parts of the robot that it keeps busy."""
        return self.operator.parts

    def broken_in(self, state: Collection[Fact]) -> tuple[Literal, ...]:
        """Return the pre-conditions that do not hold, sorted; none: it can be done."""
        return tuple(sorted(literal for literal in self.pre if not literal.holds_in(state)))

    def applied_to(self, state: Iterable[Fact]) -> frozenset[Fact]:
        """Return the state afterwards; what it both undoes and brings about holds, as in PDDL."""
        return (frozenset(state) - self.delete) | self.add


@dataclass(frozen=True)
class Problem:
    """``objects``: name → type. ``state``: all that holds. ``goal``: all that shall hold.

    ``supertypes``: type → the more general ones, where there are any: a drawer is a place and a container.
    ``predicates``: name → types of its arguments, as far as they are declared. ``instruction``: the goal in the user's
    words, if it came so.
    """

    objects: Mapping[str, str] = field(hash=False)
    state: frozenset[Fact]
    goal: tuple[Literal, ...]
    operators: tuple[Operator, ...]
    supertypes: Mapping[str, tuple[str, ...]] = field(default_factory=dict, hash=False)
    predicates: Mapping[str, tuple[str, ...]] = field(default_factory=dict, hash=False)
    instruction: str = ""

    def is_a(self, name: str, kind: str) -> bool:
        """Return whether an object is of a type, or of one below it."""
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
        """Which ``forall`` depends on what an operator changes; empty: none does, and grounding is right."""
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
        """The names of all objects of a type, in their order."""
        if kind not in self._of_type:
            self._of_type[kind] = [name for name in self.objects if self.is_a(name, kind)]
        return self._of_type[kind]

    @cached_property
    def _of_type(self) -> dict[str, list[str]]:
        return {}

    def unmet_in(self, state: Collection[Fact]) -> tuple[Literal, ...]:
        """Return the parts of the goal that do not hold."""
        return tuple(literal for literal in self.goal if not literal.holds_in(state))


@dataclass(frozen=True)
class TaskPlan:
    """Actions one after the other; ``cost``: their sum."""

    actions: tuple[Action, ...]

    @property
    def cost(self) -> float:
        """The sum of the actions' costs."""
        return sum(action.cost for action in self.actions)

    def __len__(self) -> int:
        return len(self.actions)

    def __str__(self) -> str:
        return "\n".join(str(action) for action in self.actions)
