"""A robot with two arms: which arm a node works with, what each hand holds, and what that is to the other arm."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from behaviours.perception.perceive import camera_called
from bestman_bt.configuration.data import find_data
from bestman_bt.configuration.errors import ConfigurationError
from bestman_bt.configuration.run import load_run
from bestman_bt.engine import TreeLoadError
from bestman_bt.evaluation.audit import audit
from bestman_bt.manipulation.collision.planning_scene import PlanningScene
from bestman_bt.messages import Pose
from bestman_bt.robot_model.compose import load_robot_model
from bestman_bt.runtime.resolved_config import prepare
from bestman_bt.runtime.robot_session import RobotSession, session
from bestman_bt.world_model.world_model import HeldObject

TREE = """<root BTCPP_format="4" main_tree_to_execute="Main"><BehaviorTree ID="Main"><Sequence>
{}
</Sequence></BehaviorTree><BehaviorTree ID="Tuck"><MoveArm posture="carry" arm="{{arm}}"/></BehaviorTree></root>"""
OPEN = 0.0873
"""Metres between the fingers of a hand that nobody has moved."""


def without_default(folder: Path) -> Path:
    path = folder / "no_default.yaml"
    lines = find_data("robot", "two_arms").read_text().splitlines()
    path.write_text("\n".join(line for line in lines if not line.startswith("default_arm")))
    return path


def told(body: str, robot: str | Path, folder: Path) -> list[str]:
    tree = folder / "tree.xml"
    tree.write_text(TREE.format(body))
    try:
        prepare(load_run(None, scene="kitchen", robot=robot, settings=[f"tree={tree}"]))
    except TreeLoadError as error:
        return [str(problem).partition("tree.xml:")[2] for problem in error.problems]
    return []


@pytest.mark.parametrize(
    ("robot", "known"), [("diff_panda", "(known: arm)"), ("two_arms", "(did you mean 'left'?)")], ids=["one", "two"]
)
def test_an_arm_that_the_robot_lacks_is_reported_with_its_line_and_the_arms_there_are(
    robot: str, known: str, tmp_path: Path
) -> None:
    body = '<MoveArm posture="carry"/>\n<SubTree ID="Tuck" arm="lefft"/>\n<Holding object="cup" arm="lefft"/>'
    assert told(body, robot, tmp_path) == [
        f"{line}: <{node}> port 'arm': there is no arm 'lefft' {known}"
        for line, node in ((3, "SubTree"), (4, "Holding"))
    ]


def test_without_a_default_arm_each_node_has_to_name_one(tmp_path: Path) -> None:
    body = (
        '<MoveArm posture="carry"/>\n<MoveArm posture="carry" arm="left"/>\n<SubTree ID="Tuck"/>\n'
        '<SubTree ID="Tuck" arm="right"/>\n<Holding object="cup"/>\n'
        '<SetBlackboard value="left" output_key="side"/>\n<MoveArm posture="carry" arm="{side}"/>'
    )
    problems = told(body, without_default(tmp_path), tmp_path)
    assert [problem.partition(":")[0] for problem in problems] == ["2", "9"]
    assert problems[0] == (
        "2: <MoveArm> port 'arm': MoveArm::2 names no arm; robot no_default has left, right and no default_arm "
        '(give arm="left")'
    )
    assert told(body, "two_arms", tmp_path) == []


def test_faults_of_the_robot_file_come_at_once_with_a_default_arm_that_there_is_not(tmp_path: Path) -> None:
    path = tmp_path / "twice.yaml"
    text = find_data("robot", "two_arms").read_text().replace("default_arm: right", "default_arm: rihgt")
    path.write_text(text.replace("  mast: ", "  left:        {part: xarm6_arm, mount: column_top}\n  mast: "))
    with pytest.raises(ConfigurationError) as refused:
        load_robot_model(path)
    found = [str(problem) for problem in refused.value.problems]
    assert len(found) == 2
    assert any("parts.left: is given twice" in fault for fault in found)
    assert any("default_arm: the robot has no arm 'rihgt'; did you mean 'right'?" in fault for fault in found)


def test_an_arm_without_a_hand_cannot_grasp(tmp_path: Path) -> None:
    path = tmp_path / "one_hand.yaml"
    lines = find_data("robot", "two_arms").read_text().splitlines()
    hand = next(index for index, line in enumerate(lines) if line.startswith("  left_gripper:"))
    camera = next(index for index, line in enumerate(lines) if line.startswith("  left_wrist_camera:"))
    right = "\n".join(line for index, line in enumerate(lines) if index not in (hand, camera, camera + 1))
    path.write_text(right.replace("right_gripper_xarm_gripper_base_link", "xarm_gripper_base_link"))
    body = '<Grasp object="cup" grasps="{g}" arm="left"/>\n<Grasp object="cup" grasps="{g}" arm="right"/>'
    (problem,) = told(body, path, tmp_path)
    assert "Grasp::2 needs a gripper, and the arm left of robot one_hand carries none" in problem


def test_a_leaf_of_ones_own_without_the_port_needs_a_default_arm(tmp_path: Path) -> None:
    (tmp_path / "own.py").write_text(
        "from behaviours.skill import Skill\n\n\nclass Wave(Skill):\n    REQUIRES = ('arm',)\n"
    )
    plain = tmp_path / "plain.xml"
    plain.write_text(TREE.format("<Wave/>"))
    robot, own = without_default(tmp_path), [str(tmp_path / "own.py")]
    config = load_run(None, scene="kitchen", robot=robot, settings=[f"tree={plain}"], plugins=own)
    with pytest.raises(TreeLoadError, match=r"Wave::2 names no arm.*give the robot a default_arm: left"):
        prepare(config)


@pytest.fixture(scope="module")
def opened() -> Iterator[RobotSession]:
    with session(scene="two_things", robot="two_arms", seed=1) as opened:
        yield opened


@pytest.fixture
def cup_left(opened: RobotSession) -> Iterator[HeldObject]:
    """Believed to be in the left hand."""
    held = HeldObject("cup", opened.skills.world.models["cup"], Pose(), OPEN)
    opened.skills.for_arm("left").held = held
    yield held
    opened.skills.world.hands.clear()


def test_each_arm_has_its_own_hand_sensors_and_kinematics_and_the_rest_is_shared(opened: RobotSession) -> None:
    left, right = (opened.skills.for_arm(arm) for arm in ("left", "right"))
    assert opened.skills.for_arm() is right  # the default_arm
    assert (left.arm.name, left.gripper.name) == ("left", "left_gripper")
    assert (right.arm.name, right.gripper.name) == ("right", "right_gripper")
    assert [skills.wrist_camera.name for skills in (left, right)] == ["left_wrist_camera", "right_wrist_camera"]
    assert left.wrist_wrench.frame != right.wrist_wrench.frame
    assert left.base_from_tool().position[1] == pytest.approx(-right.base_from_tool().position[1], abs=0.01)
    assert left.base is right.base
    assert left.detection is right.detection


def test_what_one_hand_holds_stays_there_and_is_in_the_way_of_the_other_arm(
    opened: RobotSession, cup_left: HeldObject
) -> None:
    left, right = (opened.skills.for_arm(arm) for arm in ("left", "right"))
    assert (left.held, right.held) == (cup_left, None)
    assert left.planning_scene().attached.name == "cup"
    scene = right.planning_scene()
    assert scene.attached is None
    assert [carried.name for carried in scene.carried] == ["cup"]
    at_the_cup = right.kinematics.solve(
        left.base_from_tool() @ Pose(np.array([0.0, 0.04, 0.0])), right.arm_positions(), right.rng, attempts=60
    )
    assert at_the_cup.found
    pairs = right.arm_world(scene).colliding_pairs(at_the_cup.best)
    assert any("cup" in pair for pair in pairs)


@pytest.mark.slow
def test_the_base_keeps_room_for_both_arms_and_what_they_hold(opened: RobotSession, cup_left: HeldObject) -> None:
    skills = opened.skills
    for arm in ("left", "right"):
        tool = skills.for_arm(arm).base_from_tool().position[:2]
        outline = skills.footprint().corners
        assert outline[:, 0].min() < tool[0] < outline[:, 0].max()


def test_holding_asks_the_hand_that_is_named_or_any(opened: RobotSession, cup_left: HeldObject) -> None:
    def holds(arm: str) -> bool:
        tree = opened.load(
            f'<root BTCPP_format="4"><BehaviorTree ID="M"><Holding object="cup"{arm}/></BehaviorTree></root>'
        )
        return opened.executor(tree).run().succeeded

    assert holds("")
    assert holds(' arm="left"')
    assert not holds(' arm="right"')
    assert opened.skills.world.hands == {"left": cup_left}


def test_cameras_are_found_by_their_names(opened: RobotSession) -> None:
    named = [camera_called(opened.skills, name).name for name in ("head", "wrist", "left_wrist_camera")]
    assert named == ["head_camera", "right_wrist_camera", "left_wrist_camera"]
    assert [camera.name for camera in opened.skills.cameras] == [
        "head_camera",
        "left_wrist_camera",
        "right_wrist_camera",
    ]


BOTH = """<root BTCPP_format="4" main_tree_to_execute="Main"><BehaviorTree ID="Main"><Sequence>
<Parallel success_count="2"><MoveArm posture="back" arm="left"/><MoveArm posture="back" arm="right"/></Parallel>
<Parallel success_count="2"><MoveArm posture="front" arm="left"/><MoveArm posture="front" arm="right"/></Parallel>
</Sequence></BehaviorTree></root>"""
CROSSING = """postures:
  back: {left: [-0.68, -1.3, -1.53, 0, 1.87, 0], right: [0.68, -1.3, -1.53, 0, 1.87, 0]}
  front: {left: [-0.17, -0.1, -0.53, 0, 0.98, 0], right: [0.17, -0.1, -0.53, 0, 0.98, 0]}
"""
"""At both the hands are apart; half way between, they would be in one place."""


@pytest.mark.slow
def test_arms_that_move_at_the_same_time_keep_apart_where_their_ways_cross(tmp_path: Path) -> None:
    """By the encoders: the simulation lets the arms of one robot pass through each other."""
    robot = tmp_path / "crossing.yaml"
    robot.write_text(find_data("robot", "two_arms").read_text().replace("postures:\n", CROSSING))
    with session(scene="two_things", robot=robot, seed=1) as opened:
        left = opened.skills.for_arm("left")
        seen: list[dict[str, float]] = []
        opened.robot.clock.every(0.05, lambda: seen.append(dict(left.joints.positions())))
        assert opened.executor(opened.load(BOTH)).run().succeeded, opened.skills.failures
        assert audit(opened.robot.audit_record()).collisions == ()
        names = left.arm_model.joint_names
        worlds = ((left.arm_world(PlanningScene(at)), np.array([at[name] for name in names])) for at in seen)
        assert min(world.distance(at) for world, at in worlds) > 0.005
