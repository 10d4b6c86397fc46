"""Twice as many nodes take twice as many calls: no check of a tree and no listing of it is quadratic."""

from __future__ import annotations

import gc
import sys
from collections.abc import Callable
from typing import Any

import pytest

from bestman_bt.engine import Tree, load_tree, render_ports
from bestman_bt.engine.validation import tree_warnings

ROOT = '<root BTCPP_format="4" main_tree_to_execute="Main"><BehaviorTree ID="Main"><Sequence>'
SUBTREE = '</Sequence></BehaviorTree><BehaviorTree ID="Sub"><Script code="a := 1"/></BehaviorTree></root>'


def scripts(count: int) -> str:
    return ROOT + "".join(f'<Script code="w{i} := r{i}x"/>' for i in range(count)) + SUBTREE


def subtrees(count: int) -> str:
    return ROOT + "".join(f'<SubTree ID="Sub" a="{{b{i}}}" c="{i}"/>' for i in range(count)) + SUBTREE


def calls(work: Callable[[Tree], Any], tree: Tree) -> int:
    """Of functions, Python's and C's."""
    count = 0

    def note(frame: object, event: str, argument: object) -> None:
        nonlocal count
        count += event in ("call", "c_call")

    gc.disable()  # what it calls back is not ours
    sys.setprofile(note)
    try:
        work(tree)
    finally:
        sys.setprofile(None)
        gc.enable()
    return count


@pytest.mark.parametrize("work", [render_ports, tree_warnings])
@pytest.mark.parametrize("make", [scripts, subtrees])
def test_twice_as_many_nodes_take_twice_as_many_calls(work: Callable[[Tree], Any], make: Callable[[int], str]) -> None:
    once, twice = (calls(work, load_tree(make(count))) for count in (120, 240))
    assert twice < 2.3 * once
