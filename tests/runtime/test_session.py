"""Sessions: what a tree finds when it starts, and that the robot is left alone afterwards."""

from __future__ import annotations

from pathlib import Path

import pytest
from py_trees import composites

from behaviours.manipulation.move_arm import MoveArm
from behaviours.parts import MissingPartError
from bestman_bt.configuration.errors import ConfigurationError
from bestman_bt.configuration.run import load_run
from bestman_bt.control.robot_stop import HELD
from bestman_bt.engine import Sequence, TreeLoadError
from bestman_bt.monitor.control_client import request, running_executors
from bestman_bt.runtime.executor import TerminationReason
from bestman_bt.runtime.resolved_config import prepare
from bestman_bt.runtime.robot_session import open_session, session
from hal.api import NotConnectedError

HEAD = '<root BTCPP_format="4"><BehaviorTree ID="Main"><LookAt point="{goal}"/></BehaviorTree></root>'


def test_a_session_with_a_task_gives_trees_its_goal_and_runs_them_to_their_end() -> None:
    with session(task="fetch_cup", seed=3) as opened:
        tree = opened.load(HEAD)
        board = tree.blackboard
        assert (board["object"], board["source"], board["target"]) == ("cup", "table", "counter")
        assert board["goal"] is opened.setup.world.goals["place"]
        execution = opened.run(
            '<root BTCPP_format="4"><BehaviorTree ID="Main"><MoveArm posture="carry"/></BehaviorTree></root>'
        )
        assert (execution.ending, execution.succeeded) == (TerminationReason.FINISHED, True)
    with pytest.raises(NotConnectedError, match="the session has ended"):
        opened.run(HEAD)


def test_a_session_that_is_not_open_reports_how_to_open_it() -> None:
    with pytest.raises(AttributeError, match=r"inside a with block, as in `with session\(\.\.\.\) as s: s\.run`"):
        session(scene="kitchen").run("fetch_cup")


def test_a_session_without_a_task_has_no_goal_whatever_its_scene() -> None:
    with session(robot="omni_ur5", scene="policy_table", seed=9) as opened:
        board = opened.load(HEAD).blackboard
        assert {key: value for key, value in board.items() if value is not None}.keys() == {"start"}
        with pytest.raises(ConfigurationError, match=r"fetch_cup\.yaml:\d+: goals\[0\].placed.at: the scene has no"):
            opened.load("fetch_cup")
        with pytest.raises(ConfigurationError, match="give a tree: this session has no task"):
            opened.load()


def test_without_a_task_a_shipped_tree_brings_the_goal_of_its_own() -> None:
    with session(scene="kitchen", seed=3) as opened:
        board = opened.load("fetch_cup").blackboard
        assert board["object"] == "cup"
        assert board["goal"] is opened.setup.world.goals["place"]
        assert opened.skills.world.given_places == {"cup": "table/top"}
        assert "object" not in opened.load(HEAD).blackboard


def test_a_refused_tree_leaves_no_facts_behind_and_all_that_is_wrong_with_it_is_reported_at_once() -> None:
    with session(robot="turtle", scene="kitchen", seed=3) as opened:
        with pytest.raises(TreeLoadError, match="arm"):
            opened.load("fetch_cup")
        assert opened.skills.world.given_places == {}
        wrong = (
            '<NavigateTo goal="1;2"/>\n<FindStandPose surface="countr" stand="{stand}"/>\n<NavigateTo gaol="1;2;0"/>'
        )
        with pytest.raises(TreeLoadError) as raised:
            opened.load(
                f'<root BTCPP_format="4"><BehaviorTree ID="T"><Sequence>{wrong}</Sequence></BehaviorTree></root>'
            )
        told = [(one.line, one.message) for one in raised.value.problems]
        assert (2, "there is no surface 'countr'") in told
        assert [line for line, _ in told if line != 2] == [1, 3, 3]


@pytest.mark.slow
def test_a_task_brings_its_own_scene_and_robot() -> None:
    with session(task="navigate_kitchen", seed=3) as opened:
        task = opened.setup.config.task
        assert (task.scene, task.robot) == ("kitchen", "diff_panda")
    with session(task="pick_place_table", robot="husky_panda", seed=3) as opened:
        task = opened.setup.config.task
        assert (task.scene, task.robot) == ("pick_place_table", "husky_panda")


def test_after_a_session_the_robot_is_stopped_and_disconnected_whatever_happened() -> None:
    with pytest.raises(ZeroDivisionError), session(seed=3) as opened:
        raise ZeroDivisionError
    assert opened.robot.stopped
    with pytest.raises(NotConnectedError):
        opened.robot.clock.sleep(0.1)


def test_the_robot_is_told_roughly_where_it_starts_by_the_seed() -> None:
    setups = [prepare(load_run("fetch_cup", seed=seed)) for seed in (3, 3, 4)]
    told = [setup.world_model.base.pose for setup in setups]
    assert told[0] == told[1] != told[2]
    for setup, pose in zip(setups, told, strict=True):
        assert 0.0 < pose.distance_to(setup.world.robot_start) < 0.05


def test_a_tree_is_told_where_the_robot_stands_where_that_is_known() -> None:
    back = '<root BTCPP_format="4"><BehaviorTree ID="Main"><ReturnToStart/></BehaviorTree></root>'
    with session(seed=3) as opened:
        assert opened.load(back).blackboard["start"] == opened.skills.world.base.pose
    with session(task="navigate_from_anywhere", seed=3) as opened:
        assert not opened.run(back).succeeded
        assert opened.skills.failures[-1].error_code == "no_start"


def test_what_one_session_believes_the_next_does_not_know() -> None:
    setup = prepare(load_run("fetch_cup", seed=3))
    with open_session(setup) as first:
        first.skills.world.objects["cup"] = None
        first.skills.world.obstacles["table/surface"] = None
        first.robot.clock.sleep(0.2)
    with open_session(setup) as second:
        assert second.skills.world.objects == {}
        assert second.skills.world.obstacles == {}
        assert second.skills.world.base == setup.world_model.base


def test_a_stop_through_the_control_channel_of_a_session_can_be_cleared_by_no_tree(
    tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path_factory.mktemp("run")))
    body = '<ForceSuccess><ClearStop/></ForceSuccess><MoveArm posture="carry"/>'
    tree = f"""<root BTCPP_format="4"><BehaviorTree ID="Main"><RetryUntilSuccessful num_attempts="-1"><Inverter>
        <Sequence>{body}</Sequence></Inverter></RetryUntilSuccessful></BehaviorTree></root>"""
    answers: list[dict[str, object]] = []

    def stop_once() -> None:
        if not answers:
            (path,) = running_executors()
            answers.append(request(path, {"do": "stop"}))

    with session(seed=3) as opened:
        execution = opened.run(tree, after_tick=stop_once)
        assert answers[0]["ok"]
        assert (execution.ending, execution.why) == (TerminationReason.CANCELLED, "stopped through the control channel")
        assert opened.robot.stopped
        assert opened.skills.stop.clear() == HELD
        assert opened.robot.stopped
    assert running_executors() == []


def test_a_tree_made_of_python_nodes_runs_in_a_session() -> None:
    with session(seed=3) as opened:
        assert opened.run(Sequence("all", [MoveArm(posture="carry")])).succeeded
        native = composites.Sequence("native", memory=True, children=[MoveArm(posture="carry")])
        assert opened.run(native).succeeded


def test_an_unknown_driver_is_refused_before_anything_starts() -> None:
    with pytest.raises(ConfigurationError, match="unknown robot driver 'pybulet'; did you mean 'pybullet'"):
        prepare(load_run("fetch_cup", driver="pybulet"))


@pytest.mark.parametrize(
    ("pair", "side", "told"),
    [
        ("[cup, tabel]", 1, "there is no object, piece of furniture or link 'tabel'; did you mean 'table'?"),
        ("[fingrs, cup]", 0, "there is no object, piece of furniture or link 'fingrs'; did you mean 'fingers'?"),
        ("[cup, xyz]", 1, "there is no object, piece of furniture or link 'xyz'; known: "),
    ],
)
def test_a_contact_allowed_with_what_there_is_not_is_refused_with_its_line(
    pair: str, side: int, told: str, tmp_path: Path
) -> None:
    path = tmp_path / "mine.yaml"
    path.write_text(f"tree: fetch_cup\nscene: kitchen\nrobot: diff_panda\nallowed_contacts:\n  - {pair}\n")
    with pytest.raises(ConfigurationError) as error:
        prepare(load_run(path))
    (problem,) = error.value.problems
    assert str(problem).startswith(f"{path}:5: allowed_contacts[0][{side}]: {told}")


def test_contacts_may_be_allowed_with_walls_the_robot_and_its_links(tmp_path: Path) -> None:
    path = tmp_path / "mine.yaml"
    pairs = "[[robot, wall_0], [floor, can], [panda_hand, counter], [fingers, counter_box]]"
    path.write_text(f"tree: fetch_cup\nscene: kitchen\nrobot: diff_panda\nallowed_contacts: {pairs}\n")
    assert len(prepare(load_run(path)).config.task.allowed_contacts) == 4


def test_a_session_makes_the_controllers_that_its_trees_need_and_no_others() -> None:
    arm = '<root BTCPP_format="4"><BehaviorTree ID="Main"><MoveArm posture="carry"/></BehaviorTree></root>'
    with session(scene="kitchen", seed=3) as opened:
        skills = opened.skills
        assert not {"arm", "gripper", "head", "wrist_camera"} & vars(skills).keys()
        opened.load(arm)
        assert "arm" in vars(skills)
        assert not {"gripper", "head", "wrist_camera"} & vars(skills).keys()
        assert "grasp_pose" not in vars(skills)


def test_a_robot_of_base_and_lidar_is_localised_and_reports_what_it_lacks() -> None:
    with session(scene="kitchen", robot="turtle", seed=3) as opened:
        opened.robot.clock.sleep(1.0)
        assert opened.skills.base.last_scan is not None
        with pytest.raises(MissingPartError, match="robot turtle has no arm; it has base, lidar"):
            _ = opened.skills.arm
        assert (opened.skills.cameras, opened.skills.wrist_wrench, list(opened.skills.tactile)) == ((), None, [])
        with pytest.raises(TreeLoadError, match="LookAt::1 needs a head and a camera; robot turtle has base, lidar"):
            opened.run(HEAD)
