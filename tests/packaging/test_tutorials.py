"""The files of docs/tutorials do what the pages say."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import yaml

from bestman_bt.configuration.errors import ConfigurationError
from bestman_bt.configuration.run import load_run
from bestman_bt.engine import TreeLoadError, load_tree
from bestman_bt.messages import Path2D, Pose2D
from bestman_bt.navigation.global_planning.base import PlanningFailure
from bestman_bt.navigation.global_planning.costmap import Costmap
from bestman_bt.navigation.global_planning.footprint import Footprint
from bestman_bt.robot_model.compose import load_robot_model
from bestman_bt.robot_model.model import ArmModel
from bestman_bt.runtime.algorithms import Algorithms
from bestman_bt.runtime.plugins import node_registry
from bestman_bt.runtime.resolved_config import prepare
from bestman_bt.testing import TreeTester
from bestman_bt.world_model.semantic_map import SemanticMap
from tests.packaging.test_page_blocks import blocks

TUTORIALS = Path(__file__).resolve().parents[2] / "docs" / "tutorials"


def files(page: str, folder: Path) -> Path:
    """The Python blocks that begin with their file's name, as files in ``folder``."""
    for text in blocks(TUTORIALS / page, "python"):
        name = re.match(r"# (\w+\.py)\n", text)
        assert name is not None
        (folder / name[1]).write_text(text)
    return folder


def successes(tree: str, runs: int) -> int:
    tester = TreeTester(tree)
    return sum(tester.run(default=None, seed=seed).succeeded for seed in range(runs))


def test_the_tutorials_are_in_order_in_the_navigation() -> None:
    settings = yaml.load((TUTORIALS.parents[1] / "mkdocs.yml").read_text(), Loader=yaml.BaseLoader)
    (entries,) = (section["Tutorials"] for section in settings["nav"] if "Tutorials" in section)
    titles = [title for entry in entries for title in entry if title[0].isdigit()]
    assert titles == [(TUTORIALS / page).read_text().splitlines()[0][2:] for entry in entries[1:] for page in
                      [Path(next(iter(entry.values()))).name]]  # fmt: skip


@pytest.mark.slow
def test_the_tree_with_recovery_succeeds_more_often_as_the_page_says(tmp_path: Path) -> None:
    plain, recovering = blocks(TUTORIALS / "tree.md", "xml")
    counts = []
    for text in (plain, recovering):
        (tmp_path / "find_cup.xml").write_text(text)
        counts.append(successes(str(tmp_path / "find_cup.xml"), 100))
    told = re.findall(r"successes: (\d+) of 100|again: (\d+) runs", (TUTORIALS / "tree.md").read_text())
    assert [str(count) for count in counts] == [one or other for one, other in told]


def test_a_misspelt_port_is_reported_with_the_one_that_was_meant(tmp_path: Path) -> None:
    text = blocks(TUTORIALS / "tree.md", "xml")[0].replace("<LookAt surface", "<LookAt surfac")
    with pytest.raises(TreeLoadError, match="<LookAt>.*did you mean 'surface'"):
        load_tree(text, node_registry())


def test_the_tree_in_python_has_the_leaves_of_that_in_xml(tmp_path: Path) -> None:
    made = load_tree(files("tree.md", tmp_path) / "find_cup.py", node_registry())
    written = load_tree(blocks(TUTORIALS / "tree.md", "xml")[0], node_registry())
    leaves = [{node.type_id for node in tree.nodes if not node.children} for tree in (made, written)]
    assert leaves[0] == leaves[1] - {"Log"}


def test_the_skill_is_refused_with_a_number_below_its_limit(tmp_path: Path) -> None:
    registry = node_registry([str(files("skill.md", tmp_path) / "glance.py")])
    (text,) = blocks(TUTORIALS / "skill.md", "xml")
    assert load_tree(text, registry).nodes
    with pytest.raises(TreeLoadError, match="times"):
        load_tree(text.replace('times="3"', 'times="0"'), registry)


@pytest.mark.slow
def test_the_test_of_the_skill_passes(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:dash", "test_glance.py"]
    done = subprocess.run(command, cwd=files("skill.md", tmp_path), capture_output=True, text=True, check=False)
    assert "2 passed" in done.stdout, done.stdout + done.stderr


@pytest.mark.slow
def test_the_robot_finds_the_cup_by_the_tree(tmp_path: Path) -> None:
    import bestman_bt as bt

    with bt.Session(robot="diff_panda", scene="kitchen", seed=1) as session:
        tree = session.load(blocks(TUTORIALS / "tree.md", "xml")[1])
        assert session.run(tree).success
        assert "cup" in session.skills.world.objects


def test_the_planner_drives_straight_or_around_and_its_parameter_has_a_limit(tmp_path: Path) -> None:
    plugin = f"{files('planner.md', tmp_path) / 'straight.py'}:Straight"
    chosen = [f"algorithms.global_planning.algorithm={plugin}"]
    config = load_run("navigate_kitchen", seed=3, settings=chosen)
    planner = Algorithms(config, load_robot_model("diff_panda")).global_planning
    walls = [(-1, -2, 5, -2), (5, -2, 5, 2), (5, 2, -1, 2), (-1, 2, -1, -2), (2, -2, 2, 0)]
    corners = np.array([[-0.25, -0.25], [0.25, -0.25], [0.25, 0.25], [-0.25, 0.25]])
    costmap = Costmap.from_map(SemanticMap(np.array(walls, dtype=float), {}), Footprint(corners))
    straight = planner.plan(Pose2D(0.0, 1.0, 0.7), Pose2D(4.0, 1.0, 1.0), costmap)
    around = planner.plan(Pose2D(0.0, -1.0, 0.7), Pose2D(4.0, -1.0, 0.0), costmap)
    lengths = [np.linalg.norm(np.diff(path.points, axis=0), axis=1).sum() for path in (straight, around)]
    assert isinstance(around, Path2D)
    assert lengths[0] == pytest.approx(4.0)
    assert 4.3 < lengths[1] < 6.0
    assert isinstance(planner.plan(Pose2D(0.0, 1.0, 0.0), Pose2D(9.0, 1.0, 0.0), costmap), PlanningFailure)
    wrong = load_run("navigate_kitchen", settings=[*chosen, "algorithms.global_planning.spacing=-1"])
    with pytest.raises(ConfigurationError, match="greater than 0"):
        Algorithms(wrong, load_robot_model("diff_panda"))


def test_the_robot_can_be_composed_and_connected(tmp_path: Path) -> None:
    (robot,) = blocks(TUTORIALS / "robot.md", "yaml")
    (connections,) = blocks(TUTORIALS / "hardware.md", "yaml")
    file = tmp_path / "my_robot.yaml"
    file.write_text(robot)
    arm = load_robot_model(str(file)).of(ArmModel)["arm"]
    assert len(arm.joint_names) == 6
    file.write_text(robot + connections)
    slow = load_robot_model(str(file)).of(ArmModel)["arm"]
    assert (np.asarray(slow.velocity) < 0.2 * np.asarray(arm.velocity)).all()


def test_the_task_has_a_goal_that_the_scene_can_meet(tmp_path: Path) -> None:
    (text,) = blocks(TUTORIALS / "compare.md", "yaml")
    (tmp_path / "my_task.yaml").write_text(text)
    setup = prepare(load_run(tmp_path / "my_task.yaml", seed=7))
    assert (setup.goals[0].object, setup.goals[0].surface) == ("cup", "counter")
