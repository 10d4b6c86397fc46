"""Tasks that contradict themselves are refused; what they name is found from where they lie."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from bestman_bt.configuration.errors import ConfigurationError
from bestman_bt.configuration.run import RunRequest, load_run, run_of_options
from bestman_bt.configuration.task import load_task

TASK = "tree: fetch_cup\nscene: kitchen\nrobot: diff_panda\n"


def written(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "mine.yaml"
    path.write_text(TASK + text)
    return path


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("disturbances: [{kind: moved}]", "4: disturbances[0]: 'object' is missing: what kind 'moved' is done to"),
        (
            "disturbances: [{kind: shut, object: cup}]",
            "4: disturbances[0]: 'articulation' is missing: what kind 'shut'",
        ),
        (
            "disturbances: [{kind: slips, object: cup}, {kind: slips, object: cup, surface: table}]",
            "4: disturbances[1].surface: kind 'slips' has no 'surface'; it has kind, after, object",
        ),
        (
            "disturbances: [{kind: moved, object: cup, distance: [0.3, 0.1]}]",
            "4: disturbances[0].distance: the smaller limit comes first: [0.1, 0.3], got [0.3, 0.1]",
        ),
        (
            "disturbances: [{kind: moved, object: cup, after: [0.3, 0.1]}]",
            "4: disturbances[0].after: the smaller limit comes first: [0.1, 0.3], got [0.3, 0.1]",
        ),
        ("algorithms: {collision: 3}", "4: algorithms.collision: should hold names (name: value), got 3"),
    ],
)
def test_a_task_that_contradicts_itself_is_refused_with_the_line(text: str, message: str, tmp_path: Path) -> None:
    path = written(tmp_path, text + "\n")
    with pytest.raises(ConfigurationError) as error:
        load_task(path)
    (problem,) = error.value.problems
    assert str(problem).startswith(f"{path}:{message}")


@pytest.mark.parametrize(
    "text",
    [
        "goals: []",
        "disturbances: [{kind: shut, articulation: chest/drawer_1, object: cup, after: [0, 0]},"
        " {kind: elsewhere, object: cup, surface: table}, {kind: moved, object: cup, distance: [0.2, 0.2]}]",
    ],
)
def test_what_goes_together_is_taken(text: str, tmp_path: Path) -> None:
    assert load_task(written(tmp_path, text + "\n")).tree == "fetch_cup"


OLD = [
    ("goal: {name: there, object: cup}", "[{placed: {object: cup, at: there}}]"),
    ("opening: {articulation: chest/drawer_1}", "[{opened: {articulation: chest/drawer_1}}]"),
    ("tidy: {objects: [cup]}", "[{tidied: {objects: [cup]}}]"),
    ("reach: {goal: there}", "[{tool_at: {goal: there}}]"),
    ("lift: {object: cup}", "[{lifted: {object: cup}}]"),
    ("drive: {}", "[{at_goal: {}}]"),
    ("plan: {goal: hand_empty}", "[{facts: {goal: hand_empty}}]"),
]


def test_fields_that_goals_had_before_they_were_a_list_are_reported_with_how_they_are_written_now(
    tmp_path: Path,
) -> None:
    path = written(tmp_path, "\n".join(old for old, _ in OLD))
    with pytest.raises(ConfigurationError) as error:
        load_task(path)
    told = {str(problem) for problem in error.value.problems}
    names = [old.partition(":")[0] for old, _ in OLD]
    lines = [f"{path}:{line}: {name}" for line, name in enumerate(names, start=4)]
    wanted = zip(lines, OLD, strict=True)
    assert told == {f"{where}: is an entry of 'goals' now: write goals: {new}" for where, (_, new) in wanted}


def test_one_predicate_and_several_read_alike(tmp_path: Path) -> None:
    assert load_task(written(tmp_path, "predicate: at_goal\n")).predicates == ("at_goal",)
    assert load_task(written(tmp_path, "predicate: [at_goal, open]\n")).predicates == ("at_goal", "open")
    assert load_task(written(tmp_path, "")).predicates == ()


def test_paths_in_a_task_are_counted_from_its_file_and_bare_names_are_shipped(tmp_path: Path) -> None:
    path = tmp_path / "mine.yaml"
    path.write_text("tree: trees/mine.xml\nscene: kitchen\nrobot: ./robot.yaml\nplugins: [nodes.py]\n")
    task = load_task(path)
    assert (task.tree, task.scene) == (str(tmp_path / "trees/mine.xml"), "kitchen")
    assert (task.robot, task.plugins) == (str(tmp_path / "robot.yaml"), (str(tmp_path / "nodes.py"),))


def test_parameters_without_a_name_are_of_the_shipped_algorithm(tmp_path: Path) -> None:
    task = load_task(written(tmp_path, "algorithms: {motion_planning: {max_iterations: 7}}\n"))
    assert task.algorithm("motion_planning") == ("rrt_connect", {"max_iterations": 7})


def test_a_run_reports_where_each_field_of_its_task_was_written() -> None:
    asked: dict[str, Any] = {"scene": "kitchen_without_cup", "settings": ["tick_rate=10"]}
    run, typed = load_run("fetch_cup", **asked), run_of_options(RunRequest("fetch_cup", **asked))
    assert str(run.problem(("scene",), "is odd")) == "scene='kitchen_without_cup': scene: is odd"
    assert str(typed.problem(("scene",), "is odd")) == "--scene kitchen_without_cup: scene: is odd"
    assert str(run.problem(("tick_rate",), "is odd")) == "settings=['tick_rate=10']: tick_rate: is odd"
    assert str(typed.problem(("tick_rate",), "is odd")) == "--set tick_rate=10: tick_rate: is odd"
    tree = run.problem(("tree",), "is odd")
    assert tree.source.endswith("fetch_cup.yaml")
    assert tree.line is not None


def test_plug_ins_that_there_are_not_are_reported_beside_other_faults_and_the_others_are_not(tmp_path: Path) -> None:
    there = tmp_path / "there.py"
    there.write_text("")
    with pytest.raises(ConfigurationError) as error:
        load_run("fetch_cup", settings=["tick_rate=0"], plugins=[str(there), "not_there.py"])
    assert [str(problem).split(": ")[0] for problem in error.value.problems][1:] == ["plugins=['not_there.py']"]
