"""The notebook of the documentation runs, and shows what its cells end with."""

from __future__ import annotations

import ast
import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from behaviours.failure import NodeFailure
from bestman_bt.engine import simulate
from bestman_bt.evaluation.result import Outcome, RunResult

NOTEBOOK = Path(__file__).resolve().parents[2] / "docs" / "notebook.ipynb"


def shown(code: str, names: dict[str, Any]) -> str:
    """Run a cell as Jupyter does; returns what it shows for the last expression."""
    tree = ast.parse(code)
    last = tree.body.pop()
    assert isinstance(last, ast.Expr)
    exec(compile(tree, "cell", "exec"), names)
    html: str = eval(compile(ast.Expression(last.value), "cell", "eval"), names)._repr_html_()
    return html


@pytest.mark.slow
def test_each_cell_of_the_notebook_runs_and_shows_a_tree_or_a_result() -> None:
    cells = json.loads(NOTEBOOK.read_text(encoding="utf-8"))["cells"]
    names: dict[str, Any] = {}
    tree, run, result = [shown("".join(cell["source"]), names) for cell in cells if cell["cell_type"] == "code"]
    assert "NavigateTo" in tree
    assert run.startswith("<p>success after 4.")
    assert run.count("<svg") == 1
    assert re.findall(r"<tr><th>(\w+)</th><td>([^<]*)", result)[:2] == [
        ("task", "session, seed 3"),
        ("outcome", "success"),
    ]


def test_the_notebook_is_stored_without_outputs() -> None:
    cells = json.loads(NOTEBOOK.read_text(encoding="utf-8"))["cells"]
    assert all(not cell.get("outputs") for cell in cells)


def test_texts_of_a_run_are_escaped_in_the_page() -> None:
    failure = NodeFailure("pull", "tree_failed", "it said <b>no</b>")
    run = RunResult("open", 3, False, Outcome.FAILURE, "FAILURE", None, failure, {}, {"error_mm": 3.14159}, 2.0, 1.0)
    table = run._repr_html_()
    assert "pull: it said &lt;b&gt;no&lt;/b&gt;" in table
    assert "error_mm 3.14" in table
    assert "<th>note</th>" not in table
    simulated = simulate('<root BTCPP_format="4"><BehaviorTree ID="T"><AlwaysSuccess/></BehaviorTree></root>')
    assert replace(simulated, error="<i>")._repr_html_().startswith("<p>error after 0.00 s, 1 ticks. &lt;i&gt;</p>")
