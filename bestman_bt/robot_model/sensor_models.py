"""What a program must know about sensors and batteries; rates in hertz, latencies in seconds."""

from __future__ import annotations

from dataclasses import dataclass

from bestman_bt.messages import CameraIntrinsics


@dataclass(frozen=True)
class EncoderModel:
    """The encoders of an arm, another joint group, or of wheels: what a robot tells of its joints.

    ``rate``: hertz; None: whenever it is asked. ``latency``: seconds. Standard deviations of the noise of each reading:
    ``noise``, rad or m, and ``noise_speed``, rad/s or m/s.
    """

    rate: float | None = None
    latency: float = 0.0
    noise: float = 0.0
    noise_speed: float = 0.0


@dataclass(frozen=True)
class CameraModel:
    """An RGB-D camera; ``optical_frame``: x right, y down, z forward.

    Depth noise: standard deviation ``noise_base + noise_quadratic * max(0, z - 0.4)²`` metres; a share
    ``edge_dropout`` of the pixels at depth edges and ``dropout`` of all others have no depth; the rest comes in steps
    of ``depth_step`` metres. Systematic error: the camera tells ``depth_scale * z + depth_offset``; simulated cameras
    err that way, and the sensor takes it away again.
    """

    optical_frame: str
    intrinsics: CameraIntrinsics
    near: float
    far: float
    noise_base: float
    noise_quadratic: float
    edge_dropout: float
    dropout: float
    depth_step: float = 0.001
    depth_scale: float = 1.0
    depth_offset: float = 0.0
    rate: float = 30.0
    latency: float = 0.0


@dataclass(frozen=True)
class LidarModel:
    """A planar lidar in ``frame``: beams evenly over ``[angle_min, angle_max)``, radians, metres, hertz."""

    frame: str
    beams: int
    angle_min: float
    angle_max: float
    range_min: float
    range_max: float
    noise: float
    rate: float
    latency: float = 0.0


@dataclass(frozen=True)
class ForceTorqueModel:
    """A force-torque sensor in ``frame``; ``joints``: fixed ones, by which all that it feels hangs on that frame.

    Standard deviations of the noise of each reading and of the constant offset of each axis, N and N m; hertz.
    """

    frame: str
    joints: tuple[str, ...]
    rate: float
    noise_force: float
    noise_torque: float
    offset_force: float
    offset_torque: float
    max_force: float
    max_torque: float
    latency: float = 0.0


@dataclass(frozen=True)
class ImuModel:
    """An inertial measurement unit at the origin of ``frame``; rad/s, m/s².

    Standard deviations of the noise of each reading and of the constant bias of each axis; saturation.
    """

    frame: str
    rate: float
    latency: float
    noise_angular_velocity: float
    noise_acceleration: float
    bias_angular_velocity: float
    bias_acceleration: float
    max_angular_velocity: float
    max_acceleration: float


@dataclass(frozen=True)
class TactileModel:
    """A pad of ``rows`` × ``columns`` taxels; ``frame``: its middle, z out of it, x along a row, y along a column.

    ``size``: along x and y, metres. ``spread``: metres over which the skin spreads a point of pressure. Standard
    deviations of a taxel's forces (N) and of the sliding speed (m/s).
    """

    frame: str
    size: tuple[float, float]
    rows: int
    columns: int
    spread: float
    rate: float
    latency: float
    noise: float
    noise_sliding: float


@dataclass(frozen=True)
class BumperModel:
    """A ring of strips around the link that carries ``frame``, and around the links of ``joints``: wheels.

    ``zones``: (x, y) of each strip's start and end in the base frame, metres. ``threshold``: newtons that press one.
    ``height``: metres above the floor that it reaches up to.
    """

    frame: str
    joints: tuple[str, ...]
    zones: tuple[tuple[tuple[float, float], tuple[float, float]], ...]
    threshold: float
    height: float
    rate: float
    latency: float


@dataclass(frozen=True)
class BatteryModel:
    """A battery: J, V, ohm, W; see ``BatteryPart``."""

    capacity: float
    voltage_full: float
    voltage_empty: float
    internal_resistance: float
    charge: float
    idle_power: float
    drive_efficiency: float
    holding_power: float
    rate: float
    latency: float
    noise_voltage: float
    noise_charge: float
