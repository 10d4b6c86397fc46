"""Each slot for algorithms has properties in this folder."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

from bestman_bt.registry import ALGORITHMS
from bestman_bt.runtime.algorithms import SLOTS


@pytest.fixture(scope="module")
def exercised() -> set[tuple[str, str]]:
    """Module and name of what the tests of this folder use, directly or by way of their file's other definitions."""
    found = set()
    for file in Path(__file__).parent.glob("test_*.py"):
        imported, uses = dict[str, str](), dict[str, set[str]]()
        for node in ast.parse(file.read_text()).body:
            if isinstance(node, ast.ImportFrom):
                imported |= {alias.name: str(node.module) for alias in node.names}
                continue
            names = [one for one in ast.walk(node) if isinstance(one, ast.Name)]
            defined = [one.id for one in names if isinstance(one.ctx, ast.Store)]
            if isinstance(node, ast.FunctionDef | ast.ClassDef):
                defined = [node.name]
            used = {one.id for one in names}
            uses |= {name: used for name in defined}
        left, reached = [name for name in uses if name.startswith("test_")], set[str]()
        while left:
            name = left.pop()
            if name not in reached:
                reached.add(name)
                left += uses.get(name, ())
        found |= {(imported[name], name) for name in reached & imported.keys()}
    return found


@pytest.mark.parametrize("slot", SLOTS)
def test_an_algorithm_of_each_slot_has_properties(slot, exercised):
    found = [one for one, _ in ALGORITHMS.of_kind(SLOTS[slot].kind).values() if issubclass(one, SLOTS[slot].base)]
    assert any((one.__module__, one.__name__) in exercised for one in found)
