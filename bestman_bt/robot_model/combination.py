"""Robots by rule: a base, an arm on a column on its deck, an end effector on the arm."""

from __future__ import annotations

from bestman_bt.configuration import Document
from bestman_bt.robot_model.compose import compose_robot
from bestman_bt.robot_model.model import RobotModel


def combine(base: str, arm: str, hand: str, column: str = "column") -> RobotModel:
    """The robot ``<base>+<arm>+<hand>``, its parts called ``base``, ``column``, ``arm`` and ``gripper``.

    Names or paths of part descriptions. Raises ConfigurationError if one is unknown or has no place for the next one.
    """
    parts = {
        "base": {"part": base},
        "column": {"part": column, "mount": "base"},
        "arm": {"part": arm, "mount": "column"},
        "gripper": {"part": hand, "mount": "arm"},
    }
    return compose_robot("+".join((base, arm, hand)), Document({"parts": parts}))
