"""Models of single parts with few particulars, for tests that need no whole robot."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import CameraIntrinsics
from bestman_bt.robot_model.model import ArmModel, GripperModel, JointGroupModel, WheeledBaseModel
from bestman_bt.robot_model.part_config import ArmPart, BasePart, GripperPart, JointGroupPart
from bestman_bt.robot_model.part_fields import JointLimitsConfig
from bestman_bt.robot_model.sensor_parts import CameraPart

Limit = Sequence[float] | NDArray[np.float64] | float
USUAL_LIMITS = {"lower": -1.0, "upper": 1.0, "velocity": 1.0, "acceleration": 1.0, "effort": 1.0}


def arm_model(
    joints: Sequence[str] = ("joint",), base_frame: str = "base", tool_frame: str = "tool", **limits: Limit
) -> ArmModel:
    """An arm; limits that are not given are ±1 and 1."""
    part = ArmPart(kind="arm", tip=tool_frame, joints=tuple(joints), limits=_limits(len(joints), limits))
    return ArmModel(part, base_frame, tool_frame)


def joint_group_model(joints: Sequence[str], **limits: Limit) -> JointGroupModel:
    """Joints that carry no hand; limits that are not given are ±1 and 1."""
    return JointGroupModel(
        JointGroupPart(kind="joint_group", joints=tuple(joints), limits=_limits(len(joints), limits))
    )


def with_limits(model: ArmModel, **limits: Limit) -> ArmModel:
    """``model`` with other limits."""
    kept = {name: getattr(model, name) for name in USUAL_LIMITS}
    part = replace(model.part, limits=_limits(len(model.joint_names), {**kept, **limits}))
    return replace(model, part=part)


def with_part(model: GripperModel, **changes: Any) -> GripperModel:
    """``model`` with another part."""
    return replace(model, part=replace(model.part, **changes))


def _limits(count: int, limits: Mapping[str, Limit]) -> JointLimitsConfig:
    rows = {name: np.full(count, limits.get(name, usual)).tolist() for name, usual in USUAL_LIMITS.items()}
    return JointLimitsConfig(**{name: tuple(row) for name, row in rows.items()})


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


def gripper_model(hand_link: str = "hand", linkage: tuple[str, ...] = (), **changes: Any) -> GripperModel:
    """A parallel gripper with two sliding fingers; ``changes``: of its part."""
    usual = {
        "kind": "gripper",
        "tool": "tool",
        "joints": ("left", "right"),
        "finger_links": ("left_finger", "right_finger"),
        "min_width": 0.0,
        "max_width": 0.08,
        "max_speed": 0.1,
        "max_force": 40.0,
        "finger_depth": 0.0466,
        "pad_size": (0.02, 0.02),
        "friction": 0.8,
    }
    return GripperModel(GripperPart(**{**usual, **changes}), hand_link, linkage=linkage)


def seen_through(camera: CameraPart, k: CameraIntrinsics) -> CameraPart:
    """The same camera with another pinhole and lens."""
    return replace(
        camera,
        width=k.width,
        height=k.height,
        focal_length=(k.fx, k.fy),
        principal_point=(k.cx, k.cy),
        distortion=k.distortion,
    )
