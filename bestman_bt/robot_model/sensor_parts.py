"""Sensors and batteries: one dataclass per kind for YAML and programs; SI units.

``latency``: seconds from the measurement, which the stamp shows, until the reading is available. Without one, cameras,
lidars and force-torque sensors measure on request, with one at their ``rate``; all others always measure at their
``rate``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

from bestman_bt.configuration.quantity import (
    Acceleration,
    AngleLimit,
    AngularSpeed,
    AngularSpeedLimit,
    Distance,
    Energy,
    Factor,
    Force,
    ForceLimit,
    Length,
    LengthLimit,
    LensDistortion,
    Number,
    PositiveLength,
    PositiveLengthLimit,
    PositiveShare,
    PositiveWholeNumber,
    Power,
    Rate,
    Resistance,
    Share,
    Size2,
    Speed,
    Time,
    Torque,
    TorqueLimit,
    Voltage,
)
from bestman_bt.messages import CameraIntrinsics
from bestman_bt.robot_model.part_fields import PartConfig


@dataclass(frozen=True, kw_only=True)
class CameraPart(PartConfig):
    """An RGB-D camera.

    ``frame``: the link with x right, y down, z forward. ``focal_length`` (fx, fy) and ``principal_point`` (cx, cy),
    pixels, come from a calibration and replace ``vertical_fov`` and the image centre. ``distortion``: of the lens,
    OpenCV's k1, k2, p1, p2 and optionally k3.
    Depth noise: standard deviation ``noise_base + noise_quadratic * max(0, z - 0.4)²`` metres; a fraction
    ``edge_dropout`` of the pixels at depth edges and ``dropout`` of all others have no depth; the rest is quantised to
    ``depth_step`` metres. Systematic error: the camera measures ``depth_scale * z + depth_offset``; simulated cameras
    have this error, and the sensor removes it.
    """

    kind: Literal["camera"]
    frame: str
    width: PositiveWholeNumber
    height: PositiveWholeNumber
    vertical_fov: AngleLimit
    near: PositiveLengthLimit
    far: PositiveLengthLimit
    noise_base: Length
    noise_quadratic: Length
    edge_dropout: Share
    dropout: Share
    depth_step: Distance = 0.001
    depth_scale: Factor = 1.0
    depth_offset: Length = 0.0
    focal_length: tuple[Factor, Factor] | None = None
    principal_point: tuple[Number, Number] | None = None
    distortion: LensDistortion = ()
    rate: Rate = 30.0
    latency: Time = 0.0

    @property
    def optical_frame(self) -> str:
        """``frame``, by the name that ``hal.api.Camera`` gives it."""
        return self.frame

    @cached_property
    def intrinsics(self) -> CameraIntrinsics:
        """The pinhole and its lens, pixels."""
        focal = self.height / 2 / math.tan(self.vertical_fov / 2)
        fx, fy = self.focal_length or (focal, focal)
        cx, cy = self.principal_point or ((self.width - 1) / 2, (self.height - 1) / 2)
        return CameraIntrinsics(self.width, self.height, fx, fy, cx, cy, self.distortion)


@dataclass(frozen=True, kw_only=True)
class LidarPart(PartConfig):
    """A planar lidar; beams evenly over [angle_min, angle_max)."""

    kind: Literal["lidar"]
    frame: str
    beams: PositiveWholeNumber
    angle_min: AngleLimit
    angle_max: AngleLimit
    range_min: LengthLimit
    range_max: PositiveLengthLimit
    noise: Length
    rate: Rate
    latency: Time = 0.0


@dataclass(frozen=True, kw_only=True)
class ForceTorquePart(PartConfig):
    """A six-axis force-torque sensor: it measures the load mounted on its link ``frame``.

    ``noise_force``, ``noise_torque``: standard deviations of each reading; ``offset_force``, ``offset_torque``: of the
    constant error of each axis, which is observable only at rest. It saturates at ``max_force``, ``max_torque``.
    """

    kind: Literal["force_torque"]
    frame: str
    rate: Rate
    noise_force: Force
    noise_torque: Torque
    offset_force: Force
    offset_torque: Torque
    max_force: ForceLimit
    max_torque: TorqueLimit
    latency: Time = 0.0


@dataclass(frozen=True, kw_only=True)
class ImuPart(PartConfig):
    """An inertial measurement unit at the origin of the link ``frame``, along its axes.

    ``noise_…``: standard deviations of each reading; ``bias_…``: of the constant error of each axis, drawn once.
    Beyond ``max_…`` it saturates.
    """

    kind: Literal["imu"]
    frame: str
    rate: Rate
    latency: Time = 0.0
    noise_angular_velocity: AngularSpeed
    noise_acceleration: Acceleration
    bias_angular_velocity: AngularSpeed
    bias_acceleration: Acceleration
    max_angular_velocity: AngularSpeedLimit
    max_acceleration: Acceleration


@dataclass(frozen=True, kw_only=True)
class TactilePart(PartConfig):
    """A pad of ``rows`` times ``columns`` taxels on the surface of its link.

    ``frame``: the middle of the pad, z out of its surface, x along a row, y along a column. ``size``: along x and y.
    ``spread``: standard deviation of the pressure of a point load. ``noise``, ``noise_sliding``: standard deviations of
    a taxel's forces and of the sliding speed.
    """

    kind: Literal["tactile"]
    frame: str
    size: Size2
    rows: PositiveWholeNumber
    columns: PositiveWholeNumber
    spread: PositiveLength
    rate: Rate
    latency: Time = 0.0
    noise: Force
    noise_sliding: Speed


@dataclass(frozen=True, kw_only=True)
class BumperPart(PartConfig):
    """A ring of ``zones`` contact strips of equal length around the footprint of the robot's base.

    ``threshold``: the force that presses a strip. ``height``: above the floor, up to which it detects contact.
    """

    kind: Literal["bumper"]
    frame: str
    zones: PositiveWholeNumber
    threshold: Force
    height: PositiveLength
    rate: Rate
    latency: Time = 0.0


@dataclass(frozen=True, kw_only=True)
class BatteryPart(PartConfig):
    """A battery and the robot's power consumption.

    Its open-circuit voltage falls linearly from ``voltage_full`` to ``voltage_empty``. ``idle_power``: of everything
    but the motors. Motors draw their mechanical power divided by ``drive_efficiency``, and ``holding_power`` each at
    full torque (it grows with the square of the torque). ``charge``: at the start, 0 to 1.
    """

    kind: Literal["battery"]
    capacity: Energy
    voltage_full: Voltage
    voltage_empty: Voltage
    internal_resistance: Resistance
    charge: Share = 1.0
    idle_power: Power
    drive_efficiency: PositiveShare
    holding_power: Power
    rate: Rate
    latency: Time = 0.0
    noise_voltage: Voltage
    noise_charge: Share


@dataclass(frozen=True)
class MountedForceTorque:
    """A force-torque sensor in a robot; ``joints``: fixed joints that carry the measured load."""

    part: ForceTorquePart
    joints: tuple[str, ...]


@dataclass(frozen=True)
class MountedBumper:
    """A bumper around a base; it detects contacts of the link that carries its frame and of the child links of
    ``joints``, the wheels.

    ``zones``: (x, y) of each strip's start and end in the base frame, metres, counter-clockwise.
    """

    part: BumperPart
    joints: tuple[str, ...]
    zones: tuple[tuple[tuple[float, float], tuple[float, float]], ...]
