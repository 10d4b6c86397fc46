"""Reader of PDDL 2.1 files: ``:adl`` and action costs.

Not supported are durations, derived predicates, preferences, types of ``either``, and numbers other than
``total-cost``. Each is refused with its line. The reader and engines of unified-planning support some of them.
"""

from __future__ import annotations

import re
from collections import ChainMap
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import NoReturn

from bestman_bt.registry import suggestion
from bestman_bt.task_planning.symbolic.problem import (
    EQUAL,
    ROOT,
    Fact,
    Formula,
    Joined,
    Literal,
    Operator,
    PlanningError,
    PlanningProblem,
    Quantified,
    When,
)

_TOKEN = re.compile(r"[()]|[^\s();]+")
REQUIREMENTS = (
    *(":action-costs", ":adl", ":conditional-effects", ":disjunctive-preconditions", ":equality"),
    *(":existential-preconditions", ":negative-preconditions", ":quantified-preconditions", ":strips", ":typing"),
    ":universal-preconditions",
)
_NOT_FACTS = (">", "<", ">=", "<=", "assign", "increase", "decrease", "scale-up", "scale-down", "preference", "when")
_NOT_EFFECTS = (*_NOT_FACTS, "and", "or", "not", "imply", "exists", "forall", EQUAL)
_CONDITIONS = "'and', 'or', 'not', 'imply', 'exists', 'forall', '=' and facts are"
_EFFECTS = "'and', 'not', 'forall', 'when' and facts are, and (increase (total-cost) NUMBER) outside of these"
_SECTIONS = (
    *(":requirements", ":types", ":constants", ":objects", ":predicates", ":functions", ":action"),
    *(":init", ":goal", ":metric", ":domain"),
)
"""Sections, in the order in which they are read, regardless of their order in the file."""
_FIELDS = (":parameters", ":precondition", ":effect")
_TOTAL_COST = "total-cost"
_DEPTH = 200
"""Largest depth of nested brackets; files written by hand have fewer than twenty."""


class PddlError(PlanningError):
    """A file cannot be read; ``file``, ``line`` and the reason."""

    def __init__(self, file: str, line: int, what: str) -> None:
        super().__init__(f"{file}:{line}: {what}")
        self.file, self.line = file, line


@dataclass(frozen=True)
class _Word:
    text: str
    line: int


@dataclass(frozen=True)
class _List:
    parts: tuple[_Word | _List, ...]
    line: int

    @property
    def head(self) -> str:
        first = self.parts[0] if self.parts else None
        return first.text if isinstance(first, _Word) else ""


@dataclass
class _Declared:
    """Type → more general type, object → type, predicate → types of its arguments."""

    types: dict[str, str] = field(default_factory=dict)
    objects: dict[str, str] = field(default_factory=dict)
    predicates: dict[str, tuple[str, ...]] = field(default_factory=dict)


_Scope = ChainMap[str, str]
"""Variable, as ``?x`` → its name with braces; the maps behind the first are those of the scopes around it."""


def read_pddl(domain: str | Path, problem: str | Path) -> PlanningProblem:
    """Return the problem of a domain file and a problem file. Raises PddlError with file and line."""
    declared = _Declared()
    operators = _File(domain, declared).domain()
    stated = _File(problem, declared)
    state, goal = stated.problem()
    if not stated.has_metric:  # the shortest plan is asked for
        operators = tuple(replace(operator, cost=1.0) for operator in operators)
    supertypes = {kind: (above,) for kind, above in declared.types.items()}
    return PlanningProblem(declared.objects, state, goal, operators, supertypes, declared.predicates)


def read_goal(source: str | Path) -> tuple[Literal, ...]:
    """Return the goal of a problem file, or of PDDL text such as ``(and (on cup table) (not (open fridge)))``.

    Names are not checked against a domain; ``__`` means ``/``, as written by ``bestman-bt domain --pddl``. Raises
    PddlError.
    """
    if isinstance(source, Path):
        _, goal = _File(source).problem()
    else:
        goal = _File("the goal", text=source).goal()
    literals = [one for one in goal if isinstance(one, Literal)]  # others were refused
    slashes = {name: name.replace("__", "/") for literal in literals for name in literal.fact.arguments}
    return tuple(literal.bound(slashes) for literal in literals)


class _File:
    """A file of one expression, or ``text`` that is called ``path`` in errors.

    ``declared``: the names that it may use, to which it adds its own; None: any names, and a goal of literals only.
    """

    def __init__(self, path: str | Path, declared: _Declared | None = None, text: str | None = None) -> None:
        self._name = str(path)
        self._declared = declared or _Declared()
        self._any_names = declared is None
        self.has_metric = False
        if text is None:
            try:
                text = Path(path).read_text(encoding="utf-8")
            except (OSError, UnicodeDecodeError) as error:
                raise PddlError(self._name, 1, f"it cannot be read: {error}") from error
        self._root = self._parse(text)

    def goal(self) -> tuple[Formula, ...]:
        """Return the formulas that the expression joins by ``and``."""
        return tuple(self._goal_part(part) for part in self._conjuncts(self._root))

    def domain(self) -> tuple[Operator, ...]:
        """Return the operators."""
        operators: dict[str, Operator] = {}
        for section in self._sections("domain"):
            match section.head:
                case ":types":
                    self._declare_types(section)
                case ":constants":
                    self._declare_objects(section)
                case ":predicates":
                    for one in map(self._as_list, section.parts[1:]):
                        kinds = tuple(kind for _, kind in self._of_known_types(one.parts[1:]))
                        self._declared.predicates[one.head] = kinds
                case ":action":
                    operator = self._action(section)
                    if operator.name in operators:
                        self._fail(section, f"there are two actions {operator.name}")
                    operators[operator.name] = operator
                case ":requirements":
                    self._check_requirements(section)
                case ":functions":
                    pass
                case other:
                    self._fail(section, f"{other or 'this'} is not supported")
        return tuple(operators.values())

    def problem(self) -> tuple[frozenset[Fact], tuple[Formula, ...]]:
        """Return state and goal."""
        state = frozenset[Fact]()
        goal: tuple[Formula, ...] | None = None
        for section in self._sections("problem"):
            match section.head:
                case ":objects":
                    self._declare_objects(section)
                case ":init":
                    state = self._state(section)
                case ":goal":
                    goal = (*(goal or ()), *self._goal(section))
                case ":requirements":
                    self._check_requirements(section)
                case ":metric":
                    self._check_metric(section)
                    self.has_metric = True
                case ":domain":
                    pass
                case other:
                    self._fail(section, f"{other or 'this'} is not supported")
        if goal is None:
            self._fail(self._root, "there is no (:goal …)")
        return state, goal

    def _state(self, section: _List) -> frozenset[Fact]:
        true, false = set[Fact](), set[Fact]()
        for part in map(self._as_list, section.parts[1:]):
            if part.head == "not":
                false.add(self._fact(self._only(part, "not"), _Scope()))
            elif part.head != EQUAL:
                true.add(self._fact(part, _Scope()))
        if true & false:
            self._fail(section, f"{min(true & false)} and not {min(true & false)} cannot hold together")
        return frozenset(true)

    def _goal(self, section: _List) -> tuple[Formula, ...]:
        goal = tuple(self._goal_part(part) for part in self._conjuncts(self._only(section, ":goal")))
        if not goal and self._any_names:
            self._fail(section, "the goal is empty; name at least one fact")
        return goal

    def _goal_part(self, part: _List) -> Formula:
        formula = self._formula(part, _Scope())
        if self._any_names and (not isinstance(formula, Literal) or formula.fact.predicate == EQUAL):
            what = f"not ({self._only(part, 'not').head} …)" if part.head == "not" else part.head
            self._fail(part, f"{what} is not supported in a goal for abilities; facts, 'not' before one, and 'and' are")
        return formula

    def _check_metric(self, section: _List) -> None:
        way, what = (*section.parts[1:], *section.parts[:1])[:2]
        minimize = isinstance(way, _Word) and way.text == "minimize"
        if len(section.parts) != 3 or not minimize or not isinstance(what, _List) or what.head != _TOTAL_COST:
            self._fail(section, f"(:metric minimize ({_TOTAL_COST})) is the only supported form")

    def _declare_types(self, section: _List) -> None:
        types = self._declared.types
        types |= {kind.text: above.text for kind, above in self._typed(section.parts[1:])}
        types |= {above: ROOT for above in types.values() if above not in types}  # named after a dash alone
        types.pop(ROOT, None)
        for kind in types:
            above, seen = types.get(kind), [kind]
            while above is not None and above not in seen:
                seen.append(above)
                above = types.get(above)
            if above is not None:
                self._fail(section, f"the types form a cycle: {' - '.join([*seen, above])}")

    def _declare_objects(self, section: _List) -> None:
        for name, kind in self._of_known_types(section.parts[1:]):
            known = self._declared.objects.setdefault(name.text, kind)
            if known != kind:
                self._fail(name, f"{name.text} is declared as {known} and as {kind}")

    def _check_requirements(self, section: _List) -> None:
        for word in map(self._as_word, section.parts[1:]):
            if word.text not in REQUIREMENTS:
                self._fail(word, f"{word.text} is not supported; {', '.join(REQUIREMENTS)} are")

    def _action(self, section: _List) -> Operator:
        name = self._as_word(section.parts[1] if len(section.parts) > 1 else section).text
        fields: dict[str, _List] = {}
        rest = list(section.parts[2:])
        while rest:
            key = self._as_word(rest.pop(0))
            if key.text not in _FIELDS or not rest:
                self._fail(key, f"{key.text} is not supported; {', '.join(_FIELDS)} are, each with its list")
            if key.text in fields:
                self._fail(key, f"{name} has two {key.text}")
            fields[key.text] = self._as_list(rest.pop(0))
        typed = self._variables(fields[":parameters"].parts) if ":parameters" in fields else {}
        variables = _Scope({variable: f"{{{variable[1:]}}}" for variable in typed})
        parameters = {variable[1:]: kind for variable, kind in typed.items()}
        operator = Operator(name, parameters)
        if ":precondition" in fields:
            found = [self._formula(part, variables) for part in self._conjuncts(fields[":precondition"])]
            pre = tuple(one for one in found if isinstance(one, Literal))
            formulas = tuple(one for one in found if not isinstance(one, Literal))
            operator = replace(operator, pre=pre, formulas=formulas)
        return self._with_effects(operator, fields[":effect"], variables) if ":effect" in fields else operator

    def _with_effects(self, operator: Operator, effect: _List, variables: _Scope) -> Operator:
        add: list[Fact] = []
        delete: list[Fact] = []
        when: list[When] = []
        cost = 0.0
        for part in self._conjuncts(effect):
            if part.head == "increase":
                cost += self._cost(part)
                continue
            for one in self._effects(part, variables, (), {}):
                if one.variables or one.given != Joined(True, ()):
                    when.append(one)
                else:
                    (delete if one.effect.negated else add).append(one.effect.fact)
        return replace(operator, add=tuple(add), delete=tuple(delete), when=tuple(when), cost=cost)

    def _effects(
        self, effect: _List, variables: _Scope, given: tuple[Formula, ...], quantified: Mapping[str, str]
    ) -> Iterator[When]:
        """Yield the single effects within conditions and quantifiers."""
        for part in self._conjuncts(effect):
            if part.head == "forall":
                typed, inside, body = self._quantifier(part, variables)
                yield from self._effects(body, inside, given, {**quantified, **typed})
            elif part.head == "when":
                condition, then = self._two(part, "when takes a condition and an effect")
                yield from self._effects(then, variables, (*given, self._formula(condition, variables)), quantified)
            else:
                fact = self._only(part, "not") if part.head == "not" else part
                if fact.head in _NOT_EFFECTS:
                    self._fail(fact, f"{fact.head} is not supported here; {_EFFECTS}")
                literal = Literal(self._fact(fact, variables), negated=part.head == "not")
                yield When(Joined(True, given), literal, quantified)

    def _cost(self, part: _List) -> float:
        if len(part.parts) == 3:
            _, function, amount = part.parts
            counted = isinstance(function, _List) and function.head == _TOTAL_COST and len(function.parts) == 1
            if counted and isinstance(amount, _Word) and re.fullmatch(r"\d+(\.\d+)?", amount.text):
                return float(amount.text)
        return self._fail(part, f"(increase ({_TOTAL_COST}) NUMBER) is the only supported form")

    def _conjuncts(self, part: _List) -> Iterator[_List]:
        if not part.parts:
            return
        if part.head != "and":
            yield part
            return
        for inner in part.parts[1:]:
            yield from self._conjuncts(self._as_list(inner))

    def _formula(self, part: _List, variables: _Scope) -> Formula:
        match part.head:
            case "and" | "or":
                parts = tuple(self._formula(self._as_list(one), variables) for one in part.parts[1:])
                return Joined(part.head == "and", parts)
            case "not":
                return ~self._formula(self._only(part, "not"), variables)
            case "imply":
                given, then = self._two(part, "imply takes two conditions")
                return Joined(False, (~self._formula(given, variables), self._formula(then, variables)))
            case "forall" | "exists":
                typed, inside, body = self._quantifier(part, variables)
                formula = self._formula(body, inside)
                for variable, kind in reversed(typed.items()):
                    formula = Quantified(part.head == "forall", variable, kind, formula)
                return formula
            case head if head in _NOT_FACTS:
                self._fail(part, f"{head} is not supported here; {_CONDITIONS}")
        return Literal(self._fact(part, variables)) if part.parts else Joined(True, ())

    def _quantifier(self, part: _List, variables: _Scope) -> tuple[dict[str, str], _Scope, _List]:
        """Return own names → types of the variables, ``variables`` with them, and the quantified expression."""
        typed, body = self._two(part, f"{part.head} takes variables and a condition or an effect")
        found, inside = dict[str, str](), variables.new_child()
        for variable, kind in self._variables(typed.parts).items():
            own = f"{{{variable[1:]}}}"
            while any(own in scope.values() for scope in inside.maps):  # it may hide a variable of the same name
                own = f"{own[:-1]}_}}"
            inside[variable], found[own] = own, kind
        if not found:
            self._fail(part, f"{part.head} takes at least one variable")
        return found, inside, body

    def _fact(self, part: _List, variables: _Scope) -> Fact:
        words = [self._as_word(one) for one in part.parts]
        if not words:
            self._fail(part, "a fact is expected, not ()")
        self._check_predicate(words)
        for word in words[1:]:
            self._check_argument(word, variables)
        return Fact(words[0].text, tuple(variables.get(word.text, word.text) for word in words[1:]))

    def _check_argument(self, word: _Word, variables: _Scope) -> None:
        what, known = ("variable", [*variables]) if word.text.startswith("?") else ("object", [*self._declared.objects])
        if word.text not in known and (what == "variable" or not self._any_names):
            self._fail(word, f"unknown {what} {word.text!r}; {suggestion(word.text, known)}")

    def _check_predicate(self, words: Sequence[_Word]) -> None:
        name, known = words[0].text, {EQUAL: (ROOT, ROOT), **self._declared.predicates}
        if self._any_names:
            return
        if name not in known:
            self._fail(words[0], f"unknown predicate {name!r}; {suggestion(name, [*self._declared.predicates])}")
        if len(words) - 1 != len(known[name]):
            self._fail(words[0], f"{name} takes {len(known[name])} things, not {len(words) - 1}")

    def _variables(self, parts: tuple[_Word | _List, ...]) -> dict[str, str]:
        """Return variable → type."""
        found: dict[str, str] = {}
        for variable, kind in self._of_known_types(parts):
            if not variable.text.startswith("?"):
                self._fail(variable, f"a variable starts with '?', as ?{variable.text}")
            if variable.text in found:
                self._fail(variable, f"{variable.text} is declared twice")
            found[variable.text] = kind
        return found

    def _of_known_types(self, parts: tuple[_Word | _List, ...]) -> Iterator[tuple[_Word, str]]:
        """Yield each name with its type."""
        known = {ROOT, *self._declared.types}
        for name, kind in self._typed(parts):
            if kind.text not in known and not self._any_names:
                self._fail(kind, f"unknown type {kind.text!r}; {suggestion(kind.text, [*known])}")
            yield name, kind.text

    def _typed(self, parts: tuple[_Word | _List, ...]) -> Iterator[tuple[_Word, _Word]]:
        """Parse ``a b - t c``: yield a and t, b and t, c and object."""
        waiting: list[_Word] = []
        words = iter(parts)
        for part in words:
            word = self._as_word(part)
            if word.text != "-":
                waiting.append(word)
                continue
            kind = next(words, None)
            if kind is None:
                self._fail(word, "a type is expected after '-'")
            if isinstance(kind, _List):
                self._fail(kind, f"{kind.head or 'this'} is not supported; one type is, such as one that both are of")
            yield from ((one, kind) for one in waiting)
            waiting = []
        yield from ((one, _Word(ROOT, one.line)) for one in waiting)

    def _sections(self, kind: str) -> Iterator[_List]:
        parts = self._root.parts
        named = parts[1] if len(parts) > 1 else None
        if self._root.head != "define" or not isinstance(named, _List) or named.head != kind:
            self._fail(self._root, f"(define ({kind} NAME) …) is expected")
        sections = map(self._as_list, parts[2:])
        return iter(sorted(sections, key=lambda one: _SECTIONS.index(one.head) if one.head in _SECTIONS else -1))

    def _only(self, part: _List, what: str) -> _List:
        if len(part.parts) != 2:
            self._fail(part, f"{what} takes one condition")
        return self._as_list(part.parts[1])

    def _two(self, part: _List, what: str) -> tuple[_List, _List]:
        if len(part.parts) != 3:
            self._fail(part, what)
        return self._as_list(part.parts[1]), self._as_list(part.parts[2])

    def _as_list(self, part: _Word | _List) -> _List:
        if not isinstance(part, _List):
            self._fail(part, f"'(' is expected, not {part.text!r}")
        return part

    def _as_word(self, part: _Word | _List) -> _Word:
        if not isinstance(part, _Word):
            self._fail(part, "a name is expected, not '('")
        return part

    def _parse(self, text: str) -> _List:
        stack: list[tuple[list[_Word | _List], int]] = [([], 1)]
        number = 0
        for number, line in enumerate(text.lower().splitlines(), 1):
            for token in _TOKEN.findall(line.partition(";")[0]):
                if token == "(":
                    stack.append(([], number))
                    if len(stack) > _DEPTH:
                        raise PddlError(self._name, number, f"at most {_DEPTH - 1} nested brackets are read")
                elif token == ")":
                    parts, start = stack.pop()
                    if not stack:
                        raise PddlError(self._name, number, "')' without '('")
                    stack[-1][0].append(_List(tuple(parts), start))
                else:
                    stack[-1][0].append(_Word(token, number))
        if len(stack) > 1:
            raise PddlError(self._name, stack[-1][1], "'(' is never closed")
        found = stack[0][0]
        if len(found) != 1:
            raise PddlError(self._name, max(number, 1), f"one (define …) is expected, not {len(found)}")
        return self._as_list(found[0])

    def _fail(self, part: _Word | _List, what: str) -> NoReturn:
        raise PddlError(self._name, part.line, what)
