"""Trees that are written twice, in XML and in Python: node by node the same, with the same ports."""

from __future__ import annotations

import pytest

from bestman_bt.configuration.run import load_run
from bestman_bt.engine import Node, Tree
from bestman_bt.runtime.resolved_config import load_for, prepare


def told(tree: Tree) -> list[tuple[str, str, dict[str, str]]]:
    """Class, path and ports of each node; numbers compare as numbers."""
    return [
        (type(node).__name__, node.path, {key: _plain(value) for key, value in _ports(node)}) for node in tree.nodes
    ]


def _ports(node: Node) -> list[tuple[str, object]]:
    return [(key, value) for key, value in sorted(node.attributes.items()) if key not in ("ID", "name")]


def _plain(value: object) -> str:
    try:
        return str(float(str(value)))
    except ValueError:
        return str(value)


@pytest.mark.parametrize("name", ["fetch_cup", "pick_place_table", "tidy_table"])
def test_the_tree_in_python_is_the_tree_in_xml(name: str) -> None:
    setup = prepare(load_run(name, seed=1))
    xml, python = told(load_for(setup, name)), told(load_for(setup, f"{name}_python"))
    assert len(xml) > 25
    assert python == xml
