"""The models of sensors and batteries from their descriptions."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

from bestman_bt.messages import CameraIntrinsics
from bestman_bt.robot_model.part_fields import PartConfig
from bestman_bt.robot_model.sensor_models import (
    BatteryModel,
    CameraModel,
    ForceTorqueModel,
    ImuModel,
    LidarModel,
    TactileModel,
)
from bestman_bt.robot_model.sensor_part_config import (
    BatteryPart,
    CameraPart,
    ForceTorquePart,
    ImuPart,
    LidarPart,
    TactilePart,
)


def camera_model(camera: CameraPart) -> CameraModel:
    """Of an RGB-D camera; a calibration's focal length and principal point come before what the angle of view says."""
    focal = camera.height / 2 / math.tan(camera.vertical_fov / 2)
    focal_length = camera.focal_length or (focal, focal)
    centre = camera.principal_point or ((camera.width - 1) / 2, (camera.height - 1) / 2)
    intrinsics = CameraIntrinsics(camera.width, camera.height, *focal_length, *centre, camera.distortion)
    same = _same_fields(camera, CameraModel, but=("optical_frame", "intrinsics"))
    return CameraModel(optical_frame=camera.frame, intrinsics=intrinsics, **same)


def lidar_model(lidar: LidarPart) -> LidarModel:
    """Of a planar lidar."""
    return LidarModel(**_same_fields(lidar, LidarModel))


def force_torque_model(sensor: ForceTorquePart, joints: tuple[str, ...]) -> ForceTorqueModel:
    """Of a force-torque sensor; ``joints``: by which what it feels hangs on its frame."""
    return ForceTorqueModel(joints=joints, **_same_fields(sensor, ForceTorqueModel, but=("joints",)))


def imu_model(imu: ImuPart) -> ImuModel:
    """Of an inertial measurement unit."""
    return ImuModel(**_same_fields(imu, ImuModel))


def tactile_model(pad: TactilePart) -> TactileModel:
    """Of a pad of taxels."""
    return TactileModel(**_same_fields(pad, TactileModel))


def battery_model(battery: BatteryPart) -> BatteryModel:
    """Of a battery."""
    return BatteryModel(**_same_fields(battery, BatteryModel))


def _same_fields(part: PartConfig, model: type, but: tuple[str, ...] = ()) -> dict[str, Any]:
    """The fields of the model that the part's description has under the same names."""
    return {field.name: getattr(part, field.name) for field in dataclasses.fields(model) if field.name not in but}
