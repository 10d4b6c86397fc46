"""Kinds of parts that skills require."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

from bestman_bt.errors import RobotError

if TYPE_CHECKING:
    from bestman_bt.robot_model.model import RobotModel

PartKind: TypeAlias = Literal[
    "base", "lidar", "arm", "gripper", "head", "camera", "wrist_camera", "force_torque", "tactile"
]
"""``head``: joints, not of an arm, that turn a camera. ``camera``: any; ``wrist_camera``: carried by an arm."""

WORDS: dict[PartKind, str] = {
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


class MissingPartError(RobotError, LookupError):
    """A skill used a part that its robot lacks and that it had not declared in ``REQUIRES``."""

    code = "missing_part"


def parts_by_kind(robot: RobotModel, there: Collection[str]) -> dict[PartKind, tuple[str, ...]]:
    """Return kind → names of the robot's parts among ``there``; kinds without parts are left out."""
    from bestman_bt.robot_model.model import ArmModel, BaseModel, GripperModel, JointGroupModel
    from bestman_bt.robot_model.sensor_parts import CameraPart, LidarPart, MountedForceTorque, TactilePart
    from bestman_bt.robot_model.urdf_tree import arm_of

    of_kind: dict[PartKind, Iterable[str]] = {
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
    found = {kind: tuple(name for name in names if name in there) for kind, names in of_kind.items()}
    return {kind: names for kind, names in found.items() if names}


def parts_in_words(node: type[Any]) -> str:
    """Return the declared parts of a node class: ``requires arm, gripper; uses wrist_camera``; may be empty."""
    declared = {"requires": getattr(node, "REQUIRES", ()), "uses": getattr(node, "USES", ())}
    return "; ".join(f"{word} {', '.join(kinds)}" for word, kinds in declared.items() if kinds)


def listed(kinds: Iterable[PartKind]) -> str:
    """Return the kinds as text: ``an arm and a gripper``."""
    words = [WORDS[kind] for kind in kinds]
    return " and ".join([", ".join(words[:-1]), words[-1]] if len(words) > 1 else words)
