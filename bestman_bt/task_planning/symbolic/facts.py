"""Facts as text, in goals, declarations and leaves: ``on(mug, table) and not open(drawer_chest/drawer_3)``."""

from __future__ import annotations

import re
from pathlib import Path

from bestman_bt.task_planning.symbolic.pddl_reading import PddlError, read_goal
from bestman_bt.task_planning.symbolic.problem import Condition, Fact, Forall, GoalError, Literal

_TOKEN = re.compile(r"\s*(?:(?P<name>\{\w+\}|[A-Za-z0-9_][\w/.]*(?:-(?!>)[\w/.]+)*)|(?P<sign>->|[(),;:-]))")
_PDDL = re.compile(r"\(\s*[A-Za-z][\w-]*[\s(]")
GOAL_FORM = "on(mug, table) and not open(fridge/upper_door)"
_DEPTH = 50
"""Largest depth of nested brackets: conditions need fewer, and the recursion stays bounded."""
_WORDS = frozenset({"and", "not", "forall"})


class FactSyntaxError(GoalError):
    """The text is not a formula; ``column``: position, from 1."""

    def __init__(self, text: str, at: int, what: str) -> None:
        super().__init__(f"column {at + 1} of {text!r}: {what}")
        self.column = at + 1
        self.what = what


def parse_conditions(text: str) -> tuple[Condition, ...]:
    """Parse facts joined by ``and`` or ``;``, with ``not`` and ``forall c - container: behind({place}, c) -> open(c)``.

    Raises FactSyntaxError.
    """
    return _Parser(text).conditions()


def parse_literals(text: str) -> tuple[Literal, ...]:
    """Parse facts without ``forall``, for goals and states. Raises FactSyntaxError."""
    literals = []
    for condition in parse_conditions(text):
        if isinstance(condition, Forall):
            raise FactSyntaxError(text, text.find("forall"), "forall is not accepted here; name the things")
        literals.append(condition)
    return tuple(literals)


def parse_goal(text: str) -> tuple[Literal, ...]:
    """Parse at least one fact: an empty goal would succeed immediately. Raises GoalError.

    PDDL goals are accepted too: ``(and (on mug table) (not (open fridge)))``.
    """
    try:
        literals = parse_literals(text)
    except FactSyntaxError as error:
        if _PDDL.match(text.strip()) is None:
            raise FactSyntaxError(text, error.column - 1, f"{error.what}; a goal is written as {GOAL_FORM}") from error
        literals = _goal_in_pddl(text)
    if not literals:
        raise GoalError("the goal is empty; name at least one fact")
    return literals


def goal_as_facts(goal: str) -> str:
    """Return a goal (facts, PDDL, or the name of a ``.pddl`` problem file) as facts. Raises GoalError."""
    literals = _goal_in_pddl(Path(goal)) if goal.strip().endswith(".pddl") else parse_goal(goal)
    return " and ".join(map(str, literals))


def _goal_in_pddl(source: str | Path) -> tuple[Literal, ...]:
    try:
        return read_goal(source)
    except PddlError as error:
        raise GoalError(str(error)) from error


def parse_fact(text: str) -> Fact:
    """Parse one fact, not negated. Raises FactSyntaxError."""
    literals = parse_literals(text)
    if len(literals) != 1 or literals[0].negated:
        raise FactSyntaxError(text, 0, "one fact is expected")
    return literals[0].fact


class _Parser:
    """A recursive descent over the tokens (kind, text, column)."""

    def __init__(self, text: str) -> None:
        self._text = text
        self._tokens: list[tuple[str, int]] = []
        self._next = 0
        at = 0
        end = len(text.rstrip())
        while at < end:
            match = _TOKEN.match(text, at)
            if match is None:
                at += len(text[at:]) - len(text[at:].lstrip())
                raise FactSyntaxError(text, at, f"{text[at]!r} is not part of a fact")
            group = match.lastgroup or ""
            self._tokens.append((match[group], match.start(group)))
            at = match.end()
        self._tokens.append(("", end))

    def conditions(self) -> tuple[Condition, ...]:
        found: list[Condition] = []
        while self._peek():
            found.append(self._forall() if self._peek() == "forall" else self._literal())
            if self._take_if("and"):
                if not self._peek():
                    self._fail("a fact is expected after 'and'")
            elif self._peek() and not self._take_if(";"):
                self._fail("'and' is expected between facts")
        return tuple(found)

    def _forall(self) -> Forall:
        self._take("forall")
        begin, name = self._next, self._name("a variable")
        self._take("-")
        kind = self._name("a type")
        self._take(":")
        start, then, given = self._next, self._literal(), None
        if self._peek() == "->":
            if then.negated:
                self._next = start
                self._fail("a fact that is not negated is expected before '->'")
            self._take("->")
            given, then = then.fact, self._literal()
        values = {name: f"{{{name}}}"}
        used = (*then.fact.arguments, *(given.arguments if given is not None else ()))
        if values[name] in used:
            self._next = begin
            self._fail(f"the variable has the name of the parameter {values[name]}; another name is expected")
        return Forall(values[name], kind, given, then).bound(values)

    def _literal(self, depth: int = 0) -> Literal:
        negated = False
        while self._take_if("not"):
            negated = not negated
        if self._take_if("("):
            if depth == _DEPTH:
                self._fail(f"at most {_DEPTH} nested brackets are accepted")
            literal = self._literal(depth + 1)
            self._take(")")
            return ~literal if negated else literal
        return Literal(self._fact(), negated)

    def _fact(self) -> Fact:
        predicate = self._name("a fact")
        arguments: list[str] = []
        if self._take_if("("):
            while not self._take_if(")"):
                if arguments:
                    self._take(",")
                arguments.append(self._name("a name"))
        return Fact(predicate, tuple(arguments))

    def _name(self, what: str) -> str:
        token = self._peek()
        if not token or not (token[0].isalnum() or token[0] in "_{") or token in _WORDS:
            self._fail(f"{what} is expected")
        self._next += 1
        return token

    def _peek(self) -> str:
        return self._tokens[self._next][0]

    def _take_if(self, *tokens: str) -> bool:
        if self._peek() in tokens:
            self._next += 1
            return True
        return False

    def _take(self, token: str) -> None:
        if not self._take_if(token):
            self._fail(f"{token!r} is expected")

    def _fail(self, what: str) -> None:
        token, at = self._tokens[self._next]
        raise FactSyntaxError(self._text, at, f"{what}, not {token!r}" if token else f"{what}, not the end")
