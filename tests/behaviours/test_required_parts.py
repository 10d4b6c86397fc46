"""Skills declare the parts that they use: what their code touches is compared with what their classes say."""

from __future__ import annotations

import ast
import inspect
import sys
import textwrap
from collections.abc import Iterator
from functools import cache
from importlib import import_module
from types import FunctionType
from typing import Any, get_args

import pytest

from behaviours.context import SkillContext
from behaviours.parts import PartKind
from behaviours.skill import RobotNode
from bestman_bt.runtime.plugins import node_registry

KINDS = set(get_args(PartKind))
STANDS_FOR: dict[str, set[str]] = {
    "base": {"base", "lidar"},  # a base is driven by what its lidar sees
    "head": {"head", "camera"},  # it turns one
    "wrist_wrench": {"force_torque"},
    "arm_model": {"arm"},
    "arm_positions": {"arm"},
    "arm_world": {"arm"},
    "base_from_tool": {"arm"},
    "planning_scene": {"arm"},
    "gripper_model": {"gripper"},
    "footprint": {"base", "lidar"},
    "known_costmap": {"base", "lidar"},
    "seen_costmap": {"base", "lidar"},
    "kinematics": {"arm"},
    "collision": {"arm"},
    "motion_planning": {"arm"},
}
"""Attribute of a context → the kinds of parts behind it, where it is not called as its kind."""
HOLDERS = {"skills", "_skills", "context"}
SKILLS = [info.cls for info in node_registry([]).manifest() if not info.builtin and issubclass(info.cls, RobotNode)]


def touched(cls: type[Any]) -> set[str]:
    """Kinds of parts that the code of a skill, and what it calls of ours, reads off its context."""
    seen: set[FunctionType] = set()
    found: set[str] = set()
    waiting = list(_methods(cls))
    while waiting:
        function = waiting.pop()
        if function in seen or not _is_written(function):
            continue
        seen.add(function)
        kinds, called = _looked_at(function)
        found |= kinds
        waiting += called
    return found


@cache
def _looked_at(function: FunctionType) -> tuple[set[str], list[FunctionType]]:
    """Kinds of parts that a function reads off a context, and what of ours it calls."""
    found: set[str] = set()
    called: list[FunctionType] = []
    for node in ast.walk(ast.parse(textwrap.dedent(inspect.getsource(function)))):
        if isinstance(node, ast.Attribute) and _name_of(node.value) in HOLDERS:
            found |= STANDS_FOR.get(node.attr, {node.attr} & KINDS)
        elif isinstance(node, ast.Name):
            called += _called(vars(sys.modules[function.__module__]).get(node.id))
        elif isinstance(node, ast.ImportFrom) and node.module and node.level == 0:
            for alias in node.names:
                called += _called(getattr(import_module(node.module), alias.name, None))
    return found, called


def _methods(cls: type[Any]) -> Iterator[FunctionType]:
    for base in cls.__mro__:
        if _is_ours(base):
            for value in vars(base).values():
                function = value.fget if isinstance(value, property) else getattr(value, "__func__", value)
                if isinstance(function, FunctionType):
                    yield function


def _called(value: Any) -> Iterator[FunctionType]:
    if isinstance(value, FunctionType) and _is_ours(value):
        yield value
    elif isinstance(value, type) and _is_ours(value) and not issubclass(value, RobotNode):
        yield from _methods(value)


def _is_ours(value: Any) -> bool:
    """Of the layers that know contexts; contexts themselves stand for what they are made of."""
    module = str(value.__module__)
    return module.startswith(("behaviours.", "bestman_bt.task_planning.")) and value is not SkillContext


def _is_written(function: FunctionType) -> bool:
    """What dataclasses make has no source of its own."""
    return inspect.unwrap(function).__code__.co_filename == getattr(
        sys.modules.get(function.__module__), "__file__", None
    )


def _name_of(node: ast.expr) -> str:
    return node.id if isinstance(node, ast.Name) else node.attr if isinstance(node, ast.Attribute) else ""


@pytest.mark.parametrize("cls", SKILLS, ids=lambda cls: cls.__name__)
def test_a_skill_declares_what_it_uses_and_no_more(cls: Any) -> None:
    assert set(cls.REQUIRES) | set(cls.USES) == touched(cls)
    assert not set(cls.REQUIRES) & set(cls.USES)
