"""The robot model: one URDF with named groups, frames, sensors and postures."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import CameraIntrinsics


@dataclass(frozen=True, eq=False)
class ArmModel:
    """An arm: n joints from ``base_frame`` to ``tool_frame``; limits are (n,) in rad, rad/s, rad/s², N m.

    ``tool_frame``: between the finger tips of the end effector that it carries: z leaves the hand, y closes.
    """

    joint_names: tuple[str, ...]
    base_frame: str
    tool_frame: str
    lower: NDArray[np.float64]
    upper: NDArray[np.float64]
    velocity: NDArray[np.float64]
    acceleration: NDArray[np.float64]
    effort: NDArray[np.float64]


@dataclass(frozen=True)
class GripperModel:
    """A parallel gripper; the opening width is the sum of its finger joints' positions, metres.

    ``finger_links``: the links that may touch a grasped object. ``hand_link``: their parent.
    ``finger_depth``: metres from the tool frame back to the palm, ``pad_size``: (width across, height along z) metres.
    """

    joint_names: tuple[str, ...]
    finger_links: tuple[str, ...]
    hand_link: str
    min_width: float
    max_width: float
    max_speed: float
    max_force: float
    finger_depth: float
    pad_size: tuple[float, float]
    friction: float


@dataclass(frozen=True)
class BaseModel:
    """A wheeled base; metres, m/s, rad/s, m/s², N m. ``kind``: ``differential`` (later issues add more).

    ``wheel_joints``: (left, right). ``footprint``: corners (x, y) in the base frame, counter-clockwise.
    """

    kind: str
    frame: str
    wheel_joints: tuple[str, ...]
    wheel_radius: float
    track: float
    wheel_torque: float
    caster_links: tuple[str, ...]
    max_vx: float
    max_vy: float
    max_wz: float
    max_acceleration: float
    max_angular_acceleration: float
    footprint: tuple[tuple[float, float], ...]


@dataclass(frozen=True, eq=False)
class JointGroupModel:
    """Other joints that move together, for example a pan-tilt; limits are (n,)."""

    joint_names: tuple[str, ...]
    lower: NDArray[np.float64]
    upper: NDArray[np.float64]
    velocity: NDArray[np.float64]
    acceleration: NDArray[np.float64]
    effort: NDArray[np.float64]


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


@dataclass(frozen=True)
class RobotModel:
    """A composed robot. Mappings go from part name (``arm``, ``gripper``, ``base``, ``head``, ``head_camera``, …).

    ``urdf``: the text, meshes by absolute path. ``base_frame``: on the floor, x forward.
    ``postures``: name → joint name → position. ``hand_of``: gripper name → arm name.
    ``allowed_self_pairs``: pairs of links that always or never touch, left out of self-collision checks.
    """

    name: str
    urdf: str
    base_frame: str
    bases: Mapping[str, BaseModel] = field(default_factory=dict)
    arms: Mapping[str, ArmModel] = field(default_factory=dict)
    grippers: Mapping[str, GripperModel] = field(default_factory=dict)
    joint_groups: Mapping[str, JointGroupModel] = field(default_factory=dict)
    cameras: Mapping[str, CameraModel] = field(default_factory=dict)
    lidars: Mapping[str, LidarModel] = field(default_factory=dict)
    force_torques: Mapping[str, ForceTorqueModel] = field(default_factory=dict)
    postures: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    hand_of: Mapping[str, str] = field(default_factory=dict)
    allowed_self_pairs: frozenset[frozenset[str]] = frozenset()

    def posture(self, name: str, joint_names: tuple[str, ...]) -> NDArray[np.float64]:
        """Positions (n,) of ``joint_names`` in a posture; KeyError names what there is."""
        if name not in self.postures:
            raise KeyError(f"robot {self.name!r} has no posture {name!r}; it has {', '.join(self.postures) or 'none'}")
        return np.array([self.postures[name][joint] for joint in joint_names])
