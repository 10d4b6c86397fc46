"""A Panda on a fixed base between a table and a shelf with 20 boxes: the scene of the ten planning problems."""

from __future__ import annotations

import json
import re
from itertools import combinations
from pathlib import Path

import numpy as np

from bestman_bt.configuration.data import pybullet_data
from bestman_bt.manipulation.collision.planning_scene import PlanningScene, SceneObstacle
from bestman_bt.messages import Box, PlacedShape, Pose
from bestman_bt.robot_model.model import RobotModel
from tests.robot_models import arm_model, gripper_model

DATA = Path(__file__).with_name("data")
PANDA = (pybullet_data() or Path()) / "franka_panda" / "panda.urdf"
FINGERS = {"panda_finger_joint1": 0.04, "panda_finger_joint2": 0.04}


def fixed_panda() -> RobotModel:
    """The Panda of pybullet_data on a fixed base; the pairs of ``panda_self_pairs.json`` count as self-collision."""
    urdf = PANDA.read_text().replace("package://", f"{PANDA.parent}/")
    links = re.findall(r'<link name="([^"]+)"', urdf)
    checked = {
        frozenset(f"panda_{n}" for n in pair) for pair in json.loads((DATA / "panda_self_pairs.json").read_text())
    }
    arm = arm_model(
        tuple(f"panda_joint{i}" for i in range(1, 8)),
        base_frame="panda_link0",
        tool_frame="panda_grasptarget",
        lower=np.array([-2.8973, -1.7628, -2.8973, -3.0718, -2.8973, -0.0175, -2.8973]),
        upper=np.array([2.8973, 1.7628, 2.8973, -0.0698, 2.8973, 3.7525, 2.8973]),
        velocity=np.array([2.175] * 4 + [2.61] * 3),
        acceleration=np.array([15, 7.5, 10, 12.5, 15, 20, 20.0]),
        effort=np.array([87.0] * 4 + [12.0] * 3),
    )
    gripper = gripper_model(
        joints=tuple(FINGERS),
        finger_links=("panda_leftfinger", "panda_rightfinger"),
        hand_link="panda_hand",
    )
    return RobotModel(
        name="fixed_panda",
        urdf=urdf,
        base_frame="panda_link0",
        parts={"arm": arm, "gripper": gripper},
        hand_of={"gripper": "arm"},
        allowed_self_pairs=frozenset(map(frozenset, combinations(links, 2))) - checked,
    )


Body = tuple[str, tuple[float, float, float], tuple[float, float, float], float]
"""Name, half extents, centre and yaw of a box: metres, radians."""


def boxes(seed: int = 0) -> list[Body]:
    """(name, half extents, centre, yaw) of the floor, the table, the shelf and the 20 boxes on them."""
    rng = np.random.default_rng(seed)
    bodies = [("floor", (2, 2, 0.01), (0, 0, -0.12), 0.0), ("table", (0.25, 0.5, 0.02), (0.6, -0.05, 0.2), 0.0)]
    bodies += [(f"board{i}", (0.35, 0.15, 0.01), (0.3, 0.7, z), 0.0) for i, z in enumerate((0.15, 0.5, 0.85, 1.2))]
    bodies += [
        ("back", (0.35, 0.01, 0.53), (0.3, 0.86, 0.68), 0.0),
        ("side_left", (0.01, 0.15, 0.53), (-0.06, 0.7, 0.68), 0.0),
        ("side_right", (0.01, 0.15, 0.53), (0.66, 0.7, 0.68), 0.0),
    ]
    for k in range(12):
        half = rng.uniform([0.02, 0.02, 0.03], [0.04, 0.04, 0.1])
        x, y = rng.uniform([0.42, -0.45], [0.8, 0.35])
        bodies.append((f"on_table{k}", tuple(half), (x, y, 0.22 + half[2] + 0.001), rng.uniform(0, 3.14)))
    for k in range(8):
        half = rng.uniform([0.02, 0.02, 0.03], [0.035, 0.035, 0.08])
        x, y = rng.uniform(0, 0.6), rng.uniform(0.72, 0.8)
        z = (0.16, 0.51, 0.86)[k % 3]
        bodies.append((f"on_shelf{k}", tuple(half), (x, y, z + half[2] + 0.001), rng.uniform(0, 3.14)))
    return bodies


def table_and_shelf(padding: float = 0.002, bodies: list[Body] | None = None) -> PlanningScene:
    """The scene with an open hand; ``bodies``: others than ``boxes()``."""
    obstacles = []
    for name, half, centre, yaw in boxes() if bodies is None else bodies:
        size = (2 * half[0], 2 * half[1], 2 * half[2])
        obstacles.append(SceneObstacle(name, (PlacedShape(Box(size), Pose.from_xyz_rpy(centre, (0, 0, yaw))),)))
    return PlanningScene(positions=FINGERS, obstacles=tuple(obstacles), padding=padding)


def problems() -> list[tuple[np.ndarray, np.ndarray]]:
    """(start, goal) of the ten problems, radians."""
    loaded = json.loads((DATA / "planning_problems.json").read_text())
    return [(np.array(problem["start"]), np.array(problem["goal"])) for problem in loaded]
