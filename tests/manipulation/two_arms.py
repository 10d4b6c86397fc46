"""A robot with two arms of boxes on a post: its base frame is not the root, an arm lists its joints from the tip."""

from __future__ import annotations

from itertools import combinations

import numpy as np

from bestman_bt.robot_model.model import ArmModel, GripperModel, RobotModel
from tests.robot_models import arm_model, gripper_model

BASE = (0.2, -0.1, 0.3)
"""Where the base frame lies in the root frame, metres; it is turned by 0.5 rad about z."""
BASE_YAW = 0.5
JOINTS = ("lift", "pan", "shoulder", "elbow", "roll", "wrist", "turn")
AXES = {"lift": "0 0 1", "pan": "0 0 1", "shoulder": "0 1 0", "elbow": "0 1 0", "roll": "0 0 1", "wrist": "0 1 0"}
HEIGHTS = {"lift": 0.5, "pan": 0.05, "shoulder": 0.05, "elbow": 0.3, "roll": 0.15, "wrist": 0.15, "turn": 0.06}
"""Of each joint above the one before."""
LOWER = np.array([0.0, -2.8, -2.0, -2.4, -2.8, -2.0, -2.8])
UPPER = np.array([0.2, 2.8, 2.0, 2.4, 2.8, 2.0, 2.8])
HAND = ("palm", "finger1", "finger2")
HOME = dict(zip(JOINTS, (0.1, 0.0, 0.6, 1.2, 0.0, 0.8, 0.0), strict=True))


def two_arms() -> RobotModel:
    """``left`` at y = 0.25 and ``right`` at y = -0.25 of the root; ``right`` names its joints from tip to root."""
    names = {"left": JOINTS, "right": JOINTS[::-1]}
    arms = {side: _arm_model(side, order) for side, order in names.items()}
    links = ["root", "base_link"] + [
        f"{side}_{part}" for side in arms for part in (*(f"{joint}_link" for joint in JOINTS), *HAND)
    ]
    hands = [{f"{side}_{part}" for part in HAND} for side in arms]
    checked = {frozenset((a, b)) for a in hands[0] for b in hands[1]}
    checked |= {frozenset((link, "root")) for hand in hands for link in hand}
    x, y, z = BASE
    urdf = (
        '<robot name="two_arms"><link name="root"><inertial><mass value="10"/><inertia ixx="1" iyy="1" izz="1" '
        'ixy="0" ixz="0" iyz="0"/></inertial><collision><origin xyz="0 0 0.25"/><geometry><box size="0.1 0.3 0.5"/>'
        '</geometry></collision></link><link name="base_link"/><joint name="to_base" type="fixed"><parent link="root"/>'
        f'<child link="base_link"/><origin xyz="{x} {y} {z}" rpy="0 0 {BASE_YAW}"/></joint>'
        + "".join(_arm(side, place) for side, place in (("left", 0.25), ("right", -0.25)))
        + "</robot>"
    )
    return RobotModel(
        name="two_arms",
        urdf=urdf,
        base_frame="base_link",
        parts={**arms, **{f"{side}_gripper": _gripper(side) for side in arms}},
        hand_of={f"{side}_gripper": side for side in arms},
        postures={"home": {f"{side}_{joint}": HOME[joint] for side in arms for joint in JOINTS}},
        allowed_self_pairs=frozenset(map(frozenset, combinations(links, 2))) - checked,
    )


def home(robot: RobotModel, side: str) -> np.ndarray:
    """Joint positions (7,) in the arm's own order."""
    return robot.posture("home", robot.of(ArmModel)[side].joint_names)


def _arm_model(side: str, order: tuple[str, ...]) -> ArmModel:
    places = [JOINTS.index(joint) for joint in order]
    return arm_model(
        tuple(f"{side}_{joint}" for joint in order),
        base_frame="root",
        tool_frame=f"{side}_tool",
        lower=LOWER[places],
        upper=UPPER[places],
        velocity=np.linspace(0.5, 2.0, 7)[places],
        acceleration=np.linspace(2.0, 8.0, 7)[places],
        effort=np.full(7, 50.0),
    )


def _gripper(side: str) -> GripperModel:
    return gripper_model(
        joints=(f"{side}_slide1", f"{side}_slide2"),
        finger_links=(f"{side}_finger1", f"{side}_finger2"),
        hand_link=f"{side}_palm",
        finger_depth=0.05,
    )


def _arm(side: str, y: float) -> str:
    text, parent, place = "", "root", (0.0, y, 0.0)
    for joint in JOINTS:
        name, height = f"{side}_{joint}", HEIGHTS[joint]
        kind, (low, high) = (
            ("prismatic", (0.0, 0.2))
            if joint == "lift"
            else ("revolute", (LOWER[JOINTS.index(joint)], UPPER[JOINTS.index(joint)]))
        )
        text += _joint(
            name, kind, parent, f"{name}_link", (place[0], place[1], place[2] + height), AXES.get(joint, "0 0 1")
        )
        text = text.replace("LIMITS", f'<limit lower="{low}" upper="{high}" velocity="2" effort="50"/>')
        text += _link(f"{name}_link", "0.03 0.03 0.04", (0.0, 0.0, 0.02))
        parent, place = f"{name}_link", (0.0, 0.0, 0.0)
    text += _joint(f"{side}_to_palm", "fixed", parent, f"{side}_palm", (0.0, 0.0, 0.05), "0 0 1").replace("LIMITS", "")
    text += _link(f"{side}_palm", "0.04 0.12 0.02", (0.0, 0.0, 0.0))
    for number, sign in ((1, 1), (2, -1)):
        finger = f"{side}_finger{number}"
        text += _joint(f"{side}_slide{number}", "prismatic", f"{side}_palm", finger, (0.0, 0.0, 0.04), f"0 {sign} 0")
        text = text.replace("LIMITS", '<limit lower="0" upper="0.04" velocity="1" effort="20"/>')
        text += _link(finger, "0.02 0.01 0.05", (0.0, 0.005 * sign, 0.0))
    text += _joint(f"{side}_to_tool", "fixed", f"{side}_palm", f"{side}_tool", (0.0, 0.0, 0.06), "0 0 1")
    return text.replace("LIMITS", "") + f'<link name="{side}_tool"/>'


def _joint(name: str, kind: str, parent: str, child: str, xyz: tuple[float, ...], axis: str) -> str:
    x, y, z = xyz
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{x} {y} {z}"/><axis xyz="{axis}"/>LIMITS</joint>'
    )


def _link(name: str, size: str, xyz: tuple[float, ...]) -> str:
    x, y, z = xyz
    return (
        f'<link name="{name}"><inertial><origin xyz="{x} {y} {z}"/><mass value="0.5"/><inertia ixx="0.001" '
        'iyy="0.001" izz="0.001" ixy="0" ixz="0" iyz="0"/></inertial>'
        f'<collision><origin xyz="{x} {y} {z}"/><geometry><box size="{size}"/></geometry></collision></link>'
    )
