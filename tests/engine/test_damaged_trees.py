"""Damaged tree files: an error for users, or a tree; never anything else."""

from __future__ import annotations

from pathlib import Path

import pytest

from benchmarks.foreign_trees import run
from bestman_bt.configuration.data import shipped_trees
from bestman_bt.engine.models.foreign import open_tree
from bestman_bt.engine.validation import validate_file


@pytest.mark.slow
def test_damaged_files_do_not_crash_what_checks_draws_and_simulates(tmp_path: Path) -> None:
    files = [file for folder in shipped_trees() for file in sorted(folder.rglob("*.xml"))]
    assert run(files, 300, 0, tmp_path) == []


def test_a_tree_within_a_tree_is_reported(tmp_path: Path) -> None:
    path = tmp_path / "t.xml"
    path.write_text(
        '<root BTCPP_format="4"><BehaviorTree ID="A"><Sequence><BehaviorTree ID="B"/></Sequence></BehaviorTree></root>'
    )
    assert "<BehaviorTree>: it is not a node" in str(validate_file(path)[0])
    assert open_tree(path, faults=[]).tree_id == "A"
