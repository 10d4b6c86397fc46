"""Common fields of part descriptions: sources of links, shapes, frames, contacts, joint limits."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from bestman_bt.configuration.quantity import (
    Angles3,
    Damping,
    EffortLimit,
    Friction,
    JointAcceleration,
    JointLimit,
    JointSpeed,
    JointTolerance,
    Lengths3,
    Mass,
    Rate,
    Size3,
    Spread,
    SpreadOfSpeed,
    Stiffness,
    Time,
    TimeLimit,
)


@dataclass(frozen=True)
class PadConfig:
    """A box that replaces the collision shape of a link: ``size`` metres, centred at ``xyz`` in the link."""

    size: Size3
    xyz: Lengths3 = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class SeatConfig:
    """A place on the carrier of a part: metres, radians."""

    xyz: Lengths3 = (0.0, 0.0, 0.0)
    rpy: Angles3 = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class FrameConfig:
    """An additional frame, for example for grasping, fixed on ``link``; metres, radians."""

    link: str
    xyz: Lengths3 = (0.0, 0.0, 0.0)
    rpy: Angles3 = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class ContactConfig:
    """Contact parameters of a link: lateral friction, stiffness (N/m) and damping (N s/m)."""

    lateral_friction: Friction
    stiffness: Stiffness | None = None
    damping: Damping | None = None


@dataclass(frozen=True)
class JointLimitsConfig:
    """Limits, one entry per joint, in the order of ``joints``."""

    lower: tuple[JointLimit, ...]
    upper: tuple[JointLimit, ...]
    velocity: tuple[JointSpeed, ...]
    acceleration: tuple[JointAcceleration, ...]
    effort: tuple[EffortLimit, ...]


@dataclass(frozen=True)
class JointConstraint:
    """Tolerances of one joint; None: those of the other joints."""

    trajectory: JointTolerance | None = None
    goal: JointTolerance | None = None


@dataclass(frozen=True)
class ConstraintsConfig:
    """Tolerances of joints, as in ROS's joint_trajectory_controller.

    ``trajectory``: from the set-point during a motion; ``goal``: from the target at rest, which is below
    ``stopped_velocity`` and reached within ``goal_time`` of the last set-point. ``joints``: of single ones, by name.
    """

    trajectory: JointTolerance = 0.15
    goal: JointTolerance = 0.005
    goal_time: TimeLimit = 2.0
    stopped_velocity: JointSpeed = 0.03
    joints: Mapping[str, JointConstraint] = field(default_factory=dict)


@dataclass(frozen=True)
class EncodersConfig:
    """The encoders of joints or wheels; by default exact and immediate.

    ``noise``, ``noise_speed``: standard deviations of position and speed readings. ``rate``: of the readings;
    ``latency``: until a reading is available. Motors have separate, exact encoders.
    """

    rate: Rate | None = None
    latency: Time = 0.0
    noise: Spread = 0.0
    noise_speed: SpreadOfSpeed = 0.0


@dataclass(frozen=True, kw_only=True)
class PartConfig:
    """Fields of all parts.

    Links come from ``urdf`` (``PACKAGE:FILE`` or a path beside this description) from its link ``root`` down without
    the subtrees ``cut``; ``packages``: folders for its ``package://`` names; or from the generator ``generated`` with
    its ``dimensions``. ``frames``: frames to add. ``mass``: link → mass that replaces or completes the source's; the
    inertia then follows from the collision shape. ``collision``: link → boxes that replace its collision shape.
    ``contact``: link → friction and stiffness. ``may_touch``: pairs of links whose shapes overlap by construction or
    may touch. ``seat``: pose of the root on the carrier, before ``xyz`` and ``rpy``.
    """

    kind: str
    description: str = ""
    urdf: str | None = None
    packages: tuple[str, ...] = ()
    root: str | None = None
    cut: tuple[str, ...] = ()
    generated: str | None = None
    dimensions: Mapping[str, Any] = field(default_factory=dict)
    frames: Mapping[str, FrameConfig] = field(default_factory=dict)
    mass: Mapping[str, Mass] = field(default_factory=dict)
    collision: Mapping[str, tuple[PadConfig, ...]] = field(default_factory=dict)
    contact: Mapping[str, ContactConfig] = field(default_factory=dict)
    may_touch: tuple[tuple[str, str], ...] = ()
    seat: SeatConfig | None = None
