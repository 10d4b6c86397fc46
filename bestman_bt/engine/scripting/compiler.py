"""Compiles parsed scripts to closures on the slots of one blackboard.

Names are resolved once, here: enum values become constants, keys become slots. The commonest forms (``key := key + 1``,
``key == 1``) are fused into one closure each.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from bestman_bt.engine.blackboard import Blackboard, Slot
from bestman_bt.engine.conversion import type_name
from bestman_bt.engine.errors import BlackboardError, ConversionError, ScriptError
from bestman_bt.engine.scripting import operations
from bestman_bt.engine.scripting.parser import (
    Assignment,
    Binary,
    Comparison,
    Constant,
    Expression,
    Name,
    Ternary,
    Unary,
    parse_script,
)

Closure = Callable[[], Any]


class ScriptCompiler:
    """Compiles scripts; parses each text only once, even if many nodes use it."""

    def __init__(self, enums: Mapping[str, int] | None = None) -> None:
        self.enums: Mapping[str, int] = enums or {}
        self._parsed: dict[str, list[Expression]] = {}

    def parse(self, source: str) -> list[Expression]:
        """Return the statements of ``source``.

        Raises:
            ScriptError: it does not follow the grammar.
        """
        parsed = self._parsed.get(source)
        if parsed is None:
            parsed = self._parsed[source] = parse_script(source)
        return parsed

    def forget(self) -> None:
        """Discard the parsed scripts, once a tree is compiled."""
        self._parsed.clear()

    def compile(self, source: str, board: Blackboard) -> Closure:
        """Return a function that runs ``source`` on ``board`` and returns its last value."""
        closures = [self._expression(statement, board) for statement in self.parse(source)]
        if len(closures) == 1:
            return closures[0]
        *first, last = closures

        def run() -> Any:
            for closure in first:
                closure()
            return last()

        return run

    def compile_condition(self, source: str, board: Blackboard) -> Callable[[], bool]:
        """Return a function that runs ``source`` on ``board`` and returns whether its last value is true."""
        statements = self.parse(source)
        if len(statements) == 1:
            condition = self._condition(statements[0], board)
            if condition is not None:
                return condition
        run = self.compile(source, board)
        return lambda: operations.truth(run())

    def _condition(self, expression: Expression, board: Blackboard) -> Callable[[], bool] | None:
        """Return comparisons joined by ``&&`` and ``||`` as one function, or None for anything else."""
        if isinstance(expression, Comparison):
            return self._comparison(expression, board)
        if isinstance(expression, Binary) and expression.operator in ("&&", "||"):
            left = self._condition(expression.left, board)
            right = self._condition(expression.right, board)
            if left is not None and right is not None:
                return _both(left, right) if expression.operator == "&&" else _either(left, right)
        return None

    def _expression(self, expression: Expression, board: Blackboard) -> Closure:
        if isinstance(expression, Constant):
            value = expression.value
            return lambda: value
        if isinstance(expression, Name):
            return self._name(expression, board)
        if isinstance(expression, Assignment):
            return self._assignment(expression, board)
        if isinstance(expression, Binary):
            return self._binary(expression, board)
        if isinstance(expression, Comparison):
            holds = self._comparison(expression, board)
            return lambda: 1.0 if holds() else 0.0
        if isinstance(expression, Unary):
            operand = self._expression(expression.operand, board)
            apply = operations.UNARY[expression.operator]
            return lambda: apply(operand())
        return self._ternary(expression, board)

    def _ternary(self, expression: Ternary, board: Blackboard) -> Closure:
        condition = self._expression(expression.condition, board)
        then = self._expression(expression.then, board)
        otherwise = self._expression(expression.otherwise, board)
        return lambda: then() if operations.ternary_truth(condition()) else otherwise()

    def _constant(self, expression: Expression) -> float | None:
        """Return the number that an expression always has, else None."""
        if isinstance(expression, Constant) and not isinstance(expression.value, str):
            return float(expression.value)
        if isinstance(expression, Name) and expression.name in self.enums:
            return float(self.enums[expression.name])
        if isinstance(expression, Unary) and expression.operator == "-":
            inner = self._constant(expression.operand)
            return None if inner is None else -inner
        return None

    def _variable(self, expression: Expression, board: Blackboard) -> Slot | None:
        if isinstance(expression, Name) and expression.name not in self.enums:
            return board.slot(expression.name)
        return None

    def _name(self, expression: Name, board: Blackboard) -> Closure:
        if expression.name in self.enums:
            value = float(self.enums[expression.name])
            return lambda: value
        slot = board.slot(expression.name)

        def read() -> Any:
            found = slot.value
            if found is None and not slot.exists:
                raise ScriptError(f"variable not found: {slot.key}")
            return found

        return read

    def _binary(self, expression: Binary, board: Blackboard) -> Closure:
        slot = self._variable(expression.left, board)
        constant = self._constant(expression.right)
        right = self._expression(expression.right, board)
        apply = operations.BINARY[expression.operator]
        if slot is not None and constant is not None and expression.operator in "+-*":
            return _variable_and_constant(slot, expression.operator, constant)
        left = self._expression(expression.left, board)
        return lambda: apply(left(), right())

    def _comparison(self, expression: Comparison, board: Blackboard) -> Callable[[], bool]:
        enums = self.enums
        if len(expression.operators) == 1:
            compare = operations.COMPARE[expression.operators[0]]
            slot = self._variable(expression.operands[0], board)
            constant = self._constant(expression.operands[1])
            if slot is not None and constant is not None:
                return _compare_with_constant(slot, expression.operators[0], constant, enums)
            left, right = (self._expression(operand, board) for operand in expression.operands)

            def holds() -> bool:
                a, b = operations.comparable(left(), right(), enums)
                return compare(a, b)

            return holds
        compares = [operations.COMPARE[operator] for operator in expression.operators]
        first, *others = (self._expression(operand, board) for operand in expression.operands)

        def chain() -> bool:
            previous = first()
            for compare, other in zip(compares, others, strict=True):
                value = other()
                a, b = operations.comparable(previous, value, enums)
                if not compare(a, b):
                    return False
                previous = value
            return True

        return chain

    def _assignment(self, expression: Assignment, board: Blackboard) -> Closure:
        if not expression.name:
            return _no_key
        slot = board.slot(expression.name)
        value = self._expression(expression.value, board)
        operator = expression.operator
        if operator in (":=", "="):
            create = operator == ":=" and board.slot_to_write(expression.name) is slot
            return _assign(slot, value, self.enums, create=create)
        apply = operations.BINARY[operator[0]]

        def update() -> Any:
            if not slot.exists:
                raise _missing(slot)
            right = value()
            left = slot.value
            if left is None or right is None:
                side = "left" if left is None else "right"
                raise ScriptError(f"the {side} operand of the operator [{operator}] is not initialized")
            if isinstance(right, str) and operator != "+=":
                raise ScriptError(f"operator [{operator}] is not supported for strings")
            result = _fitted(apply(left, right), left, slot, self.enums)
            slot.write(result)
            return result

        return update


def _both(left: Callable[[], bool], right: Callable[[], bool]) -> Callable[[], bool]:
    def both() -> bool:
        first = left()
        return right() and first  # both sides are always evaluated

    return both


def _either(left: Callable[[], bool], right: Callable[[], bool]) -> Callable[[], bool]:
    def either() -> bool:
        first = left()
        return right() or first

    return either


def _variable_and_constant(slot: Slot, operator: str, constant: float) -> Closure:
    """Return the closure of ``key + 2`` and the like."""
    apply = operations.BINARY[operator]

    def plus() -> Any:
        value = slot.value
        kind = value.__class__
        return value + constant if kind is float or kind is int else general()

    def minus() -> Any:
        value = slot.value
        kind = value.__class__
        return value - constant if kind is float or kind is int else general()

    def times() -> Any:
        value = slot.value
        kind = value.__class__
        return value * constant if kind is float or kind is int else general()

    def general() -> Any:
        if not slot.exists:
            raise ScriptError(f"variable not found: {slot.key}")
        return apply(slot.value, constant)

    return {"+": plus, "-": minus, "*": times}[operator]


def _compare_with_constant(slot: Slot, operator: str, constant: float, enums: Mapping[str, int]) -> Callable[[], bool]:
    """Return the closure of ``key == 2`` and the like."""
    compare = operations.COMPARE[operator]
    low, high = constant - operations.EPSILON, constant + operations.EPSILON

    def equal() -> bool:
        value = slot.value
        kind = value.__class__
        return low <= value <= high if kind is float or kind is int else general()

    def less() -> bool:
        value = slot.value
        kind = value.__class__
        return not value >= constant if kind is float or kind is int else general()

    def greater() -> bool:
        value = slot.value
        kind = value.__class__
        return not value <= constant if kind is float or kind is int else general()

    def other() -> bool:
        value = slot.value
        kind = value.__class__
        return compare(value, constant) if kind is float or kind is int else general()

    def general() -> bool:
        value = slot.value
        if value is None:
            if slot.exists:
                raise ScriptError(f"the entry '{slot.key}' has no value yet")
            raise ScriptError(f"variable not found: {slot.key}")
        a, b = operations.comparable(value, constant, enums)
        return compare(a, b)

    return {"==": equal, "<": less, ">": greater}.get(operator, other)


def _no_key() -> Any:
    raise ScriptError("only a blackboard key can be assigned to")


def _missing(slot: Slot) -> ScriptError:
    return ScriptError(f"the entry '{slot.key}' does not exist yet; ':=' creates it, '=' does not")


def _assign(slot: Slot, value: Closure, enums: Mapping[str, int], *, create: bool) -> Closure:
    store = slot.store
    mirror = store.mirror
    path = slot.path

    def assign() -> Any:
        if not slot.exists:
            if not create:
                raise _missing(slot)
            slot.exists = True
        new = value()
        old = slot.value
        kind = new.__class__
        if kind is not old.__class__ or (kind is not float and kind is not str and kind is not int):
            if kind is float and old.__class__ is int and new.is_integer():
                new = int(new)
            else:
                new = _fitted(new, old, slot, enums)
        slot.value = new
        slot.sequence += 1
        slot.stamp = store.now
        mirror[path] = new
        if slot.watchers or store.observed:
            slot.notify(old)
        return new

    return assign


def _fitted(new: Any, old: Any, slot: Slot, enums: Mapping[str, int]) -> Any:
    """Return a script's value as the slot stores it: numbers keep the number type that is there."""
    if new is None:
        raise ScriptError(f"the value assigned to '{slot.key}' is not initialized")
    if isinstance(new, str) and not isinstance(old, str):
        return _from_text(new, old, slot, enums)
    if old is None or isinstance(new, str):
        return new
    if isinstance(old, (int, float)) and isinstance(new, (int, float)):
        if isinstance(old, float):
            return float(new)
        if new != new or new in (float("inf"), float("-inf")) or new != int(new):
            raise ScriptError(f"entry '{slot.key}' holds an int and cannot take {new}")
        return bool(new) if isinstance(old, bool) and new in (0, 1) else int(new)
    if isinstance(new, type(old)):
        return new
    raise ScriptError(
        f"entry '{slot.key}' holds a {type(old).__name__}; a {type(new).__name__} can't be converted to it"
    )


def _from_text(text: str, old: Any, slot: Slot, enums: Mapping[str, int]) -> Any:
    if slot.kind is not None:
        converter = slot.store.converters.converter(slot.kind)
        if converter is not None:
            try:
                return converter(text)
            except (ConversionError, BlackboardError) as error:
                raise ScriptError(f"entry '{slot.key}' is locked to {type_name(slot.kind)}: {error}") from error
    if old is None:
        return text
    if isinstance(old, (int, float)):
        return operations.number_of_text(text, enums)
    raise ScriptError(f"the string '{text}' can't be converted to a {type(old).__name__} ('{slot.key}')")
