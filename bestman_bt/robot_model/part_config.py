"""The YAML of a part that moves or carries others, one dataclass per kind."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import ClassVar, Literal, Self, TypeAlias

from bestman_bt.configuration.quantity import (
    AccelerationLimit,
    AngularAccelerationLimit,
    AngularJerk,
    AngularSpeedLimit,
    AngularSpeedLimitOrNone,
    Factor,
    ForceLimit,
    Friction,
    Inertia,
    Jerk,
    JointLimit,
    JointPosition,
    Length,
    LengthLimit,
    MassLimit,
    PositiveLength,
    PositiveLengthLimit,
    Size2,
    SpeedLimit,
    SpeedLimitOrNone,
    TorqueLimit,
)
from bestman_bt.robot_model.part_fields import (
    ConstraintsConfig,
    EncodersConfig,
    FrameConfig,
    JointLimitsConfig,
    PartConfig,
)


@dataclass(frozen=True, kw_only=True)
class MobilePart(PartConfig):
    """Fields of all bases: limits, with ``max_vy`` 0 for a base that cannot move sideways.

    ``max_jerk``, ``max_angular_jerk``: m/s³ and rad/s³ for local planners; drivers do not check them. ``payload``: as
    given by the manufacturer. ``turning_drift``: metres that the base frame may move during a turn in place.
    """

    payload: MassLimit | None = None
    turning_drift: Length = 0.0
    max_vx: SpeedLimit
    max_vy: SpeedLimitOrNone = 0.0
    max_wz: AngularSpeedLimit
    max_acceleration: AccelerationLimit
    max_angular_acceleration: AngularAccelerationLimit
    max_jerk: Jerk = 2.0
    max_angular_jerk: AngularJerk = 10.0

    def slowed(self, speed: float, turn_rate: float) -> Self:
        """Return this base with at most ``speed``, m/s forwards and sideways, and ``turn_rate``, rad/s."""
        return replace(
            self,
            max_vx=min(self.max_vx, speed),
            max_vy=min(self.max_vy, speed),
            max_wz=min(self.max_wz, turn_rate),
        )

    @property
    def driven_joints(self) -> tuple[str, ...]:
        """All joints that its motors move."""
        return ()


@dataclass(frozen=True, kw_only=True)
class BasePart(MobilePart):
    """A wheeled base.

    ``drive``: ``differential`` and ``skid`` have wheels that cannot be steered, left and right alternating; a
    skid-steered drive drags some of them when it turns: ``turning_slip`` is the factor on its apparent track (Mandow
    2007). ``turning_centre``: metres ahead of the URDF's root, about which it turns in place with its load; the root
    and the base frame are moved there. ``steered``: each wheel has a joint of ``steering_joints`` above it, and the
    base is omnidirectional. ``rotor_inertia``: of the drives, at the wheels after the reduction. ``deck``: mount of a
    column for an arm.
    """

    kind: Literal["base"]
    drive: Literal["differential", "skid", "steered"]
    wheel_joints: tuple[str, ...]
    wheel_radius: PositiveLength
    track: PositiveLength
    turning_slip: Factor = 1.0
    turning_centre: Length = 0.0
    wheel_torque: TorqueLimit
    wheel_friction: Friction | None = None
    rotor_inertia: Inertia = 0.0
    caster_links: tuple[str, ...] = ()
    steering_joints: tuple[str, ...] = ()
    steering_torque: TorqueLimit = 0.0
    steering_speed: AngularSpeedLimitOrNone = 0.0
    deck: FrameConfig | None = None
    encoders: EncodersConfig = field(default_factory=EncodersConfig)

    @property
    def driven_joints(self) -> tuple[str, ...]:
        """The wheel joints, then the steering joints."""
        return self.wheel_joints + self.steering_joints


@dataclass(frozen=True, kw_only=True)
class LeggedBasePart(MobilePart):
    """A base on four legs: a trunk, the link ``root``, with legs of three joints: hip, thigh, knee.

    ``joints``: of the front right, front left, rear right and rear left leg in order; ``feet``: the link at the end of
    each, a sphere of ``foot_radius``. ``stand_height``: of the trunk's frame above the floor, where the link
    ``base_footprint`` is added. ``limits``, ``states``, ``rotor_inertia``: as for a joint group.
    """

    kind: Literal["legged_base"]
    joints: tuple[str, ...]
    feet: tuple[str, ...]
    foot_radius: PositiveLength
    foot_friction: Friction
    stand_height: PositiveLength
    limits: JointLimitsConfig
    rotor_inertia: Inertia = 0.0
    states: Mapping[str, tuple[JointPosition, ...]] = field(default_factory=dict)

    @property
    def driven_joints(self) -> tuple[str, ...]:
        """The joints of the legs."""
        return self.joints


@dataclass(frozen=True, kw_only=True)
class StructurePart(PartConfig):
    """Links without joints: a column, a mast, a shelf. ``top``: the link that carries other parts."""

    kind: Literal["structure"]
    top: str | None = None


@dataclass(frozen=True, kw_only=True)
class ArmPart(PartConfig):
    """An arm from its root link to the link ``tip``, which carries the hand.

    ``payload``: beyond ``tip`` as given by the manufacturer, hand and sensors included. ``states``: joint positions by
    name, the default postures of robots. ``home`` should be among them: the hand in front, looking down.
    """

    kind: Literal["arm"]
    tip: str
    joints: tuple[str, ...]
    limits: JointLimitsConfig
    states: Mapping[str, tuple[JointPosition, ...]] = field(default_factory=dict)
    payload: MassLimit | None = None
    constraints: ConstraintsConfig = field(default_factory=ConstraintsConfig)
    encoders: EncodersConfig = field(default_factory=EncodersConfig)


@dataclass(frozen=True, kw_only=True)
class GripperPart(PartConfig):
    """A parallel gripper; ``tool``: the link between the pads, z out of the hand, y along the closing direction.

    ``max_speed`` and the widths are of the opening; ``max_force`` is per finger. Sliding fingers share the width
    equally. For fingers on a linkage, ``open_at`` and ``closed_at`` are the positions of ``joints`` at ``max_width``
    and ``min_width``; the rest, including the URDF's mimic joints, is derived. ``rotor_inertia``: of the drive, at each
    of its joints after the reduction. ``finger_links``: links that may touch a grasped object. ``finger_depth``: from
    the tool back to the palm; ``pad_size``: width across, height along z.
    """

    kind: Literal["gripper"]
    tool: str
    joints: tuple[str, ...]
    finger_links: tuple[str, ...]
    min_width: LengthLimit
    max_width: PositiveLengthLimit
    open_at: JointLimit | None = None
    closed_at: JointLimit | None = None
    rotor_inertia: Inertia = 0.0
    max_speed: SpeedLimit
    max_force: ForceLimit
    finger_depth: PositiveLength
    pad_size: Size2
    friction: Friction


@dataclass(frozen=True, kw_only=True)
class SuctionPart(PartConfig):
    """A suction cup: ``tool``: in the middle of the rim of the link ``cup``, z out of it.

    ``max_force``: holding force of a full vacuum, perpendicular to the cup. ``seal_gap``: largest distance of a sealed
    surface. It is commanded like a gripper without joints, with nominal widths: ``min_width`` sucks, ``max_width``
    releases.
    """

    joints: ClassVar[tuple[str, ...]] = ()
    min_width: ClassVar[float] = 0.0
    max_speed: ClassVar[float] = 1.0

    kind: Literal["suction"]
    tool: str
    cup: str
    cup_radius: PositiveLength
    cup_depth: PositiveLength
    max_force: ForceLimit
    seal_gap: Length = 0.001
    friction: Friction

    @property
    def finger_links(self) -> tuple[str, ...]:
        """The links that may touch a grasped object: the cup."""
        return (self.cup,)

    @property
    def max_width(self) -> float:
        """The nominal width at which it releases."""
        return 2 * self.cup_radius

    @property
    def finger_depth(self) -> float:
        """The distance from the tool back to the flange, metres."""
        return self.cup_depth

    @property
    def pad_size(self) -> tuple[float, float]:
        """The size of the rim, across and along, metres."""
        return 2 * self.cup_radius, 2 * self.cup_radius


@dataclass(frozen=True, kw_only=True)
class JointGroupPart(PartConfig):
    """Other joints that move together: a pan-tilt head, a torso, the fingers of a hand.

    ``tool``: the grasp frame of a hand, as for a gripper. ``states``: as for an arm. ``rotor_inertia``: of the drives,
    at each joint after its reduction.
    """

    kind: Literal["joint_group"]
    joints: tuple[str, ...]
    limits: JointLimitsConfig
    rotor_inertia: Inertia = 0.0
    tool: str | None = None
    states: Mapping[str, tuple[JointPosition, ...]] = field(default_factory=dict)
    constraints: ConstraintsConfig = field(default_factory=ConstraintsConfig)
    encoders: EncodersConfig = field(default_factory=EncodersConfig)


JointedPart: TypeAlias = ArmPart | JointGroupPart | LeggedBasePart
"""Parts whose description gives limits and states of their ``joints``."""
