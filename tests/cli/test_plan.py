"""bestman-bt plan: goals as facts in, a checked tree out; what is wrong is told with its remedy."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree

from bestman_bt.engine import load_tree
from bestman_bt.runtime.plugins import node_registry
from tests.cli.command_line import Answer

Command = Callable[..., Answer]
GOAL = "on(cup, counter)"
KNOWN = "on(cup, table/top)\nlocated(cup)\n" + "".join(
    f"not unseen(cup, {place})  # seen on the table\n" for place in ("table/top", "counter/top")
)


def test_a_plan_is_printed_and_its_tree_is_written(bestman_bt: Command, folder: Path) -> None:
    (folder / "known.txt").write_text(KNOWN)
    answer = bestman_bt("plan", "--goal", GOAL, "--world", "known.txt", "-o", "tree.xml", "--svg", "tree.svg")
    assert answer.code == 0, answer.err
    assert answer.out.split("\n")[-3:] == ["  1. PickUp(cup, table/top)", "  2. PutAt(cup, counter/top)", ""]
    assert load_tree(folder / "tree.xml", node_registry()).root.name == "attempts"
    assert "PickUp '1_PickUp'" in "".join(ElementTree.parse(folder / "tree.svg").getroot().itertext())


def test_what_was_not_seen_is_searched_for_first(bestman_bt: Command) -> None:
    answer = bestman_bt("plan", "--goal", GOAL, "--builder", "sequence", "--json")
    assert answer.code == 0, answer.err
    assert answer.document["plan"][0]["ability"] == "Search"
    assert answer.document["goal"] == ["on(cup, counter/top)"]


def test_a_goal_that_holds_needs_no_actions(bestman_bt: Command) -> None:
    answer = bestman_bt("plan", "--goal", "hand_empty")
    assert (answer.code, "nothing to do" in answer.out) == (0, True)


def test_without_a_plan_it_says_what_is_missing(bestman_bt: Command, folder: Path) -> None:
    (folder / "hand.txt").write_text("not hand_empty\n")
    answer = bestman_bt("plan", "--goal", GOAL, "--world", "hand.txt")
    assert answer.code == 1
    assert answer.err.count("no plan: ") == 1
    assert "needs hand_empty" in answer.err


def test_unknown_names_are_told_with_the_closest(bestman_bt: Command) -> None:
    for goal, words in (
        ("on(cupp, counter)", "unknown object 'cupp'; did you mean 'cup'?"),
        ("onn(cup, counter)", "unknown predicate 'onn'; did you mean 'on'?"),
        ("on(cup counter)", "column 8"),
        (f"{GOAL} and not {GOAL}", "contradicts itself"),
    ):
        answer = bestman_bt("plan", "--goal", goal)
        assert (answer.code, words in answer.err) == (2, True), answer.err


def test_unknown_planners_builders_and_missing_goals_are_refused(bestman_bt: Command) -> None:
    for arguments, words in (
        (("--goal", GOAL, "--planner", "symbolik"), "unknown task planner 'symbolik'; did you mean 'symbolic'?"),
        (("--goal", GOAL, "--builder", "reactiv"), "unknown tree builder 'reactiv'; did you mean 'reactive'?"),
        ((), "give a text or --goal, one of them"),
        (("--goal", GOAL, "--run", "--world", "x.txt"), "--run has its own beliefs"),
    ):
        answer = bestman_bt("plan", *arguments)
        assert (answer.code, words in answer.err) == (2, True), answer.err


def test_a_line_of_a_world_that_is_no_fact_is_named(bestman_bt: Command, folder: Path) -> None:
    (folder / "world.txt").write_text("hand_empty\non(cup,,\n")
    answer = bestman_bt("plan", "--goal", GOAL, "--world", "world.txt")
    assert answer.code == 2
    assert "world.txt:2" in answer.err
