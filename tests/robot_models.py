"""Models of single parts with few particulars, for tests that need no whole robot."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from bestman_bt.robot_model import ArmModel, BasePart, GripperModel, WheeledBaseModel


def arm_model(
    joints: Sequence[str] = ("joint",),
    base_frame: str = "base",
    tool_frame: str = "tool",
    **limits: Sequence[float] | float,
) -> ArmModel:
    """An arm; limits that are not given are ±1 and 1."""
    usual = {"lower": -1.0, "upper": 1.0, "velocity": 1.0, "acceleration": 1.0, "effort": 1.0}
    arrays = {name: np.full(len(joints), limits.get(name, value)) for name, value in usual.items()}
    return ArmModel(tuple(joints), base_frame, tool_frame, **arrays)


def base_model(footprint: Iterable[Sequence[float]] = (), **changes: Any) -> WheeledBaseModel:
    """A differential base; ``changes``: of its part."""
    usual = {
        "kind": "base",
        "drive": "differential",
        "wheel_joints": (),
        "wheel_radius": 0.1,
        "track": 0.4,
        "wheel_torque": 1.0,
        "max_vx": 0.6,
        "max_wz": 1.2,
        "max_acceleration": 0.6,
        "max_angular_acceleration": 2.0,
    }
    corners = tuple((float(x), float(y)) for x, y in footprint)
    return WheeledBaseModel(BasePart(**{**usual, **changes}), "base", corners)


def gripper_model(**changes: Any) -> GripperModel:
    """A parallel gripper with two sliding fingers."""
    usual = {
        "joint_names": ("left", "right"),
        "finger_links": ("left_finger", "right_finger"),
        "hand_link": "hand",
        "min_width": 0.0,
        "max_width": 0.08,
        "max_speed": 0.1,
        "max_force": 40.0,
        "finger_depth": 0.0466,
        "pad_size": (0.02, 0.02),
        "friction": 0.8,
    }
    return GripperModel(**{**usual, **changes})
