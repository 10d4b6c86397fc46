"""The small verbs: show, nodes, validate, version, and the help."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree

import pytest

from bestman_bt.cli.main import VERBS
from bestman_bt.engine import ManualClock, load_tree
from bestman_bt.registry import BEHAVIOURS
from bestman_bt.runtime.breakpoints import BreakpointError, Breakpoints
from bestman_bt.runtime.executor import Executor
from tests.cli.command_line import Answer

Command = Callable[..., Answer]


def test_the_help_lists_every_verb(bestman_bt: Command) -> None:
    answer = bestman_bt("--help")
    assert answer.code == 0
    for verb, what in VERBS.items():
        assert f"{verb} " in answer.out
        assert what.split(",")[0] in answer.out


def test_show_prints_the_tree_with_its_subtrees(bestman_bt: Command) -> None:
    answer = bestman_bt("show", "fetch_cup")
    assert answer.code == 0
    assert "SubTree Pick 'pick'" in answer.out
    assert "NavigateTo  goal={stand}" in answer.out


def test_show_prints_the_paths_that_breakpoints_take_and_numbers_where_several_share_one(
    bestman_bt: Command, folder: Path
) -> None:
    leaves = '<AlwaysSuccess name="again"/><AlwaysSuccess name="again"/><AlwaysSuccess/>'
    text = f'<root BTCPP_format="4"><BehaviorTree ID="Main"><Sequence name="all">{leaves}</Sequence></BehaviorTree>'
    (folder / "t.xml").write_text(f"{text}</root>")
    shared = "again  (by number alone: several have this path)"
    told = [line.strip() for line in bestman_bt("show", "t.xml", "--paths").out.splitlines()]
    assert told == ["1  all", f"2  {shared}", f"3  {shared}", "4  AlwaysSuccess::4"]
    breakpoints = Breakpoints(Executor(load_tree(folder / "t.xml"), ManualClock()), lambda: None)
    with pytest.raises(BreakpointError, match="2 nodes have the path 'again'; name one by its number: 2 or 3"):
        breakpoints.add("again", "before")
    breakpoints.add("AlwaysSuccess::4", "before")


def test_show_writes_a_picture(bestman_bt: Command, folder: Path) -> None:
    assert bestman_bt("show", "fetch_cup", "--svg", "tree.svg").code == 0
    assert "NavigateTo" in "".join(ElementTree.parse(folder / "tree.svg").getroot().itertext())


def test_nodes_lists_the_library_with_ports(bestman_bt: Command) -> None:
    answer = bestman_bt("nodes")
    assert answer.code == 0
    for name in BEHAVIOURS:
        assert f"\n  {name}: " in answer.out
    assert "goal (input, Pose2D, required): x;y;theta in the map frame, metres and radians" in answer.out
    assert "\n  ReactiveSequence: " in answer.out


def test_nodes_reports_how_a_skill_fails_and_what_to_try_then(bestman_bt: Command) -> None:
    answer = bestman_bt("nodes", "PlanGrasp")
    assert "arm (input, str, default ''): which arm" in answer.out
    assert "fails as no_grasp: stand elsewhere: FindStandPose, NavigateTo" in answer.out
    assert "fails as stopped" not in answer.out, "every skill may"


def test_nodes_of_one_name_lists_that_node_alone(bestman_bt: Command) -> None:
    answer = bestman_bt("nodes", "NavigateTo")
    assert "NavigateTo" in answer.out
    assert "LookAt" not in answer.out
    assert "\n      in Python: from behaviours.navigation.navigate import NavigateTo\n" in answer.out


def test_nodes_tells_of_a_shipped_subtree_what_it_takes_and_its_file(bestman_bt: Command) -> None:
    answer = bestman_bt("nodes", "PickAndPlace", "NavigateTo")
    assert "  NavigateTo: " in answer.out
    told = answer.out.partition("SubTrees that are shipped")[2]
    assert "trees/subtrees/pick_and_place.xml:" in told
    assert '<include path="subtrees/pick_and_place.xml"/>' in told
    assert "object (input, required)\n      arm (input)\n" in told
    assert "writes stand, stand_error" in bestman_bt("nodes", "GoTo").out
    misspelt = bestman_bt("nodes", "PickAndPlac")
    assert misspelt.code == 2
    assert misspelt.err == "bestman-bt: unknown node 'PickAndPlac'; did you mean 'PickAndPlace'?\n"


def test_validate_accepts_what_is_shipped(bestman_bt: Command) -> None:
    answer = bestman_bt("validate", "fetch_cup", "fetch_cup_python")
    assert (answer.code, answer.err) == (0, "")
    assert answer.out.count(": ok") == 2


def test_validate_reports_all_faults_of_all_files_and_goes_on(bestman_bt: Command, folder: Path) -> None:
    faulty = '<root BTCPP_format="4"><BehaviorTree ID="Main">\n<NavigateToo/></BehaviorTree></root>'
    (folder / "a.xml").write_text(faulty)
    (folder / "b.xml").write_text("no tree")
    answer = bestman_bt("validate", "a.xml", "b.xml", "c.xml", "fetch_cup")
    assert answer.code == 2
    told = answer.err.splitlines()
    assert [line.split(":")[0] for line in told] == ["a.xml", "b.xml", "c.xml"]
    assert "fetch_cup.xml: ok" in answer.out


def test_version_names_what_decides_a_run(bestman_bt: Command) -> None:
    answer = bestman_bt("version")
    assert answer.code == 0
    assert {"python", "bestman-bt", "pybullet", "numpy", "ompl"} <= {
        line.split()[0] for line in answer.out.splitlines()
    }
