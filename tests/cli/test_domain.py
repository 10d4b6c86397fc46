"""bestman-bt domain: what can be ordered and said, in words, as JSON, and as PDDL that others read."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from bestman_bt.task_planning.symbolic.fast_downward import unified_planning
from bestman_bt.task_planning.symbolic.pddl_reading import read_pddl
from bestman_bt.task_planning.symbolic.search import SymbolicPlanner
from tests.cli.command_line import Answer

Command = Callable[..., Answer]
TASK = ("--task", "fetch_from_drawer")
GOAL = "on(cup, table) and closed(drawer_3)"


def test_abilities_predicates_things_and_beliefs_are_reported(bestman_bt: Command) -> None:
    answer = bestman_bt("domain", *TASK)
    assert answer.code == 0, answer.err
    for line in (
        "  OpenContainer(container: container): open a door or drawer far enough to work behind it",
        "  on(object, place): the {object} is on (or in) the {place}",
        "  hand_empty",
    ):
        assert line in answer.out.splitlines()


def test_without_a_scene_only_the_domain_is_listed(bestman_bt: Command) -> None:
    alone, in_a_scene = bestman_bt("domain").out, bestman_bt("domain", "--scene", "kitchen_furnished").out
    head, _, hint = alone.rpartition("\n\n")
    assert in_a_scene.startswith(head)
    assert "\nBelieved\n" in in_a_scene
    assert "\nThings\n" not in alone
    assert "--scene, --task or --world" in hint


def test_the_document_has_what_was_reported(bestman_bt: Command) -> None:
    document = bestman_bt("domain", *TASK, "--goal", GOAL, "--json").document
    assert document["goal"] == ["on(cup, table/top)", "closed(drawer_chest/drawer_3)"]
    assert document["objects"]["drawer_chest/drawer_3"] == "drawer"
    (search,) = [ability for ability in document["abilities"] if ability["name"] == "Search"]
    assert search["parameters"] == {"object": "object", "place": "place"}
    assert "located({object})" in search["effects"]


def test_its_pddl_is_read_by_unified_planning_and_by_ours_and_planned_with(bestman_bt: Command, folder: Path) -> None:
    answer = bestman_bt("domain", "--pddl", *TASK, "--goal", GOAL, "-o", "pddl")
    assert answer.code == 0, answer.err
    files = folder / "pddl" / "domain.pddl", folder / "pddl" / "problem.pddl"
    document = bestman_bt("domain", *TASK, "--json").document
    theirs = unified_planning().io.PDDLReader().parse_problem(*map(str, files))
    assert len(theirs.actions) == len(document["abilities"])
    assert len(theirs.goals[0].args) == 2
    plan = SymbolicPlanner().plan(read_pddl(*files))
    assert [action.name for action in plan.actions] == [
        "opencontainer", "search", "pickup", "putat", "closecontainer",
    ]  # fmt: skip


def test_without_a_folder_both_files_are_printed(bestman_bt: Command, folder: Path) -> None:
    answer = bestman_bt("domain", "--pddl", *TASK)
    assert answer.code == 0, answer.err
    assert answer.out.count("(define ") == 2
    assert list(folder.glob("*.pddl")) == []
    assert "the goal is empty: facts come from --goal" in answer.err
    assert "goal is empty" not in bestman_bt("domain", "--pddl", *TASK, "--goal", GOAL).err


def test_a_folder_is_for_pddl_only(bestman_bt: Command) -> None:
    answer = bestman_bt("domain", *TASK, "-o", "pddl")
    assert answer.code == 2
    assert "-o: is for --pddl" in answer.err
