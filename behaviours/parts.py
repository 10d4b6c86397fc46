"""Kinds of parts that skills require."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

from bestman_bt.errors import RobotError
from bestman_bt.registry import PARTS

if TYPE_CHECKING:
    from bestman_bt.robot_model.model import RobotModel

PartKind: TypeAlias = Literal[
    "base", "lidar", "arm", "gripper", "head", "camera", "wrist_camera", "force_torque", "tactile"
]
"""Kinds with an attribute of ``SkillContext``. ``head``: joints, not of an arm, that turn a camera. ``camera``: any;
``wrist_camera``: carried by an arm.
"""

WORDS: dict[str, str] = {
    "base": "a mobile base",
    "lidar": "a lidar",
    "arm": "an arm",
    "gripper": "a gripper",
    "head": "a head",
    "camera": "a camera",
    "wrist_camera": "a camera on the hand",
    "force_torque": "a force-torque sensor",
    "tactile": "a tactile sensor",
}


_CALLED_OTHERWISE = frozenset({"legged_base", "suction", "joint_group", "structure"})
"""Kinds of parts that skills require by a word of ``WORDS``, or not at all."""


def kinds_for_skills() -> list[str]:
    """Return the kinds of parts that a skill may require: those of ``WORDS``, and others by their registered name."""
    return [*WORDS, *sorted(set(PARTS.names()) - WORDS.keys() - _CALLED_OTHERWISE)]


class MissingPartError(RobotError, LookupError):
    """A skill used a part that its robot lacks and that it had not declared in ``REQUIRES``."""

    code = "missing_part"


def parts_by_kind(robot: RobotModel, there: Collection[str]) -> dict[str, tuple[str, ...]]:
    """Return kind → names of the robot's parts among ``there``; kinds without parts are omitted."""
    from bestman_bt.robot_model.model import ArmModel, BaseModel, GripperModel, JointGroupModel
    from bestman_bt.robot_model.sensor_parts import CameraPart, LidarPart, MountedForceTorque, TactilePart
    from bestman_bt.robot_model.urdf_tree import arm_of

    of_kind: dict[str, Iterable[str]] = {
        "base": robot.of(BaseModel),
        "lidar": robot.of(LidarPart),
        "arm": robot.of(ArmModel),
        "gripper": robot.of(GripperModel),
        "head": robot.of(JointGroupModel),
        "camera": robot.of(CameraPart),
        "wrist_camera": [name for name in robot.of(CameraPart) if arm_of(robot, name) is not None],
        "force_torque": robot.of(MountedForceTorque),
        "tactile": robot.of(TactilePart),
    }
    for kind in dict.fromkeys(map(robot.kind, robot.parts)):
        if kind not in _CALLED_OTHERWISE:
            of_kind.setdefault(kind, [name for name in robot.parts if robot.kind(name) == kind])
    found = {kind: tuple(name for name in names if name in there) for kind, names in of_kind.items()}
    return {kind: names for kind, names in found.items() if names}


def describe_required_parts(node: type[Any]) -> str:
    """Return the declared parts of a node class: ``requires arm, gripper; uses wrist_camera``; may be empty."""
    declared = {"requires": getattr(node, "REQUIRES", ()), "uses": getattr(node, "USES", ())}
    return "; ".join(f"{word} {', '.join(kinds)}" for word, kinds in declared.items() if kinds)


def listed(kinds: Iterable[str]) -> str:
    """Return the kinds as text: ``an arm and a gripper``."""
    words = [WORDS.get(kind, f"{'an' if kind[0] in 'aeiou' else 'a'} {kind.replace('_', ' ')}") for kind in kinds]
    return " and ".join([", ".join(words[:-1]), words[-1]] if len(words) > 1 else words)
