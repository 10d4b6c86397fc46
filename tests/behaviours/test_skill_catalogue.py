"""docs/skills.md is what scripts/skill_catalogue.py makes of the skills, and its examples load."""

from __future__ import annotations

import importlib.util
import re
from pathlib import Path

import pytest

from bestman_bt.engine import load_tree
from bestman_bt.runtime.plugins import node_registry

CHECKOUT = Path(__file__).resolve().parents[2]
PAGE = (CHECKOUT / "docs" / "skills.md").read_text()


def test_the_page_is_that_of_the_present_skills() -> None:
    specification = importlib.util.spec_from_file_location("skill_catalogue", CHECKOUT / "scripts/skill_catalogue.py")
    assert specification is not None
    assert specification.loader is not None
    script = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(script)
    assert script.page() == PAGE, "run scripts/skill_catalogue.py"
    assert script.errors_page() == script.ERRORS.read_text(), "run scripts/skill_catalogue.py"


@pytest.mark.parametrize("example", re.findall(r"```xml\n(.*?)\n```", PAGE, re.DOTALL), ids=lambda text: text[1:25])
def test_each_example_loads(example: str) -> None:
    text = f'<root BTCPP_format="4" main_tree_to_execute="M"><BehaviorTree ID="M">{example}</BehaviorTree></root>'
    assert load_tree(text, registry=node_registry([])).nodes


def test_each_import_line_imports_its_class() -> None:
    assert "from behaviours.log import Log" in PAGE
    for info in node_registry([]).manifest():
        names: dict[str, object] = {}
        exec(info.import_line, names)
        assert names[info.cls.__name__] is info.cls
        own_page = info.cls.__module__.startswith("behaviours.nav2.")
        assert info.builtin or own_page or f"```python\n{info.import_line}\n" in PAGE
