"""Trees on a simulated robot that stands at the table, in arm's reach of the cup, and how it moves."""

from __future__ import annotations

import math

import numpy as np

from bestman_bt.engine import RUNNING, Tree
from bestman_bt.runtime.robot_session import RobotSession
from hal.api import Arm, JointGroup, MobileBase

AT_THE_TABLE = (
    "scene.robot_start.x=[2.3, 2.4]",
    "scene.robot_start.y=[-0.5, -0.3]",
    "scene.robot_start.yaw=[0.0, 0.1]",
)
"""For trees with places of the map in them; see ``standing_at_a_table`` for all others."""
PERIOD = 0.05


def standing_at_a_table(heading: float) -> tuple[str, ...]:
    """Settings of a kitchen in which the robot faces ``heading``, degrees, with the table that far turned before it."""
    yaw = math.radians(heading)
    ahead = np.array([math.cos(yaw), math.sin(yaw)])
    table, robot = np.array([2.1, 0.0]) + 0.45 * ahead, np.array([2.1, 0.0]) - 0.4 * ahead
    return (
        f"scene.furniture.table.at=[{table[0]:.4f}, {table[1]:.4f}, {yaw:.6f}]",
        f"scene.robot_start.x=[{robot[0] - 0.03:.4f}, {robot[0] + 0.03:.4f}]",
        f"scene.robot_start.y=[{robot[1] - 0.03:.4f}, {robot[1] + 0.03:.4f}]",
        f"scene.robot_start.yaw=[{yaw - 0.05:.4f}, {yaw + 0.05:.4f}]",
    )


def tree_of(body: str) -> str:
    """A tree file with one tree."""
    return f'<root BTCPP_format="4"><BehaviorTree ID="Main">{body}</BehaviorTree></root>'


def tick(tree: Tree, times: int = 1) -> int:
    """Tick with time passing in between; stops where the root does not run any more. Returns the last status."""
    for _ in range(times):
        status = tree.tick_once()
        if status != RUNNING:
            break
        tree.sleep(PERIOD)
    return status


def fastest(robot_session: RobotSession) -> float:
    """How fast the robot moves, by its encoders: the largest of its velocities, m/s or rad/s."""
    parts = robot_session.robot.parts
    groups = [part.velocities() for part in parts.values() if isinstance(part, Arm | JointGroup)]
    base = next(part for part in parts.values() if isinstance(part, MobileBase)).velocity()
    return float(max(np.abs(np.concatenate(groups)).max(), abs(base.vx), abs(base.wz)))


def failures_of(robot_session: RobotSession, count: int = 1) -> list[tuple[str, str]]:
    """Codes and texts of the last failures that were told."""
    return [(failure.error_code, failure.why) for failure in robot_session.skills.failures[-count:]]
