"""Which failure codes the source of a leaf can give: those of its methods and of what they call, by its syntax."""

from __future__ import annotations

import ast
import inspect
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from types import FunctionType

RAISES = {"SkillFailure": 0, "explain": 0}
"""What is called with a code as its first argument."""


def raised_codes(leaf: type) -> set[str]:
    """The codes that are literals; those of enumerations, of controllers and planners, are not among them."""
    return {code for function in _reached(leaf) for code in _codes(function)}


def _reached(leaf: type) -> set[FunctionType]:
    """Its methods and the functions of ``behaviours`` that they name, and so on."""
    found: set[FunctionType] = set()
    waiting = [member for name in dir(leaf) for member in _functions(inspect.getattr_static(leaf, name))]
    while waiting:
        function = waiting.pop()
        if function in found or not _is_ours(function.__module__):
            continue
        found.add(function)
        waiting += _named(function)
    return found


def _is_ours(module: str) -> bool:
    return module.startswith(("behaviours", "bestman_bt.task_planning")) and module != "behaviours.skill"


def _functions(member: object) -> Iterator[FunctionType]:
    """The function that a member is, or wraps; those of a class of ours that is no leaf of its own."""
    member = inspect.unwrap(getattr(member, "__func__", getattr(member, "fget", None) or member))  # type: ignore[arg-type]  # a member may be anything
    if isinstance(member, FunctionType):
        yield member
    elif isinstance(member, type) and _is_ours(member.__module__) and not hasattr(member, "FAILS"):
        for part in vars(member).values():
            yield from _functions(part)


def _resolved(function: FunctionType, name: str) -> object:
    """What a name means in a function: of its module, or imported within it."""
    if name in function.__globals__:
        return function.__globals__[name]
    for node in ast.walk(_syntax(function)):
        if isinstance(node, ast.ImportFrom) and node.module and _is_ours(node.module):
            for alias in node.names:
                if (alias.asname or alias.name) == name:
                    __import__(node.module)
                    return getattr(sys.modules[node.module], alias.name)
    return None


@cache
def _named(function: FunctionType) -> tuple[FunctionType, ...]:
    names = {node.id for node in ast.walk(_syntax(function)) if isinstance(node, ast.Name)}
    return tuple(named for name in names for named in _functions(_resolved(function, name)))


@cache
def _codes(function: FunctionType) -> frozenset[str]:
    """Literals that are raised, told, or (of a ``check``) returned with words; also where one of two is chosen."""
    return frozenset(_literals_told(function))


def _literals_told(function: FunctionType) -> Iterator[str]:
    for node in ast.walk(_syntax(function)):
        if isinstance(node, ast.Call):
            called = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
            if called in RAISES and node.args:
                yield from _literals(node.args[0])
        elif _optional_answer(function) and isinstance(node, ast.Return) and isinstance(node.value, ast.Tuple):
            yield from _literals(node.value.elts[0])


def _optional_answer(function: FunctionType) -> bool:
    return function.__annotations__.get("return") == "tuple[str, str] | None"


def _literals(node: ast.expr) -> Iterator[str]:
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        yield node.value
    elif isinstance(node, ast.IfExp):
        yield from _literals(node.body)
        yield from _literals(node.orelse)


@cache
def _tree(module: str) -> dict[int, ast.AST]:
    source = Path(inspect.getfile(sys.modules[module])).read_text(encoding="utf-8")
    kinds = (ast.FunctionDef, ast.AsyncFunctionDef)
    return {
        min([node.lineno, *(one.lineno for one in node.decorator_list)]): node
        for node in ast.walk(ast.parse(source))
        if isinstance(node, kinds)
    }


def _syntax(function: FunctionType) -> ast.AST:
    made = ast.Module([], [])  # of a generated function, as a dataclass has it
    return _tree(function.__module__).get(function.__code__.co_firstlineno, made)
