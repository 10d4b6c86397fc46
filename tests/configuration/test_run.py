"""Tasks and runs: merged from files and the command line, dumped and read back unchanged."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import pytest

from bestman_bt.configuration.data import find_data
from bestman_bt.configuration.errors import ConfigurationError
from bestman_bt.configuration.run import RunConfig, dump_run, load_run, read_run
from bestman_bt.configuration.task import load_task, task_of_tree

SETTINGS = (
    "scene.finger_friction=0.05",
    "scene.objects.cup=absent",
    "robot.parts.lidar.set.beams=90",
    "tolerances.position=3 cm",
    "algorithms.motion_planning.max_iterations=500",
)


@pytest.fixture
def run() -> RunConfig:
    return load_run("fetch_cup", seed=7, settings=SETTINGS, plugins=["my_nodes.py"], record=True)


def problems(**arguments: object) -> list[str]:
    with pytest.raises(ConfigurationError) as error:
        load_run(**arguments)  # type: ignore[arg-type]
    return [str(problem) for problem in error.value.problems]


def test_the_shipped_task_names_tree_scene_robot_and_goal() -> None:
    task = load_task("fetch_cup")
    assert (task.tree, task.scene, task.robot) == ("fetch_cup", "kitchen", "diff_panda")
    goal = task.goals[0]["placed"]
    assert (goal["object"], goal["surface"]) == ("cup", "counter")
    assert (task.tolerances.position, task.tolerances.tilt) == pytest.approx((0.02, math.radians(10)))
    assert task.max_penetration == pytest.approx(0.002)


def test_a_task_has_an_algorithm_for_every_slot_by_default() -> None:
    task = load_task("fetch_cup")
    assert task.algorithm("motion_planning") == ("rrt_connect", {})
    with pytest.raises(KeyError, match="no algorithm is set for 'cooking'; set: .*motion_planning"):
        task.algorithm("cooking")


def test_settings_reach_task_scene_and_robot(run: RunConfig) -> None:
    assert run.task.tolerances.position == pytest.approx(0.03)
    assert run.task.algorithm("motion_planning") == ("rrt_connect", {"max_iterations": 500})
    assert run.scene_settings == {"finger_friction": 0.05, "objects.cup": "absent"}
    assert run.robot_settings == {"parts.lidar.set.beams": 90}
    assert (run.name, run.seed, run.record, run.task.plugins) == ("fetch_cup", 7, True, ("my_nodes.py",))


def test_a_dumped_run_is_read_back_unchanged(run: RunConfig, tmp_path: Path) -> None:
    path = tmp_path / "config.yaml"
    path.write_text(dump_run(run), encoding="utf-8")
    again = read_run(path)
    assert again == run
    assert dump_run(again) == dump_run(run)


def test_a_dumped_run_with_a_disturbance_of_each_kind_is_read_back(tmp_path: Path) -> None:
    kinds = [f"{{kind: {kind}, object: cup}}" for kind in ("moved", "elsewhere", "slips")]
    kinds.append("{kind: shut, articulation: counter/drawer}")
    run = load_run("fetch_cup", settings=[f"disturbances=[{', '.join(kinds)}]"])
    path = tmp_path / "config.yaml"
    path.write_text(dump_run(run), encoding="utf-8")
    assert read_run(path).task.disturbances == run.task.disturbances


def test_a_run_that_names_files_from_the_working_directory_can_be_read_anywhere(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine").mkdir()
    for name in ("room.yaml", "mine/planners.py", "bench.yaml", "me.py"):
        Path(name).touch()
    settings = (
        "algorithms.global_planning.algorithm=mine/planners.py:Corner",
        "scene.furniture.table.model=bench.yaml",
    )
    run = replace(load_run("fetch_cup", scene="room.yaml", settings=settings, plugins=["me.py"]), recording="mine")
    path = tmp_path / "config.yaml"
    path.write_text(dump_run(run, absolute=True), encoding="utf-8")
    again = read_run(path)
    assert (again.task.tree, again.task.scene) == ("fetch_cup", str(tmp_path / "room.yaml"))
    assert again.task.algorithm("global_planning")[0] == f"{tmp_path}/mine/planners.py:Corner"
    assert again.task.plugins == (str(tmp_path / "me.py"),)
    assert again.scene_settings == {"furniture.table.model": str(tmp_path / "bench.yaml")}
    assert again.recording == str(tmp_path / "mine")


def test_the_command_line_replaces_what_the_task_names() -> None:
    run = load_run("fetch_cup", scene="kitchen_without_cup")
    assert (run.task.scene, run.task.robot) == ("kitchen_without_cup", "diff_panda")


def test_without_a_task_tree_scene_and_robot_are_enough() -> None:
    run = load_run(tree="fetch_cup", scene="kitchen", robot="diff_panda")
    assert (run.name, run.task.goals, run.task.predicate) == ("fetch_cup", (), None)
    assert problems(tree="fetch_cup", scene="kitchen") == ["arguments: robot: is missing"]


def test_a_trees_default_task_is_the_one_that_names_it(tmp_path: Path) -> None:
    assert task_of_tree("fetch_cup") == "fetch_cup"
    assert task_of_tree(str(find_data("tree", "fetch_cup"))) == "fetch_cup"
    assert task_of_tree("no_such_tree") is None
    assert task_of_tree(str(tmp_path / "fetch_cup.xml")) is None  # a user's own, which has another goal


def test_another_algorithm_in_a_slot_does_not_inherit_parameters(tmp_path: Path) -> None:
    path = tmp_path / "mine.yaml"
    base = "tree: fetch_cup\nscene: kitchen\nrobot: diff_panda\nalgorithms:\n  motion_planning: "
    path.write_text(base + "{algorithm: prm, neighbours: 5}\n")
    task = load_run(path).task
    assert task.algorithm("motion_planning") == ("prm", {"neighbours": 5})
    assert task.algorithm("kinematics")[0] == "damped_least_squares"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"task": "fetch_cip"}, "unknown task 'fetch_cip'; did you mean 'fetch_cup'?"),
        ({"task": "fetch_cup", "scene": "kichen"}, "scene='kichen': unknown scene 'kichen'; did you mean"),
        ({"task": "fetch_cup", "robot": "diff_pand"}, "robot='diff_pand': unknown robot 'diff_pand'; did you"),
        ({"task": "fetch_cup", "tree": "fetch_cop"}, "fetch_cop: unknown tree 'fetch_cop'; did you mean"),
        ({"task": "fetch_cup", "tree": "/nowhere/x.xml"}, "/nowhere/x.xml: no such tree file"),
        ({"task": "fetch_cup", "seed": "seven"}, "seed=seven: seed: should be a whole number, got 'seven'"),
        ({"task": "fetch_cup", "seed": -1}, "seed=-1: seed: should be greater than or equal to 0"),
        ({"task": "fetch_cup", "seed": 2**62}, f"seed={2**62}: seed: should be less than {2**62}"),
        (
            {"task": "fetch_cup", "settings": ["tick_rat=3"]},
            "settings=['tick_rat=3']: unknown key 'tick_rat'; did you mean",
        ),
        ({"task": "fetch_cup", "settings": ["tick_rate"]}, "settings=['tick_rate']: should have the form key=value"),
        ({"task": "fetch_cup", "settings": ["tick_rate=[1"]}, "settings=['tick_rate=[1']: the value is not YAML"),
        ({"task": "fetch_cup", "settings": ["tick_rate=3 kg"]}, "tick_rate: expected a frequency in Hz (Hz, kHz)"),
        (
            {"task": "fetch_cup", "settings": ["algorithms.motion_plannin.a=1"]},
            "unknown key 'algorithms.motion_plannin'; did you mean 'motion_planning'?",
        ),
    ],
)
def test_bad_input_is_refused_with_the_remedy(arguments: dict[str, object], message: str) -> None:
    (problem,) = problems(**arguments)
    assert message in problem


TASK = "tree: fetch_cup\nscene: kitchen\nrobot: diff_panda\n"


@pytest.mark.parametrize(
    ("algorithms", "message"),
    [
        ("{segmentatoin: {algorithm: plane_dbscan}}", "segmentatoin: unknown slot; did you mean 'segmentation'?"),
        ("{zebra: {heat: 3}}", "zebra: unknown slot; known: affordance, base_placement, collision, "),
        ("{detections: {algorithm: nope}}", "detections: unknown slot; did you mean 'detection'"),
        ("{trajectory: {algorithm: 3}}", "trajectory.algorithm: should be the name of an algorithm, got 3"),
    ],
)
def test_a_slot_that_there_is_not_or_without_an_algorithm_is_refused(
    algorithms: str, message: str, tmp_path: Path
) -> None:
    path = tmp_path / "mine.yaml"
    path.write_text(f"{TASK}algorithms: {algorithms}\n")
    (found,) = problems(task=path)
    assert found.startswith(f"{path}:4: algorithms.{message}")


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("max_penetration: -2 mm", "max_penetration: should be greater than 0, got '-2 mm'"),
        ("tolerances: {position: -2 cm}", "tolerances.position: should be greater than 0, got '-2 cm'"),
        ("tolerances: {tilt: -10 deg}", "tolerances.tilt: should be greater than 0, got '-10 deg'"),
        ("tolerances: {tilt: 200 deg}", "tolerances.tilt: should be at most 180 deg, got '200 deg'"),
        ("tolerances: {yaw: 4}", "tolerances.yaw: should be at most 180 deg, got 4"),
        ("tolerances: {yaw: 0}", "tolerances.yaw: should be greater than 0, got 0"),
        ("tolerances: {rest_time: -1 s}", "tolerances.rest_time: should be greater than or equal to 0, got '-1 s'"),
        ("time_limit: 0 s", "time_limit: should be greater than 0, got '0 s'"),
        ("tick_rate: 0", "tick_rate: should be greater than 0, got 0"),
        ("tick_rate: 1.5 kHz", "tick_rate: should be less than or equal to 1000, got '1.5 kHz'"),
    ],
)
def test_a_limit_that_nothing_could_keep_is_refused(line: str, message: str, tmp_path: Path) -> None:
    path = tmp_path / "mine.yaml"
    path.write_text(f"{TASK}{line}\n")
    assert problems(task=path) == [f"{path}:4: {message}"]
