"""The robot model: one URDF with named groups, frames, sensors and postures."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bestman_bt.robot_model.connection_config import ConnectionConfig, SafetyConfig
from bestman_bt.robot_model.finger_linkage import MimicJoint, all_positions
from bestman_bt.robot_model.part_config import (
    ArmPart,
    BasePart,
    GripperPart,
    JointGroupPart,
    LeggedBasePart,
    MobilePart,
    SuctionPart,
)
from bestman_bt.robot_model.part_fields import PartConfig
from bestman_bt.robot_model.sensor_parts import MountedBumper, MountedForceTorque


@dataclass(frozen=True, eq=False)
class JointedModel:
    """Joints that move together, as their ``part`` describes them; limits are (n,), in the order of ``joint_names``.

    Radians, rad/s, rad/s², N m; sliding joints: metres, m/s, m/s², N.
    """

    part: ArmPart | JointGroupPart

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the n joints."""
        return self.part.joints

    @cached_property
    def lower(self) -> NDArray[np.float64]:
        """Lower position limits (n,), radians or metres."""
        return _fixed(self.part.limits.lower)

    @cached_property
    def upper(self) -> NDArray[np.float64]:
        """Upper position limits (n,), radians or metres."""
        return _fixed(self.part.limits.upper)

    @cached_property
    def velocity(self) -> NDArray[np.float64]:
        """Velocity limits (n,), rad/s or m/s."""
        return _fixed(self.part.limits.velocity)

    @cached_property
    def acceleration(self) -> NDArray[np.float64]:
        """Acceleration limits (n,), rad/s² or m/s²."""
        return _fixed(self.part.limits.acceleration)

    @cached_property
    def path_tolerance(self) -> NDArray[np.float64]:
        """Return the path tolerance of each joint (n,), rad or m."""
        constraints = self.part.constraints
        each = (constraints.joints.get(name) for name in self.joint_names)
        return _fixed(tuple((one and one.trajectory) or constraints.trajectory for one in each))

    @cached_property
    def goal_tolerance(self) -> NDArray[np.float64]:
        """Return the goal tolerance of each joint (n,), rad or m."""
        constraints = self.part.constraints
        each = (constraints.joints.get(name) for name in self.joint_names)
        return _fixed(tuple((one and one.goal) or constraints.goal for one in each))

    @cached_property
    def effort(self) -> NDArray[np.float64]:
        """Effort limits (n,), N m or N."""
        return _fixed(self.part.limits.effort)


def _fixed(values: tuple[float, ...]) -> NDArray[np.float64]:
    array = np.array(values, dtype=float)
    array.setflags(write=False)
    return array


@dataclass(frozen=True, eq=False)
class ArmModel(JointedModel):
    """An arm from ``base_frame`` to ``tool_frame``.

    ``tool_frame``: between the finger tips of the end effector that it carries: z leaves the hand, y closes.
    """

    part: ArmPart
    base_frame: str
    tool_frame: str


@dataclass(frozen=True, eq=False)
class JointGroupModel(JointedModel):
    """Other joints that move together, for example a pan-tilt."""

    part: JointGroupPart


@dataclass(frozen=True, eq=False)
class GripperModel:
    """A gripper: its ``part``, with the properties of its hand from the URDF.

    ``hand_link``: the parent of the fingers; ``linkage``: moving links in between. ``opening``: for fingers on a
    linkage, pairs (position of each of ``part.joints``, width) from the widest to the closed hand; sliding ones share
    the width equally. ``followers``: mechanically coupled joints.
    """

    part: GripperPart | SuctionPart
    hand_link: str
    opening: tuple[tuple[float, float], ...] = ()
    followers: tuple[MimicJoint, ...] = ()
    linkage: tuple[str, ...] = ()

    @property
    def max_width(self) -> float:
        """The width of the open hand, metres; for a linkage as far as its joints reach."""
        return self.opening[0][1] if self.opening else self.part.max_width

    def joint_positions(self, width: float) -> dict[str, float]:
        """Return the positions of all joints of the hand, mimic joints included, at the opening ``width``, metres."""
        if self.opening:
            positions, widths = self._table
            position = float(np.interp(width, widths, positions))
        else:
            position = width / max(1, len(self.part.joints))
        return all_positions(dict.fromkeys(self.part.joints, position), self.followers)

    def width(self, positions: ArrayLike) -> float:
        """Return the opening width for ``part.joints`` at ``positions`` (n,), metres; for a linkage the mean of the
        joints.
        """
        if not self.opening:
            return float(np.sum(positions))
        q, widths = self._table
        order = 1 if q[0] <= q[-1] else -1
        return float(np.mean(np.interp(np.asarray(positions, float), q[::order], widths[::order])))

    def transmission(self, width: float) -> float:
        """Return the motion of each joint per metre of opening width, positive; rad/m for revolute joints, m/m for
        prismatic ones.
        """
        positions, widths = self._table
        index = int(np.clip(np.searchsorted(widths, width), 1, len(widths) - 1))
        return abs(float((positions[index] - positions[index - 1]) / (widths[index] - widths[index - 1])))

    @property
    def joint_range(self) -> tuple[float, float]:
        """Lowest and highest position of each of ``part.joints``, radians or metres."""
        positions, _ = self._table
        return min(positions[0], positions[-1]), max(positions[0], positions[-1])

    @property
    def fastest_transmission(self) -> float:
        """The largest ``transmission`` within the hand's travel."""
        positions, widths = self._table
        return float(np.max(np.abs(np.diff(positions) / np.diff(widths))))

    @cached_property
    def _table(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Joint positions and widths, both (m,), from the closed to the open hand."""
        if self.opening:
            table = np.array(self.opening[::-1], dtype=float)
            return table[:, 0], table[:, 1]
        widths = np.array([self.part.min_width, self.max_width])
        return widths / max(1, len(self.part.joints)), widths


@dataclass(frozen=True)
class LegModel:
    """A leg; metres in the frame of the trunk. Its hip turns about x, its thigh and its knee about y.

    ``hip``: (3,), a point on the hip's axis; ``thigh_offset``: lateral distance (y) from it to the thigh.
    """

    hip: tuple[float, float, float]
    thigh_offset: float
    thigh_length: float
    calf_length: float


@dataclass(frozen=True)
class BaseModel:
    """A base of any kind: its ``part``, with its outline from the URDF.

    ``frame``: on the floor, x forward. ``footprint``: corners (x, y) in the base frame, metres, counter-clockwise.
    """

    part: MobilePart
    frame: str
    footprint: tuple[tuple[float, float], ...]


@dataclass(frozen=True)
class WheeledBaseModel(BaseModel):
    """A base on wheels. ``wheel_places``: (x, y) of each of ``part.wheel_joints`` in the base frame, metres."""

    part: BasePart
    wheel_places: tuple[tuple[float, float], ...] = ()


@dataclass(frozen=True)
class LeggedBaseModel(BaseModel):
    """A base on legs. ``legs``: front right, front left, rear right, rear left."""

    part: LeggedBasePart
    legs: tuple[LegModel, ...] = ()


Part = BaseModel | JointedModel | GripperModel | MountedForceTorque | MountedBumper | PartConfig
"""The elements of a robot model: sensors, and parts of kinds from plug-ins, as in the YAML."""
Kind = TypeVar("Kind", bound=Part)


@dataclass(frozen=True)
class RobotModel:
    """A composed robot.

    ``urdf``: the text, with absolute mesh paths. ``base_frame``: on the floor, x forward. ``parts``: by name (``base``,
    ``arm``, ``gripper``, ``head``, …), grouped by kind; within a kind in the order of the robot's YAML. ``postures``:
    name → joint name → position. ``hand_of``: name of a gripper or other hand → its arm. ``default_arm``: the arm of
    skills that do not name one of several. ``allowed_self_pairs``: pairs of links excluded from self-collision checks.
    ``connections``, ``safety``: of the real robot; the simulation ignores the former. ``bringup``: path of the bring-up
    file; ``content``: digest of its files; ``serial_numbers``: connection → expected controller; ``measured``: step of
    the signed bring-up → parts and connections that it has measured.
    """

    name: str
    urdf: str
    base_frame: str
    parts: Mapping[str, Part] = field(default_factory=dict)
    postures: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    hand_of: Mapping[str, str] = field(default_factory=dict)
    default_arm: str | None = None
    allowed_self_pairs: frozenset[frozenset[str]] = frozenset()
    connections: Mapping[str, ConnectionConfig] = field(default_factory=dict)
    safety: SafetyConfig = field(default_factory=SafetyConfig)
    bringup: Path | None = None
    content: str = ""
    serial_numbers: Mapping[str, str] = field(default_factory=dict)
    measured: Mapping[str, frozenset[str]] = field(default_factory=dict)

    def of(self, kind: type[Kind]) -> dict[str, Kind]:
        """Return the parts of one kind by name: ``robot.of(LidarPart)``."""
        return {name: part for name, part in self.parts.items() if isinstance(part, kind)}

    def kind(self, name: str) -> str:
        """Return the kind of a part, as in the YAML: ``base``, ``arm``, ``lidar``."""
        part = self.parts[name]
        return part.kind if isinstance(part, PartConfig) else part.part.kind

    @property
    def arm_names(self) -> tuple[str, ...]:
        """The names of the arms, in the order of the robot's file."""
        return tuple(self.of(ArmModel))

    def arm_named(self, name: str = "") -> str:
        """Return the arm of this name; for an empty name the only arm, or the ``default_arm``.

        Raises KeyError naming the arms.
        """
        if name in self.arm_names:
            return name
        known = ", ".join(self.arm_names) or "none"
        if name:
            raise KeyError(f"robot {self.name!r} has no arm {name!r}; it has {known}")
        if self.default_arm is not None or len(self.arm_names) == 1:
            return self.default_arm or next(iter(self.arm_names))
        raise KeyError(f"robot {self.name!r} has no default arm: name one of its arms; it has {known}")

    def gripper_of(self, arm: str) -> str | None:
        """Return the gripper that an arm carries; for a robot with at most one arm, its first gripper."""
        if len(self.arm_names) < 2:
            return next(iter(self.of(GripperModel)), None)
        return next((name for name in self.of(GripperModel) if self.hand_of.get(name) == arm), None)

    def posture(self, name: str, joint_names: tuple[str, ...]) -> NDArray[np.float64]:
        """Return the positions (n,) of ``joint_names`` in a posture. Raises KeyError listing the known postures."""
        if name not in self.postures:
            raise KeyError(f"robot {self.name!r} has no posture {name!r}; it has {', '.join(self.postures) or 'none'}")
        missing = [joint for joint in joint_names if joint not in self.postures[name]]
        if missing:
            raise KeyError(f"posture {name!r} of robot {self.name!r} has no value for {', '.join(missing)}")
        return np.array([self.postures[name][joint] for joint in joint_names])
