"""The examples in docs/engine work, and the catalogue is complete."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from bestman_bt.engine import NodeRegistry, load_tree

DOCS = Path(__file__).resolve().parents[2] / "docs" / "engine"
CATALOGUE = (DOCS / "catalogue.md").read_text()
EXAMPLES = re.findall(r"```xml\n(.*?)```", CATALOGUE, re.DOTALL)


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda text: text[1:25])
def test_each_example_of_the_catalogue_loads(example: str) -> None:
    pick = '<BehaviorTree ID="Pick"><AlwaysSuccess/></BehaviorTree>'
    text = f'<root BTCPP_format="4" main_tree_to_execute="M"><BehaviorTree ID="M">{example}</BehaviorTree>{pick}</root>'
    assert load_tree(text).nodes


def test_the_catalogue_has_every_built_in_node_with_its_ports() -> None:
    sections = dict(re.findall(r"^### (\S+)[^\n]*\n(.*?)(?=^##|\Z)", CATALOGUE, re.DOTALL | re.MULTILINE))
    for info in NodeRegistry():
        name = "Switch2" if info.name.startswith("Switch") else info.name
        assert f"<{name}" in sections[name], name
        if name != "Switch2":
            assert all(f"| `{port}` |" in sections[name] for port in info.ports), name


def test_the_catalogue_describes_each_node_by_its_docstring() -> None:
    sections = dict(re.findall(r"^### (\S+)[^\n]*\n(.*?)(?=^[|#]|^```)", CATALOGUE, re.DOTALL | re.MULTILINE))
    described = {info.name: info.cls.__doc__ or "" for info in NodeRegistry() if not info.name.startswith("Switch")}
    assert [name for name, text in described.items() if sections[name].split() != text.split()] == []


def test_the_first_example_of_the_engine_page_runs() -> None:
    code = re.search(r"```python\n(.*?)```", (DOCS / "index.md").read_text(), re.DOTALL)
    assert code is not None
    names: dict = {}
    exec(compile(code.group(1), "index.md", "exec"), names)
    assert names["tree"].blackboard["said"] == "hello cup"
