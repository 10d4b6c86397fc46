"""bestman-bt plan: goals as facts in, a checked tree out; what is wrong is told with its remedy."""

from __future__ import annotations

import shlex
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from xml.etree import ElementTree

import pytest

from bestman_bt.cli.options import PlanningOptions
from bestman_bt.cli.plan_command import to_run
from bestman_bt.configuration.run import load_run
from bestman_bt.engine import load_tree
from bestman_bt.registry import BUILDERS, PLANNERS, undone
from bestman_bt.runtime.plugins import node_registry
from tests.cli.command_line import Answer

Command = Callable[..., Answer]
GOAL = "on(cup, counter)"
SEEN = """\
scene: kitchen
seed: 3
beliefs:
  objects:
    cup: {what: {model: cup}, surface: table/top, pose: {position: [3.1, -0.2, 80 cm]}}
"""
HOLDING = """\
scene: kitchen
beliefs:
  hands:
    arm: {name: can, what: {model: can}, width: 5 cm, tool_from_object: {position: [0, 0, 2 cm]}}
"""


def test_a_plan_is_printed_and_its_tree_is_written(bestman_bt: Command, folder: Path) -> None:
    (folder / "seen.yaml").write_text(SEEN)
    answer = bestman_bt("plan", "--goal", GOAL, "--world", "seen.yaml", "-o", "tree.xml", "--svg", "tree.svg")
    assert answer.code == 0, answer.err
    assert answer.out.split("\n")[-3:] == ["  1. PickUp(cup, table/top)", "  2. PutAt(cup, counter/top)", ""]
    assert load_tree(folder / "tree.xml", node_registry()).root.name == "attempts"
    assert "PickUp '1_PickUp'" in "".join(ElementTree.parse(folder / "tree.svg").getroot().itertext())


@pytest.mark.slow
def test_by_default_it_is_planned_in_the_furnished_kitchen_and_a_drawer_needs_no_number(
    bestman_bt: Command, folder: Path
) -> None:
    goal = "on(mug, table) and closed(drawer)"
    answer = bestman_bt(
        *("plan", "--goal", goal, "--planner", "symbolic", "--builder", "reactive", "-o", "tree.xml", "--json")
    )
    assert answer.code == 0, answer.err
    assert answer.document["goal"] == ["on(mug, table/top)", "closed(drawer_chest/drawer_1)"]
    assert answer.document["plan"][0] == {"ability": "Search", "object": "mug", "place": "table/top"}
    assert "there are also drawer_chest/drawer_2, drawer_chest/drawer_3" in answer.err
    assert "assumes that it is there" in answer.err
    assert answer.document["assumes"] == ["Search(mug, table/top)"]
    assert "tree.xml plans again (ReachGoal)" in answer.err
    assert "run it: bestman-bt run tree.xml --scene kitchen_furnished --robot diff_panda " in answer.err
    assert "the scene kitchen_furnished, the robot diff_panda and" in (folder / "tree.xml").read_text().split("\n")[0]
    assert load_tree(folder / "tree.xml", node_registry()).root.name == "as_planned_or_anew"


def test_the_command_that_runs_a_saved_plan_tells_no_secret_of_a_controller() -> None:
    settings = ["robot.connections.arm.address=HIDDEN", "robot.connections.arm.token=HIDDEN", "robot.name=my robot"]
    config = load_run("fetch_cup", seed=3, plugins=["my leaves.py"])
    told = to_run(Path("tree.xml"), PlanningOptions("fetch_cup", "kitchen"), config, settings)
    words = ["bestman-bt", "run", "tree.xml", "--task", "fetch_cup", "--scene", "kitchen", "--seed", "3"]
    words += ["--set", "robot.connections.arm.address=…", "--set", "robot.connections.arm.token=…"]
    assert shlex.split(told) == [*words, "--set", "robot.name=my robot", "--plugin", "my leaves.py"]


def test_what_is_given_is_where_a_thing_is_searched_for(bestman_bt: Command) -> None:
    answer = bestman_bt("plan", "--goal", GOAL, "--given", "on(cup, table)", "-o", "tree.xml", "--json")
    assert [step["ability"] for step in answer.document["plan"]] == ["Search", "PickUp", "PutAt"]
    assert answer.document["plan"][0]["place"] == "table/top"
    run = load_run(tree="fetch_cup", scene="kitchen", robot="diff_panda", settings=settings_of(answer.err))
    assert run.task.asked("facts") == {"goal": "on(cup, counter/top)", "given_places": {"cup": "table/top"}}


def test_the_command_that_runs_a_saved_tree_has_all_that_it_was_planned_with(bestman_bt: Command, folder: Path) -> None:
    (folder / "seen.yaml").write_text(SEEN + "scene_settings: {finger_friction: 0.7}\n")
    (folder / "own.py").write_text("from bestman_bt.registry import task_planner as mine\nmine('none')(object)\n")
    options = ("--goal", GOAL, "--world", "seen.yaml", "--plugin", "own.py", "-o", "tree.xml")
    answer = bestman_bt("plan", *options, "--set", "tick_rate=10")
    assert answer.code == 0, answer.err
    goal = ['goals=[{"facts": {"goal": "on(cup, counter/top)"}}]', "predicate=facts"]
    assert settings_of(answer.err) == ["time_limit=1200 s", "scene.finger_friction=0.7", "tick_rate=10", *goal]
    assert "--scene kitchen --robot diff_panda --seed 3 --set" in answer.err
    assert answer.err.strip().endswith(" --plugin own.py")
    answer = bestman_bt("plan", *options, "--set", "time_limit=2 min")
    assert settings_of(answer.err) == ["scene.finger_friction=0.7", "time_limit=2 min", *goal]


def settings_of(printed: str) -> list[str]:
    """The settings of the command that runs a saved tree."""
    words = shlex.split(next(line for line in printed.splitlines() if line.startswith("run it: ")))
    return [setting for option, setting in pairwise(words) if option == "--set"]


def test_what_the_robot_has_seen_elsewhere_cannot_be_given(bestman_bt: Command, folder: Path) -> None:
    (folder / "seen.yaml").write_text(SEEN)
    answer = bestman_bt("plan", "--goal", GOAL, "--world", "seen.yaml", "--given", "on(cup, counter)")
    assert answer.code == 2
    assert "the robot has seen the cup, on table/top" in answer.err


@pytest.mark.slow
def test_a_goal_may_be_the_name_of_a_problem_file(bestman_bt: Command, folder: Path) -> None:
    (folder / "goal.pddl").write_text("(define (problem p) (:domain d) (:goal (and (on cup counter__top))))")
    answer = bestman_bt("plan", "--goal", "goal.pddl", "--json")
    assert answer.code == 0, answer.err
    assert answer.document["goal"] == ["on(cup, counter/top)"]
    (folder / "bad.pddl").write_text("(define (problem p)\n (:goal (or (on cup counter))))")
    answer = bestman_bt("plan", "--goal", "bad.pddl")
    assert (answer.code, "bad.pddl:2: or is not supported in a goal for abilities" in answer.err) == (2, True), (
        answer.err
    )


def test_a_task_with_a_plan_gives_the_goal_and_what_was_reported(bestman_bt: Command) -> None:
    answer = bestman_bt("plan", "--task", "plan_fetch_from_drawer", "--json")
    assert answer.code == 0, answer.err
    assert [step["ability"] for step in answer.document["plan"]] == [
        *("OpenContainer", "Search", "PickUp", "PutAt", "CloseContainer")
    ]


def test_what_was_not_seen_is_searched_for_first(bestman_bt: Command) -> None:
    answer = bestman_bt("plan", "--goal", GOAL, "--builder", "sequence", "--json")
    assert answer.code == 0, answer.err
    assert answer.document["plan"][0]["ability"] == "Search"
    assert answer.document["goal"] == ["on(cup, counter/top)"]


@pytest.mark.slow
def test_a_goal_that_holds_needs_no_actions(bestman_bt: Command) -> None:
    answer = bestman_bt("plan", "--goal", "hand_empty")
    assert (answer.code, "nothing to do" in answer.out) == (0, True)


def test_without_a_plan_it_reports_what_is_missing(bestman_bt: Command, folder: Path) -> None:
    (folder / "holding.yaml").write_text(HOLDING)
    answer = bestman_bt("plan", "--goal", GOAL, "--world", "holding.yaml", "--limits", "only=PickUp", "--json")
    assert answer.code == 1
    assert answer.document["plan"] is None
    assert "on(cup, counter/top)" in answer.document["why"]
    assert answer.err.count("no plan: ") == 1
    assert "on(cup, counter/top)" in answer.err


def test_unknown_names_are_reported_with_the_closest(bestman_bt: Command) -> None:
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
        (("--goal", GOAL, "--planner", "mine.py:Mine"), "load your own planner by --plugin FILE.py"),
        (("--goal", GOAL, "--builder", "reactiv"), "unknown tree builder 'reactiv'; did you mean 'reactive'?"),
        ((), "give a text, --goal, or a --task with the goal facts"),
        (("words", "--goal", GOAL), "give either a text or --goal"),
        (("--goal", GOAL, "--run", "--world", "x.yaml"), "--run has its own beliefs"),
        (("words", "--run"), "after your confirmation, which is impossible here; give --yes"),
    ):
        answer = bestman_bt("plan", *arguments)
        assert (answer.code, words in answer.err) == (2, True), answer.err


def test_all_that_is_wrong_with_the_options_of_a_plan_is_reported_at_once(bestman_bt: Command) -> None:
    wrong = ("--planner", "symbolik", "--builder", "reactiv", "--limits", "stepz=2")
    told = ["--limits: ", "--planner: unknown", "--builder: unknown"]
    for goal, more, words in (
        ("on(cupp, counter)", ("--given", "on(cup, tabel)"), ["--goal: unknown object 'cupp'", "--given: "]),
        ("on(cup", ("--scene", "kichen"), ["--goal: ", "--scene kichen: unknown scene"]),
    ):
        answer = bestman_bt("plan", "--goal", goal, *wrong, *more)
        assert answer.code == 2
        assert answer.err.startswith("bestman-bt: 5 errors")
        assert [one for one in (*told, *words) if one not in answer.err] == []


def test_what_is_wrong_in_a_saved_world_is_reported_with_its_line_all_at_once(
    bestman_bt: Command, folder: Path
) -> None:
    (folder / "world.yaml").write_text(SEEN.replace("model: cup", "model: cupp").replace("table/top", "tabel/top"))
    answer = bestman_bt("plan", "--goal", GOAL, "--world", "world.yaml")
    assert answer.code == 2
    assert "world.yaml:5: beliefs.objects.cup.surface: the scene has no surface 'tabel/top'; did you mean" in answer.err
    assert "world.yaml:5: beliefs.objects.cup.what.model: the scene has no model 'cupp'; did you mean" in answer.err


def test_a_saved_world_says_of_which_scene_it_is(bestman_bt: Command, folder: Path) -> None:
    (folder / "seen.yaml").write_text(SEEN)
    for option in (("--scene", "apartment"), ("--seed", "4"), ("--task", "fetch_cup")):
        answer = bestman_bt("plan", "--goal", GOAL, "--world", "seen.yaml", *option)
        assert answer.code == 2
        assert "is of the scene kitchen with seed 3; leave --task, --scene and --seed out" in answer.err


def test_the_domain_shows_what_a_saved_world_believes(bestman_bt: Command, folder: Path) -> None:
    (folder / "seen.yaml").write_text(SEEN)
    state = bestman_bt("domain", "--world", "seen.yaml", "--json").document["state"]
    assert "on(cup, table/top)" in state
    assert not any(fact.startswith("unseen(cup") for fact in state)


def test_an_empty_goal_is_refused_and_a_slip_in_one_before_a_world_is_built(bestman_bt: Command) -> None:
    for goal in ("", " "):
        answer = bestman_bt("plan", "--goal", goal)
        assert answer.code == 2
        assert "the goal is empty" in answer.err
    answer = bestman_bt("plan", "--goal", "on(cup", "--scene", "no_such_scene")
    assert answer.code == 2
    assert "column" in answer.err


def test_what_cannot_be_written_is_reported_before_anything_is_planned(bestman_bt: Command, folder: Path) -> None:
    (folder / "file").write_text("")
    for arguments, words in (
        (("-o", "nowhere/tree.xml"), "the folder 'nowhere' does not exist"),
        (("-o", "."), "is a folder"),
        (("--svg", "nowhere/tree.svg"), "the folder 'nowhere' does not exist"),
        (("--record", "nowhere/talk.jsonl"), "the folder 'nowhere' does not exist"),
        (("--run", "--runs", "file/runs"), "is not a folder"),
    ):
        answer = bestman_bt("plan", "--goal", GOAL, "--scene", "no_such_scene", *arguments)
        assert answer.code == 2
        assert words in " ".join(answer.err.replace("│", " ").split()), answer.err


def test_a_plug_in_brings_the_planner_and_the_builder(bestman_bt: Command, folder: Path) -> None:
    (folder / "mine.py").write_text(
        "from bestman_bt.registry import task_planner, tree_builder\n"
        "from bestman_bt.task_planning.builders.sequence import SequenceBuilder\n"
        "from bestman_bt.task_planning.symbolic.search import SymbolicPlanner\n"
        "@task_planner('mine')\nclass Mine(SymbolicPlanner): ...\n"
        "@tree_builder('in_a_row')\nclass InARow(SequenceBuilder): ...\n"
        "@tree_builder('odd')\nclass Odd(SequenceBuilder):\n"
        "    def root(self, plan, goal, writer): return writer.node('Sequnce', 'plan', [])\n"
    )
    asked = ("plan", "--goal", "hand_empty", "--planner", "mine", "--builder", "in_a_row")
    with undone(PLANNERS, BUILDERS):
        assert bestman_bt(*asked, "--plugin", "mine.py").code == 0
        refused = bestman_bt("plan", "--goal", GOAL, "--builder", "odd", "--plugin", "mine.py").err
        assert "tree of the builder odd:5: <Sequnce>: unknown node" in refused
    answer = bestman_bt(*asked)
    assert answer.code == 2
    unknown = ("--planner: unknown task planner 'mine'", "--builder: unknown tree builder 'in_a_row'")
    assert [line.partition(";")[0] for line in answer.err.splitlines()[1:]] == list(unknown)
