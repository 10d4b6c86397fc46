"""Fields that descriptions of parts have in common: shapes, frames, contacts, joint limits."""

from __future__ import annotations

from dataclasses import dataclass

from bestman_bt.configuration.quantity import (
    Angles3,
    Damping,
    Friction,
    JointAcceleration,
    JointEffort,
    JointPosition,
    JointSpeed,
    Lengths3,
    Size3,
    Stiffness,
)


@dataclass(frozen=True)
class PadConfig:
    """A box that replaces the collision shape of a link: ``size`` metres, centred at ``xyz`` in the link."""

    size: Size3
    xyz: Lengths3 = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class SeatConfig:
    """A place on what carries a part: metres, radians."""

    xyz: Lengths3 = (0.0, 0.0, 0.0)
    rpy: Angles3 = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class FrameConfig:
    """A frame that the source of a part lacks, for example where a hand grasps; fixed on ``link``, metres, radians."""

    link: str
    xyz: Lengths3 = (0.0, 0.0, 0.0)
    rpy: Angles3 = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class ContactConfig:
    """How a link touches: lateral and spinning friction, contact stiffness (N/m) and damping (N s/m)."""

    lateral_friction: Friction
    spinning_friction: Friction = 0.0
    stiffness: Stiffness | None = None
    damping: Damping | None = None


@dataclass(frozen=True)
class JointLimitsConfig:
    """Limits, one entry per joint, in the order of ``joints``."""

    lower: tuple[JointPosition, ...]
    upper: tuple[JointPosition, ...]
    velocity: tuple[JointSpeed, ...]
    acceleration: tuple[JointAcceleration, ...]
    effort: tuple[JointEffort, ...]
