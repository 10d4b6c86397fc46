"""Pictures of an object for people: the object with its axes, and its grasps."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from bestman_bt.extras import DEFAULT_SIMULATOR
from bestman_bt.messages import Box, Cylinder, ObjectGrasp, ObjectModel, PlacedShape, Pose
from bestman_bt.registry import DRIVERS
from bestman_bt.robot_model.model import GripperModel
from hal.simulation.bodies import Viewpoint
from hal.simulation.robot import SimulatedRobot

Part = tuple[PlacedShape, tuple[float, float, float]]
AXES = (
    ((0.85, 0.1, 0.1), (0.0, math.pi / 2, 0.0)),
    ((0.1, 0.6, 0.1), (-math.pi / 2, 0.0, 0.0)),
    ((0.1, 0.2, 0.85), (0.0, 0.0, 0.0)),
)
"""Colours of x, y and z, and the turns that bring z there."""
GRASP = (0.1, 0.55, 0.75)
SHOWN = slice(0, 20, 4)
"""Number of grasps to draw: the best ones overlap."""


def object_picture(model: ObjectModel, gripper: GripperModel | None = None, side: int = 420) -> NDArray[np.uint8]:
    """Return the object with its axes (x red, y green, z blue) and, given a gripper, its best grasps beside it.

    Returns (side, side or 2·side, 3) uint8.
    """
    simulated: type[SimulatedRobot] = DRIVERS.resolve(DEFAULT_SIMULATOR)
    size = float(np.linalg.norm(model.size))
    looks = list(model.appearance)
    panels = [simulated.render_object([*looks, *_axes(size)], _viewpoint(size), side, side)]
    if gripper is not None:
        forks = [part for grasp in model.grasps[SHOWN] for part in _fork(grasp, gripper)]
        panels.append(simulated.render_object([*looks, *forks], _viewpoint(1.35 * size), side, side))
    return np.concatenate(panels, axis=1)


def _viewpoint(size: float) -> Viewpoint:
    """Return the viewpoint from the front right above."""
    eye = 2.4 * size * np.array([0.62, -0.62, 0.48])
    return Viewpoint((float(eye[0]), float(eye[1]), float(eye[2])), (0.0, 0.0, 0.0), 32.0, near=0.2 * size)


def _axes(size: float) -> list[Part]:
    length, radius = 0.55 * size, 0.006 * size
    outwards = Pose(np.array([0.0, 0.0, length / 2]))
    return [
        (PlacedShape(Cylinder(radius, length), Pose.from_xyz_rpy((0.0, 0.0, 0.0), rpy) @ outwards), color)
        for color, rpy in AXES
    ]


def _fork(grasp: ObjectGrasp, gripper: GripperModel) -> list[Part]:
    """Return two fingers, the palm behind them and a piece of wrist: thin bars in the tool frame."""
    thick, depth = 0.002, gripper.part.finger_depth
    half = grasp.width / 2 + thick / 2
    ahead = gripper.part.pad_size[1] / 2
    bars = [
        (Box((thick, thick, depth + ahead)), (0.0, half, (ahead - depth) / 2)),
        (Box((thick, thick, depth + ahead)), (0.0, -half, (ahead - depth) / 2)),
        (Box((thick, 2 * half + thick, thick)), (0.0, 0.0, -depth)),
        (Box((thick, thick, 0.02)), (0.0, 0.0, -depth - 0.01)),
    ]
    return [(PlacedShape(box, grasp.object_from_tool @ Pose(np.array(place))), GRASP) for box, place in bars]
