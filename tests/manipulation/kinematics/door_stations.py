"""The tool poses that open a door by a bar: for each angle of the door, the hand may turn about the bar."""

from __future__ import annotations

import math

import numpy as np

from bestman_bt.messages import Pose


def door_stations(
    hinge: Pose,
    radius: float,
    side: int,
    sweep: float = math.radians(80),
    stations: int = 18,
    turns: np.ndarray | None = None,
) -> list[list[Pose]]:
    """``hinge``: closed, the door lies along its y axis towards ``side`` (±1) and opens towards its -x."""
    turns = np.radians(np.linspace(-50, 50, 11)) if turns is None else turns
    bar = Pose(np.array([-0.05, side * radius, 0.0]))
    grasp = Pose.from_xyz_rpy((0, 0, 0), (0, math.pi / 2, 0))
    return [
        [
            hinge
            @ Pose.from_xyz_rpy((0, 0, 0), (0, 0, side * angle))
            @ bar
            @ Pose.from_xyz_rpy((0, 0, 0), (0, 0, turn))
            @ grasp
            for turn in turns
        ]
        for angle in np.linspace(0.0, sweep, stations)
    ]
