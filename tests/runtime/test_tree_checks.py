"""What a tree asks for is compared with scene, map, robot and task before anything moves."""

from __future__ import annotations

import logging
from pathlib import Path

import pytest

import bestman_bt as bt
from behaviours.manipulation.move_arm import MoveArm
from bestman_bt.configuration.run import load_run
from bestman_bt.engine import TreeLoadError, load_tree
from bestman_bt.evaluation.episode import prepare_episode
from bestman_bt.robot_model.compose import load_robot_model
from bestman_bt.robot_model.sensor_parts import LidarPart
from bestman_bt.runtime.algorithms import algorithm_by_name
from bestman_bt.runtime.plugins import node_registry
from bestman_bt.runtime.policies import policy_problems
from bestman_bt.runtime.resolved_config import ResolvedConfig, load_for, prepare
from bestman_bt.runtime.robot_session import RobotSession, session
from bestman_bt.runtime.tree_checks import lacking_parts, unfilled_entries, unknown_names

TAKE = (
    '<BehaviorTree ID="Take"><Sequence><FindStandPose surface="{surface}" object="{object}" stand="{stand}"/>'
    '<LookAt surface="{surface}"/></Sequence></BehaviorTree>'
)


@pytest.fixture(scope="module")
def kitchen() -> ResolvedConfig:
    return prepare(load_run("fetch_cup"))


def text_of(body: str, more: str = "") -> str:
    return (
        f'<root BTCPP_format="4" main_tree_to_execute="M">\n<BehaviorTree ID="M">\n{body}</BehaviorTree>{more}</root>'
    )


def unknown(kitchen: ResolvedConfig, body: str, more: str = "") -> list[str]:
    return [str(problem) for problem in unknown_names(load_for(kitchen, text_of(body, more)), kitchen.names)]


@pytest.mark.parametrize(
    ("node", "told"),
    [
        ('<LookAt surface="countr"/>', "port 'surface': there is no surface 'countr' (did you mean 'counter'?)"),
        ('<Grasp object="cupp" grasps="{g}"/>', "port 'object': there is no object 'cupp' (did you mean 'cup'?)"),
        ('<MoveArm posture="cary"/>', "port 'posture': there is no posture 'cary' (did you mean 'carry'?)"),
        ('<IsOpen articulation="fridge/dor"/>', "port 'articulation': there is no door or drawer 'fridge/dor' ("),
        ('<BelieveLocked container="drwer"/>', "port 'container': there is no door or drawer 'drwer' ("),
        ('<DockAt goal="0;0;0" furniture="tble"/>', "port 'furniture': there is no piece of furniture 'tble' ("),
        ('<Holds fact="on({object}, {place})" object="cup" place="tble"/>', "port 'place': there is no surface 'tble'"),
    ],
)
def test_a_name_that_nothing_bears_is_reported_with_its_line_and_the_closest(
    kitchen: ResolvedConfig, node: str, told: str
) -> None:
    (message,) = unknown(kitchen, f"\n{node}")
    assert message.startswith(f"<text>:4: <{node[1:].split()[0]}> {told.replace(chr(39) + 'did', 'did')}")


@pytest.mark.parametrize(
    "node",
    [
        '<LookAt surface="counter/top"/>',
        '<LookAt object="cup_2"/>',
        '<LookAt object="thing_1"/>',
        '<LookAt surface="{anything}"/>',
        '<DockAt goal="0;0;0" furniture=""/>',
        '<Sequence><SetBlackboard value="no surface" output_key="word"/><Script code="word := \'x\'"/></Sequence>',
    ],
)
def test_names_that_are_or_may_be_there_pass(kitchen: ResolvedConfig, node: str) -> None:
    assert unknown(kitchen, node) == []


def test_a_name_that_a_subtree_is_given_is_reported_once_in_the_subtrees_line(kitchen: ResolvedConfig) -> None:
    body = '<Sequence>\n<SubTree ID="Take" object="cup" surface="countr"/></Sequence>'
    (message,) = unknown(kitchen, body, TAKE)
    assert message.startswith("<text>:4: <SubTree> port 'surface': there is no surface 'countr'")


def test_a_name_that_setblackboard_writes_is_told_there(kitchen: ResolvedConfig) -> None:
    writer = '<SetBlackboard value="countr" output_key="place"/>'
    (message,) = unknown(kitchen, f'<Sequence>\n{writer}\n<LookAt surface="{{place}}"/></Sequence>')
    assert message.startswith("<text>:4: <SetBlackboard> port 'value': there is no surface 'countr'")


def test_objects_that_only_the_own_scene_has_and_those_that_it_leaves_out_pass(tmp_path: Path) -> None:
    (tmp_path / "my.xml").write_text(text_of('<Sequence><LookAt object="cup"/><LookAt object="my_can"/></Sequence>'))
    (tmp_path / "mine.yaml").write_text(
        "extends: kitchen\nobjects:\n  my_can: {model: can, surface: table/top, at: [0, 0, 0]}\n  cup: absent\n"
    )
    scene = tmp_path / "mine.yaml"
    assert prepare(load_run(None, tree=tmp_path / "my.xml", scene=scene, robot="diff_panda"))
    with pytest.raises(TreeLoadError, match="there is no object 'my_can'"):
        prepare(load_run(None, tree=tmp_path / "my.xml", scene="kitchen", robot="diff_panda"))


def test_a_detector_with_words_of_its_own_may_be_asked_for_anything(tmp_path: Path) -> None:
    path = tmp_path / "my.xml"
    path.write_text(text_of('<DetectObject object="banana" surface="table"/>'))
    remote = ["algorithms.detection.algorithm=remote", "algorithms.detection.url=http://127.0.0.1:1/detect"]
    assert prepare(load_run(None, tree=path, scene="kitchen", robot="diff_panda", settings=remote))
    with pytest.raises(TreeLoadError, match="there is no object 'banana'"):
        prepare(load_run(None, tree=path, scene="kitchen", robot="diff_panda"))


def test_nothing_is_started_where_a_name_is_unknown_and_all_are_reported(tmp_path: Path) -> None:
    path = tmp_path / "my.xml"
    path.write_text(text_of('<Sequence><LookAt surface="countr"/>\n<LookAt object="cupp"/></Sequence>'))
    with pytest.raises(TreeLoadError) as error:
        prepare(load_run(None, tree=path, scene="kitchen", robot="diff_panda"))
    assert [problem.line for problem in error.value.problems] == [3, 4]


def test_entries_that_nobody_fills_keep_a_run_from_starting(tmp_path: Path) -> None:
    path = tmp_path / "my.xml"
    path.write_text(text_of('<Sequence>\n<CheckHeld object="{object}"/>\n<LookAt point="{pose}"/></Sequence>'))
    with pytest.raises(TreeLoadError) as error:
        prepare_episode(load_run(None, tree=path, scene="kitchen", robot="diff_panda"))
    (message,) = str(error.value).splitlines()
    assert message == (
        f"{path}:4: <CheckHeld> port 'object': reads '{{object}}', which tasks fill, but no task is given"
    )
    prepare_episode(load_run("fetch_cup", tree=path))


def test_a_policy_that_a_subtree_is_given_is_reported_in_the_subtrees_line(kitchen: ResolvedConfig) -> None:
    leaf = '<RunPolicy policy="{which}" goal="1;0;1"/>'
    inner = f'<BehaviorTree ID="Try"><Fallback>{leaf}{leaf}</Fallback></BehaviorTree>'
    tree = load_for(kitchen, text_of('<Sequence>\n<SubTree ID="Try" which="policy_rech"/></Sequence>', inner))
    (problem,) = policy_problems(tree)
    assert (problem.line, problem.field) == (4, "which")
    assert "unknown policy 'policy_rech'" in problem.message


def test_unknown_names_and_empty_entries_are_reported_together_in_the_order_of_lines(tmp_path: Path) -> None:
    path = tmp_path / "my.xml"
    path.write_text(text_of('<Sequence>\n<CheckHeld object="{thing}"/>\n<LookAt surface="countr"/></Sequence>'))
    with pytest.raises(TreeLoadError) as error:
        prepare_episode(load_run(None, tree=path, scene="kitchen", robot="diff_panda"))
    assert [(problem.line, problem.field) for problem in error.value.problems] == [(4, "object"), (5, "surface")]


def test_the_start_is_always_filled(tmp_path: Path) -> None:
    path = tmp_path / "my.xml"
    path.write_text(text_of('<NavigateTo goal="{start}"/>'))
    assert prepare_episode(load_run(None, tree=path, scene="kitchen", robot="diff_panda"))


def test_where_code_may_write_unseen_an_empty_entry_is_a_warning(tmp_path: Path) -> None:
    tree = tmp_path / "my.py"
    tree.write_text(
        "import py_trees\n"
        "from bestman_bt.engine import Sequence\n"
        "from behaviours.manipulation.grasp import CheckHeld\n"
        "def build():\n"
        '    native = py_trees.behaviours.SetBlackboardVariable("set", "thing", "cup", overwrite=True)\n'
        '    return Sequence([native, CheckHeld(object="{thing}")])\n'
    )
    setup = prepare_episode(load_run(None, tree=tree, scene="kitchen", robot="diff_panda"))
    assert {problem.severity for problem in unfilled_entries(load_for(setup), (), False)} <= {"warning"}


def test_a_session_without_a_task_warns_of_keys_that_only_tasks_fill(
    kitchen: ResolvedConfig, caplog: pytest.LogCaptureFixture
) -> None:
    tree = text_of('<CheckHeld object="{object}"/>')
    told = []
    for entries in ({}, dict(kitchen.entries)):
        caplog.clear()
        with caplog.at_level(logging.WARNING):
            RobotSession(kitchen, None, None, entries, None).check(load_for(kitchen, tree), entries)
        told.append(caplog.messages)
    assert told[0] == [
        "<text>:3: warning: <CheckHeld> port 'object': reads '{object}', which tasks fill, but no task is given"
    ]
    assert told[1] == []


def test_a_session_refuses_names_that_nothing_bears(kitchen: ResolvedConfig) -> None:
    session = RobotSession(kitchen, None, None, dict(kitchen.entries), None)
    with pytest.raises(TreeLoadError, match="there is no surface 'countr'"):
        session.check(load_for(kitchen, text_of('<LookAt surface="countr"/>')), session.entries)


OWN_PLANNER = """
from bestman_bt.messages import Path2D
from bestman_bt.navigation.global_planning.base import GlobalPlanner
from words import WORD


class Mine(GlobalPlanner):
    word = WORD

    def plan(self, start, goal, costmap):
        return Path2D([start.xy, goal.xy], goal)
"""


def tree_beside_planners(folder: Path, name: str) -> Path:
    """A tree in ``folder``, and one that it includes from a folder below, each beside planners.py and words.py."""
    inner = folder / "parts"
    inner.mkdir(parents=True)
    for place in (folder, inner):
        (place / "planners.py").write_text(OWN_PLANNER)
        (place / "words.py").write_text(f"WORD = {'/'.join(place.parts[-2:])!r}")
    leaf = f'<ComputePathToPose goal="0;0;0" path="{{path}}" planner_id="{name}"/>'
    (inner / "inner.xml").write_text(text_of(leaf).replace('"M"', '"Inner"'))
    included = text_of(f'<Sequence>{leaf}<SubTree ID="Inner"/></Sequence>').replace(
        '"M">', '"M">\n<include path="parts/inner.xml"/>', 1
    )
    (folder / "my.xml").write_text(included)
    return folder / "my.xml"


@pytest.mark.slow
@pytest.mark.parametrize("name", ["planners.py:Mine", "planners:Mine"])
def test_trees_and_what_they_include_find_the_planners_beside_them_and_no_others(
    name: str, kitchen: ResolvedConfig, tmp_path: Path
) -> None:
    words = []
    for folder in ("one", "two"):
        tree = load_for(kitchen, tree_beside_planners(tmp_path / folder, name))
        assert kitchen.missing_in(tree) == []
        leaves = [node for node in tree.nodes if node.type_id == "ComputePathToPose"]
        words += [algorithm_by_name(kitchen.config, "global_planning", name, leaf.folders).word for leaf in leaves]
    base = tmp_path.name
    assert words == [f"{base}/one", "one/parts", f"{base}/two", "two/parts"]
    alone = tmp_path / "alone.xml"
    alone.write_text((tmp_path / "one/parts/inner.xml").read_text())
    (problem,) = kitchen.missing_in(load_for(kitchen, alone))
    assert (problem.file, problem.line, problem.field) == (str(alone), 3, "planner_id")
    assert "default.yaml" not in problem.message


def test_an_own_planner_that_fails_is_reported_with_its_line_and_the_trees(
    kitchen: ResolvedConfig, tmp_path: Path
) -> None:
    tree = tree_beside_planners(tmp_path / "one", "planners.py:Mine")
    (tmp_path / "one/planners.py").write_text("import math\nmath.sqrt(-1)\n")
    (problem,) = kitchen.missing_in(load_for(kitchen, tree))
    assert str(problem).startswith(f"{tree}:4: <ComputePathToPose> port 'planner_id': {tmp_path}/one/planners.py:2: it")


@pytest.mark.parametrize(
    ("node", "told"),
    [
        ('<LookAt surface="countr"/>', "there is no surface 'countr' (did you mean 'counter'?)"),
        ('<RunPolicy policy="policy_rech" goal="1;0;1"/>', "unknown policy 'policy_rech'"),
    ],
)
def test_loading_in_a_session_checks_names_as_a_run_does(node: str, told: str, tmp_path: Path) -> None:
    path = tmp_path / "my.xml"
    path.write_text(text_of(node))
    with pytest.raises(TreeLoadError) as by_run:
        prepare(load_run(None, tree=path, scene="kitchen", robot="diff_panda"))
    with session() as opened, pytest.raises(TreeLoadError) as by_session:
        opened.load(path)
    assert str(by_session.value) == str(by_run.value)
    assert f"{path}:3: <{node[1:].split()[0]}>" in str(by_session.value)
    assert told in str(by_session.value)


def test_loading_in_a_session_warns_of_keys_that_nobody_fills(caplog: pytest.LogCaptureFixture) -> None:
    with session() as opened, caplog.at_level(logging.WARNING):
        opened.load(text_of('<CheckHeld object="{objct}"/>'))
    assert "reads '{objct}', which nothing in the tree writes" in caplog.text


def test_loading_in_a_session_warns_of_attributes_that_nobody_reads(caplog: pytest.LogCaptureFixture) -> None:
    inner = '<BehaviorTree ID="Look"><LookAt surface="{surface}"/></BehaviorTree></root>'
    text = text_of('<SubTree ID="Look" surface="table" sped="2"/>').replace("</root>", inner)
    with bt.Session() as opened, caplog.at_level(logging.WARNING):
        opened.load(text)
    assert "'sped': nothing in the tree 'Look' uses it" in caplog.text


def test_parts_behind_no_connection_are_reported_as_such_with_the_node_that_needs_them() -> None:
    robot = load_robot_model("diff_panda")
    text = '<root BTCPP_format="4"><BehaviorTree ID="Main"><NavigateTo goal="1;0;0"/></BehaviorTree></root>'
    tree = load_tree(text, node_registry())
    (problem,) = lacking_parts(tree, robot, robot.parts.keys() - robot.of(LidarPart).keys())
    assert "NavigateTo" in problem.message
    assert problem.message.endswith("and its lidar without a connection")
    assert not lacking_parts(tree, robot, robot.parts)
    assert not lacking_parts(tree, robot, ())  # the robot's file is at fault


def test_a_number_in_a_tree_made_in_python_is_no_name(kitchen: ResolvedConfig) -> None:
    (problem,) = unknown_names(load_for(kitchen, MoveArm(posture=3)), kitchen.names)
    assert "port 'posture': there is no posture '3'" in str(problem)
