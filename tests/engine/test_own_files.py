"""A user's files find those beside them, and those of another folder never."""

from __future__ import annotations

import importlib
import sys
from pathlib import Path

import pytest

from bestman_bt.engine import SUCCESS, NodeError, TreeLoadError, load_tree
from bestman_bt.engine.own_files import described, importable, load_file

TREE = """
from bestman_bt.engine import Script, Sequence
from helpers import WORD

def build():
    from later import MORE
    return Sequence("{name}", [Script(code=f"word := '{{WORD}}{{MORE}}'")])
"""


def folder(place: Path, name: str, **files: str) -> Path:
    made = place / name
    made.mkdir()
    for stem, text in files.items():
        (made / f"{stem}.py").write_text(text)
    return made


@pytest.fixture
def two(tmp_path: Path) -> list[Path]:
    return [
        folder(tmp_path, name, tree=TREE.format(name=name), helpers=f"WORD = '{name}'", later=f"MORE = '_{name}'")
        for name in ("one", "two")
    ]


def word_of(path: Path) -> str:
    tree = load_tree(path)
    assert tree.tick_exactly_once() == SUCCESS
    return str(tree.blackboard["word"])


@pytest.mark.slow
def test_each_tree_finds_the_helpers_beside_it(two: list[Path]) -> None:
    words = [word_of(place / "tree.py") for place in (*two, *two)]
    assert words == ["one_one", "two_two", "one_one", "two_two"]
    assert not {str(place) for place in two} & set(sys.path)


@pytest.mark.slow
def test_a_tree_does_not_find_the_helpers_of_another_folder(two: list[Path], tmp_path: Path) -> None:
    word_of(two[0] / "tree.py")
    alone = folder(tmp_path, "alone", tree=TREE.format(name="alone"))
    with pytest.raises(TreeLoadError, match="tree.py:3: it fails with ModuleNotFoundError: No module named 'helpers'"):
        load_tree(alone / "tree.py")


@pytest.mark.parametrize(
    ("statement", "told"),
    [
        (
            "from behaviours.grasp import (\n    Grasp,\n    PlanGrasp as Plan,\n)",
            "No module named 'behaviours.grasp'; behaviours.manipulation.grasp has Grasp, PlanGrasp",
        ),
        (
            "from behaviours.names import SurfaceName, Skill",
            "No module named 'behaviours.names'; behaviours.skill has SurfaceName, Skill",
        ),
        (
            "from behaviours.navigate import *",
            "; there is behaviours.nav2.navigate and there is behaviours.navigation.navigate",
        ),
        (
            "import behaviours.articulation",
            "No module named 'behaviours.articulation'; there is behaviours.furniture.articulation",
        ),
        ("from behaviours import push", "; there is behaviours.manipulation.push"),
        (
            "from bestman_bt.engine import Sequence, Log",
            "ImportError: bestman_bt.engine has no 'Log': from behaviours.log import Log",
        ),
        ("from behaviours import Grasp", "behaviours has no 'Grasp': from behaviours.manipulation.grasp import Grasp"),
        ("from bestman_bt import Grasp", "bestman_bt has no 'Grasp': from behaviours.manipulation.grasp import Grasp"),
        (
            "from behaviours.skill import Skill, Steps",
            "behaviours.skill has no 'Steps': from behaviours.skill import SkillCoroutine",
        ),
        ("from bestman_bt.engine import Session", "bestman_bt.engine has no 'Session': from bestman_bt import Session"),
        ("from behaviours.log import Log, Sequence", "; bestman_bt.engine has Sequence"),
        ("from bestman_bt.task_planning import TaskPlanner", "; bestman_bt.task_planning.base has TaskPlanner"),
        ("import behaviours.graspp", "No module named 'behaviours.graspp'"),
    ],
)
def test_a_skill_that_is_imported_from_where_it_is_not_is_reported_with_its_module(
    tmp_path: Path, statement: str, told: str
) -> None:
    (tmp_path / "tree.py").write_text(f"{statement}\n")
    with pytest.raises(TreeLoadError) as raised:
        load_tree(tmp_path / "tree.py")
    (problem,) = raised.value.problems
    assert problem.message.endswith(told)
    assert problem.line == 1


@pytest.mark.parametrize("module", ["bestman_bt", "bestman_bt.engine", "behaviours"])
def test_a_module_that_is_asked_whether_it_has_a_skill_of_another_says_no(module: str) -> None:
    asked = importlib.import_module(module)
    assert not hasattr(asked, "NavigateTo")
    with pytest.raises(AttributeError, match="no attribute 'Grasp': from behaviours.manipulation.grasp import Grasp$"):
        _ = asked.Grasp


@pytest.mark.slow
def test_a_tree_that_loads_a_tree_of_another_folder_keeps_its_own_helpers(two: list[Path]) -> None:
    (two[0] / "tree.py").write_text(
        "from bestman_bt.engine import load_tree\nimport helpers\n"
        "def build():\n"
        f"    inner = load_tree({str(two[1] / 'tree.py')!r})\n"
        "    inner.tick_exactly_once()\n"
        "    import helpers as again, later\n"
        "    from bestman_bt.engine import Script\n"
        "    return Script(code=f\"word := '{inner.blackboard['word']}+{again.WORD}{later.MORE}'\")\n"
    )
    assert word_of(two[0] / "tree.py") == "two_two+one_one"


def test_what_the_program_has_imported_stays(two: list[Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    script = folder(tmp_path, "script", helpers="WORD = 'script'")
    monkeypatch.syspath_prepend(str(script))
    import helpers

    assert word_of(two[0] / "tree.py") == "one_one"
    assert sys.modules["helpers"] is helpers
    assert helpers.WORD == "script"
    del sys.modules["helpers"]


def test_packages_beside_a_tree_can_be_imported_and_installed_ones_are_kept(tmp_path: Path) -> None:
    place = folder(tmp_path, "place", later="MORE = ''")
    (place / "parts").mkdir()
    (place / "parts" / "words.py").write_text("WORD = 'parts'")
    (place / "tree.py").write_text(TREE.format(name="tree").replace("from helpers", "import numpy\nfrom parts.words"))
    import numpy

    assert word_of(place / "tree.py") == "parts"
    assert sys.modules["numpy"] is numpy
    with importable(place), pytest.raises(ImportError):
        __import__("helpers")


@pytest.mark.slow
def test_an_error_in_a_helper_is_reported_with_the_helpers_line(two: list[Path]) -> None:
    (two[0] / "helpers.py").write_text("x = 1\nWORD = 1 / 0\n")
    with pytest.raises(TreeLoadError) as error:
        load_tree(two[0] / "tree.py")
    assert str(error.value) == f"{two[0] / 'helpers.py'}:2: it fails with ZeroDivisionError: division by zero"
    (two[0] / "helpers.py").write_text("x = 1\ndef (:\n")
    with pytest.raises(TreeLoadError, match=r"helpers\.py:2: it fails with SyntaxError: invalid syntax$"):
        load_tree(two[0] / "tree.py")


def test_a_file_that_has_the_name_of_our_package_is_named(two: list[Path]) -> None:
    import behaviours  # noqa: F401

    (two[0] / "behaviours.py").write_text("class Count: ...\n")
    (two[0] / "tree.py").write_text("from behaviours import Count\n")
    with pytest.raises(TreeLoadError, match=r"one/behaviours\.py has the name of a package of bestman-bt: rename it"):
        load_tree(two[0] / "tree.py")


def test_an_error_of_a_trees_own_leaf_is_reported_with_its_line(tmp_path: Path) -> None:
    text = (
        "from bestman_bt.engine import SyncAction\n"
        "class Broken(SyncAction):\n"
        "    def on_tick(self):\n"
        "        return {}['mug']\n"
        "def build():\n"
        "    return Broken()\n"
    )
    place = folder(tmp_path, "place", tree=text)
    with pytest.raises(NodeError, match=rf"KeyError: 'mug' \(at {place}/tree\.py:4\)$"):
        load_tree(place / "tree.py").tick_exactly_once()


def test_an_error_within_a_method_that_a_dataclass_makes_is_reported_at_the_line_that_called_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    file = Path("mine.py")
    file.write_text(
        "from dataclasses import dataclass\n@dataclass(frozen=True)\nclass A:\n    x: int = 1\n\nA().x = 2\n"
    )
    with pytest.raises(AttributeError) as raised:
        load_file(file, "mine_frozen")
    assert described(raised.value, file)[:2] == ("mine.py", 6)
