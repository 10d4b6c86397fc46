"""The verbs robots and robot."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest
from PIL import Image

from tests.robot_model.small_robot import SRDF, arm_urdf, written


@pytest.mark.slow
def test_robots_lists_robots_parts_and_how_many_ways_they_go_together(bestman_bt) -> None:
    answer = bestman_bt("robots", "--json")
    assert answer.code == 0
    told = json.loads(answer.out)
    assert {"diff_panda", "diff_xarm6", "omni_ur5", "husky_panda"} <= {robot["name"] for robot in told["robots"]}
    kinds = {part["kind"] for part in told["parts"]}
    assert {"base", "arm", "gripper", "suction", "structure"} <= kinds
    assert "omni_base+ur5_arm+suction" in told["combinations"]


def test_robots_are_listed_with_the_parts_that_skills_find(bestman_bt) -> None:
    told = bestman_bt("robots").out
    assert re.search(r"^  turtle +differential; no arm; no hand; \d+ kg; base, lidar$", told, re.MULTILINE)
    assert re.search(r"^  a1 .*; base, imu, battery$", told, re.MULTILINE)


def test_a_tree_is_refused_on_a_robot_that_lacks_what_its_nodes_require(bestman_bt, folder) -> None:
    (folder / "tree.xml").write_text(
        '<root BTCPP_format="4"><BehaviorTree ID="Main"><Sequence name="bring">\n'
        '<NavigateTo goal="0;0;0"/>\n<MoveArm posture="carry"/>\n<Fallback>\n<Grasp object="cup" grasps="{g}"/>\n'
        "</Fallback></Sequence></BehaviorTree></root>"
    )
    told = [
        "tree.xml:3: <MoveArm>: MoveArm::3 needs an arm; robot turtle has base, lidar",
        "tree.xml:5: <Grasp>: Grasp::5 needs an arm and a gripper; robot turtle has base, lidar",
    ]
    answer = bestman_bt("run", "tree.xml", "--scene", "kitchen", "--robot", "turtle")
    assert answer.code == 2
    assert [line for line in answer.err.splitlines() if " needs a" in line] == told
    assert not (folder / "runs").exists()
    answer = bestman_bt("validate", "tree.xml", "--robot", "turtle")
    assert answer.code == 2
    assert [line for line in answer.err.splitlines() if " needs a" in line] == told
    assert bestman_bt("validate", "tree.xml", "--robot", "diff_panda").code == 0
    assert bestman_bt("run", "--task", "navigate_kitchen", "--robot", "a1").code == 2
    (folder / "wrong.xml").write_text((folder / "tree.xml").read_text().replace("<Fallback>", "<Fallbacks>", 1))
    (folder / "wrong.yaml").write_text("parts: {base: {part: differential_base, set: {max_wz: 90}}}\n")
    (folder / "odd.xml").write_text((folder / "tree.xml").read_text().replace('goal="0;0;0"', 'gaol="0;0;0"'))
    answer = bestman_bt("validate", "wrong.xml", "odd.xml", "--robot", "turtle")
    assert [line for line in answer.err.splitlines() if " needs a" in line] == [
        line.replace("tree", "odd") for line in told
    ]
    (folder / "misspelt.xml").write_text((folder / "tree.xml").read_text().replace("grasps=", "grasp="))
    answer = bestman_bt("validate", "misspelt.xml", "--robot", "turtle")
    assert (answer.code, answer.out) == (2, "")
    assert answer.err.splitlines() == [
        told[0].replace("tree", "misspelt"),
        "misspelt.xml:5: <Grasp>: unknown port 'grasp' (did you mean 'grasps'?)",
        "misspelt.xml:5: <Grasp> port 'grasps': it is required but not given (of type list)",
        told[1].replace("tree", "misspelt"),
    ]
    answer = bestman_bt("validate", "odd.xml", "--robot", "wrong.yaml")
    assert answer.code == 2
    assert answer.err.startswith("wrong.yaml:1: parts.base.set.max_wz: needs its unit: '90 rad/s' or '90 deg/s'")
    assert "odd.xml:2: <NavigateTo>: unknown port 'gaol'" in answer.err


def test_a_node_is_shown_with_the_parts_that_it_requires(bestman_bt) -> None:
    assert "requires camera; uses head" in bestman_bt("nodes", "ScanScene").out


@pytest.mark.slow
def test_show_reports_what_a_combination_can_do_and_draws_it(bestman_bt, folder) -> None:
    answer = bestman_bt("robot", "show", "omni_base+xarm6_arm+xarm_gripper", "--png", "robot.png", "--json")
    assert answer.code == 0
    told = json.loads(answer.out)
    assert told["bases"]["base"]["drive"] == "steered"
    assert told["grippers"]["gripper"] | {"joints": 6, "max_width_m": 0.0873} == told["grippers"]["gripper"]
    picture = np.asarray(Image.open(folder / "robot.png"))
    assert picture.std() > 10.0


def test_a_combination_of_unknown_parts_starts_nothing(bestman_bt) -> None:
    answer = bestman_bt("robot", "show", "omni_base+xarm66_arm+wsg50")
    assert answer.code == 2
    assert "unknown part 'xarm66_arm'; did you mean 'xarm6_arm'" in answer.err


def test_a_combination_of_two_parts_is_told_how_to_ask(bestman_bt) -> None:
    answer = bestman_bt("robot", "show", "differential_base+xarm6_arm")
    assert answer.code == 2
    assert "a combination should have three parts, BASE+ARM+HAND, got 2" in answer.err


def test_an_import_under_a_name_that_no_part_can_have_is_refused(bestman_bt, folder) -> None:
    written(folder, arm_urdf())
    answer = bestman_bt("robot", "import", "small.urdf", "--name", "a/b c", "--into", folder)
    assert answer.code == 2
    assert "--name: 'a/b c' cannot be a part's name" in answer.err


def test_all_faults_of_an_import_are_reported_each_with_the_file_once(bestman_bt, folder) -> None:
    written(folder, arm_urdf().replace('effort="30"', 'effort="sixty"'))
    answer = bestman_bt("robot", "import", "small.urdf", "--into", folder)
    assert answer.code == 2
    assert answer.err.count("small.urdf: joint") == 7
    assert "7 errors, nothing was started" in answer.err


@pytest.mark.slow
def test_an_imported_part_can_be_built_into_a_robot(bestman_bt, folder) -> None:
    written(folder, arm_urdf())
    written(folder, SRDF, "small.srdf")
    parts = folder / "parts"
    for name, group in (("small_arm", "arm"), ("small_hand", "hand")):
        options = ("--srdf", "small.srdf", "--group", group, "--name", name, "--into", parts)
        assert bestman_bt("robot", "import", "small.urdf", *options).code == 0
    combination = f"differential_base+{parts / 'small_arm.yaml'}+{parts / 'small_hand.yaml'}"
    told = json.loads(bestman_bt("robot", "show", combination, "--json").out)
    assert told["arms"]["arm"]["joints"] == 5
    assert told["grippers"]["gripper"]["max_width_m"] == pytest.approx(0.06)
    assert "ready" in told["postures"]
    checked = json.loads(bestman_bt("robot", "check", combination, "--json").out)
    assert checked["sound"], checked


def test_an_import_replaces_nothing_unasked(bestman_bt, folder) -> None:
    written(folder, arm_urdf())
    assert bestman_bt("robot", "import", "small.urdf", "--into", folder).code == 0
    again = bestman_bt("robot", "import", "small.urdf", "--into", folder)
    assert again.code == 2
    assert "part 'small' already exists" in again.err
    assert bestman_bt("robot", "import", "small.urdf", "--into", folder, "--force").code == 0


def test_an_import_reports_what_is_wrong_with_the_file(bestman_bt, folder) -> None:
    written(folder, "<robot/>")
    answer = bestman_bt("robot", "import", "small.urdf", "--into", folder)
    assert answer.code == 2
    assert "small.urdf" in answer.err
