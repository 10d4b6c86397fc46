"""Rigid transforms in space and in the plane."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bestman_bt.messages.frozen_array import frozen_array


@dataclass(frozen=True)
class Twist2D:
    """Velocity in the base frame: ``vx`` forward and ``vy`` left in m/s, ``wz`` counter-clockwise in rad/s."""

    vx: float = 0.0
    vy: float = 0.0
    wz: float = 0.0


MAX_HEADING = 4.0 * math.pi
"""Radians; a larger value is probably in degrees, or faulty."""
MAX_COORDINATE = 1e5
"""Metres."""


def wrap_angle(angle: float) -> float:
    """Return ``angle`` in radians, wrapped to [-pi, pi)."""
    return (angle + math.pi) % (2.0 * math.pi) - math.pi


def _parse_numbers(text: str, counts: tuple[int, ...], what: str) -> list[float]:
    try:
        numbers = [float(part) for part in text.split(";")]
    except ValueError:
        numbers = []
    if len(numbers) not in counts or not all(math.isfinite(number) for number in numbers):
        raise ValueError(f"expected {what}, got {text!r}")
    return numbers


@dataclass(frozen=True, eq=False)
class Pose:
    """A rigid transform; a variable named ``base_from_camera`` maps camera coordinates to base coordinates.

    ``position``: (3,) float64, metres. ``quaternion``: (4,) float64, unit, order xyzw.
    """

    position: NDArray[np.float64] = field(default_factory=lambda: np.zeros(3))
    quaternion: NDArray[np.float64] = field(default_factory=lambda: np.array([0.0, 0.0, 0.0, 1.0]))

    def __post_init__(self) -> None:
        quaternion = np.asarray(self.quaternion, dtype=float)
        norm = math.sqrt(quaternion @ quaternion) if quaternion.shape == (4,) else math.nan
        if not abs(norm - 1.0) <= 1e-3:
            raise ValueError(f"Pose quaternion should be a unit (4,) array, order xyzw, but got {quaternion}")
        object.__setattr__(self, "position", frozen_array(self.position, (3,), "Pose position"))
        object.__setattr__(self, "quaternion", frozen_array(quaternion / norm, (4,), "Pose quaternion"))

    @classmethod
    def from_xyz_rpy(cls, xyz: ArrayLike, rpy: ArrayLike = (0.0, 0.0, 0.0)) -> Pose:
        """Build from a translation (metres) and fixed-axis roll, pitch, yaw (radians), as ``origin`` in URDF."""
        roll, pitch, yaw = np.asarray(rpy, dtype=float) / 2.0
        cr, sr, cp, sp = math.cos(roll), math.sin(roll), math.cos(pitch), math.sin(pitch)
        cy, sy = math.cos(yaw), math.sin(yaw)
        quaternion = np.array(
            [
                sr * cp * cy - cr * sp * sy,
                cr * sp * cy + sr * cp * sy,
                cr * cp * sy - sr * sp * cy,
                cr * cp * cy + sr * sp * sy,
            ]
        )
        return cls(np.asarray(xyz, dtype=float), quaternion)

    @classmethod
    def from_matrix(cls, matrix: ArrayLike) -> Pose:
        """Build from a (4, 4) homogeneous matrix."""
        m = np.asarray(matrix, dtype=float)
        r = m[:3, :3]
        # Shepperd's method: divide by the largest of the four quaternion components.
        squares = np.array(
            [
                1.0 + r[0, 0] - r[1, 1] - r[2, 2],
                1.0 - r[0, 0] + r[1, 1] - r[2, 2],
                1.0 - r[0, 0] - r[1, 1] + r[2, 2],
                1.0 + np.trace(r),
            ]
        )
        k = int(np.argmax(squares))
        q = np.empty(4)
        if k == 3:
            q[:] = r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1], squares[3]
        else:
            i, j, h = k, (k + 1) % 3, (k + 2) % 3
            q[i], q[j], q[h] = squares[k], r[j, i] + r[i, j], r[h, i] + r[i, h]
            q[3] = r[h, j] - r[j, h]
        return cls(m[:3, 3], q / np.linalg.norm(q))

    @classmethod
    def from_string(cls, text: str) -> Pose:
        """Parse ``x;y;z`` or ``x;y;z;roll;pitch;yaw`` (metres, radians), the form of a port literal. Raises
        ValueError.
        """
        numbers = _parse_numbers(text, (3, 6), "a pose 'x;y;z' or 'x;y;z;roll;pitch;yaw' (metres, radians)")
        return cls.from_xyz_rpy(numbers[:3], numbers[3:] or (0.0, 0.0, 0.0))

    @property
    def rotation(self) -> NDArray[np.float64]:
        """The (3, 3) rotation matrix."""
        x, y, z, w = self.quaternion
        return np.array(
            [
                [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
            ]
        )

    @property
    def matrix(self) -> NDArray[np.float64]:
        """The (4, 4) homogeneous matrix."""
        matrix = np.eye(4)
        matrix[:3, :3] = self.rotation
        matrix[:3, 3] = self.position
        return matrix

    @property
    def yaw(self) -> float:
        """Rotation about the vertical axis (of the fixed-axis roll, pitch, yaw), radians."""
        x, y, z, w = self.quaternion
        return math.atan2(2 * (x * y + z * w), 1 - 2 * (y * y + z * z))

    @property
    def roll_pitch_yaw(self) -> tuple[float, float, float]:
        """Fixed-axis roll, pitch, yaw as in URDF, radians; roll is 0 if the pitch is a right angle."""
        m = self.rotation
        level = math.hypot(m[0, 0], m[1, 0])
        pitch = math.atan2(-m[2, 0], level)
        if level < 1e-9:
            return 0.0, pitch, math.atan2(-m[0, 1], m[1, 1])
        return math.atan2(m[2, 1], m[2, 2]), pitch, math.atan2(m[1, 0], m[0, 0])

    @property
    def tilt(self) -> float:
        """Angle between the frame's z axis and the vertical, radians."""
        x, y, _, _ = self.quaternion
        return math.acos(float(np.clip(1 - 2 * (x * x + y * y), -1.0, 1.0)))

    def inverse(self) -> Pose:
        """Return the inverse transform."""
        x, y, z, w = self.quaternion
        return Pose(-self.rotation.T @ self.position, np.array([-x, -y, -z, w]))

    def __matmul__(self, other: Pose) -> Pose:
        """Compose: ``map_from_base @ base_from_camera`` is ``map_from_camera``."""
        x1, y1, z1, w1 = self.quaternion
        x2, y2, z2, w2 = other.quaternion
        quaternion = np.array(
            [
                w1 * x2 + x1 * w2 + y1 * z2 - z1 * y2,
                w1 * y2 - x1 * z2 + y1 * w2 + z1 * x2,
                w1 * z2 + x1 * y2 - y1 * x2 + z1 * w2,
                w1 * w2 - x1 * x2 - y1 * y2 - z1 * z2,
            ]
        )
        return Pose(self.position + self.rotation @ other.position, quaternion)

    def apply(self, points: ArrayLike) -> NDArray[np.float64]:
        """Transform points of shape (..., 3), metres."""
        transformed: NDArray[np.float64] = np.asarray(points, dtype=float) @ self.rotation.T + self.position
        return transformed

    def to_pose2d(self) -> Pose2D:
        """Project onto the ground plane: x, y and yaw."""
        return Pose2D(float(self.position[0]), float(self.position[1]), self.yaw)

    def __repr__(self) -> str:
        position = ", ".join(f"{v:.4f}" for v in self.position)
        quaternion = ", ".join(f"{v:.4f}" for v in self.quaternion)
        return f"Pose(position=({position}), quaternion=({quaternion}))"


@dataclass(frozen=True)
class Pose2D:
    """A pose in the plane: ``x``, ``y`` in metres, ``theta`` in radians."""

    x: float = 0.0
    y: float = 0.0
    theta: float = 0.0

    @classmethod
    def from_string(cls, text: str) -> Pose2D:
        """Parse ``x;y;theta`` (metres, radians), the form of a port literal. Raises ValueError, also if theta is
        missing.
        """
        pose = cls(*_parse_numbers(text, (3,), "a planar pose 'x;y;theta' (metres, radians)"))
        if pose.fault:
            raise ValueError(pose.fault)
        return pose

    def checked(self, what: str) -> Pose2D:
        """Return the pose itself. Raises ValueError naming ``what`` if a number is not finite."""
        if not math.isfinite(self.x + self.y + self.theta):
            raise ValueError(f"{what} is x {self.x:g} m, y {self.y:g} m, theta {self.theta:g} rad; it should be finite")
        return self

    @property
    def fault(self) -> str:
        """Why the pose cannot be a goal: heading too large or position too far away; empty if it can."""
        if not abs(self.theta) <= MAX_HEADING:
            return f"theta is {self.theta:.6g} rad; at most two turns, ±{MAX_HEADING:.2f} rad, are accepted"
        if not max(abs(self.x), abs(self.y)) <= MAX_COORDINATE:
            return f"x is {self.x:.6g} m and y {self.y:.6g} m; at most ±{MAX_COORDINATE:.6g} m are accepted"
        return ""

    @property
    def xy(self) -> NDArray[np.float64]:
        """The position, (2,) metres."""
        return np.array([self.x, self.y])

    def inverse(self) -> Pose2D:
        """Return the inverse transform."""
        c, s = math.cos(self.theta), math.sin(self.theta)
        return Pose2D(-c * self.x - s * self.y, s * self.x - c * self.y, -self.theta)

    def __matmul__(self, other: Pose2D) -> Pose2D:
        """Compose two planar transforms."""
        c, s = math.cos(self.theta), math.sin(self.theta)
        return Pose2D(
            self.x + c * other.x - s * other.y,
            self.y + s * other.x + c * other.y,
            wrap_angle(self.theta + other.theta),
        )

    def apply(self, points: ArrayLike) -> NDArray[np.float64]:
        """Transform points of shape (..., 2), metres."""
        c, s = math.cos(self.theta), math.sin(self.theta)
        rotated: NDArray[np.float64] = np.asarray(points, dtype=float) @ np.array([[c, s], [-s, c]])
        rotated += (self.x, self.y)
        return rotated

    def to_pose(self, z: float = 0.0) -> Pose:
        """Return the pose in space at height ``z``, metres."""
        return Pose.from_xyz_rpy((self.x, self.y, z), (0.0, 0.0, self.theta))

    def distance_to(self, other: Pose2D) -> float:
        """Return the Euclidean distance of the positions, metres."""
        return math.hypot(self.x - other.x, self.y - other.y)


class Goals(tuple[Pose2D, ...]):
    """Poses in the map frame, in driving order; as text ``x;y;theta;x;y;theta``."""

    __slots__ = ()

    @classmethod
    def from_string(cls, text: str) -> Goals:
        """Parse ``x;y;theta`` of each pose (metres, radians), the form of a port literal. Raises ValueError."""
        parts = text.split(";") if text.strip() else []
        if len(parts) % 3:
            raise ValueError(f"expected poses 'x;y;theta;x;y;theta' (metres, radians), got {text!r}")
        return cls(Pose2D.from_string(";".join(parts[i : i + 3])) for i in range(0, len(parts), 3))

    def to_string(self) -> str:
        """Return the text that ``from_string`` parses."""
        return ";".join(f"{pose.x!r};{pose.y!r};{pose.theta!r}" for pose in self)


def squared_distance_to_segment(
    points: NDArray[np.float64], start: NDArray[np.float64], end: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the squared distances (N,) of ``points`` (2, N), one row each for x and y, to a segment, m²."""
    (dx, dy), (along_x, along_y) = points - start[:, None], end - start
    share = np.clip((dx * along_x + dy * along_y) / max(float(along_x**2 + along_y**2), 1e-12), 0.0, 1.0)
    squared: NDArray[np.float64] = (dx - share * along_x) ** 2 + (dy - share * along_y) ** 2
    return squared
