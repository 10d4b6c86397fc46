"""Parts generated from dimensions instead of a URDF file, by name: bases, posts, heads and sensors."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from bestman_bt.configuration.quantity import Color, Length, Lengths3, Mass, PositiveLength, Size3
from bestman_bt.messages import Box, Cylinder, Sphere
from bestman_bt.robot_model.generated_parts import (
    OffsetWristArm,
    ParallelHand,
    SuctionCup,
    SwingingHand,
    offset_wrist_arm,
    parallel_hand,
    suction_cup,
    swinging_hand,
)
from bestman_bt.robot_model.urdf_elements import box_inertial, fixed_joint, inertial, link, shape, turning_joint
from bestman_bt.robot_model.urdf_source import Subtree

_RUBBER, _STEEL, _DARK = (0.08, 0.08, 0.09), (0.62, 0.64, 0.67), (0.13, 0.14, 0.16)
_ACROSS = (math.pi / 2, 0.0, 0.0)  # turns a cylinder's axis from z to y


@dataclass(frozen=True)
class Chassis:
    """A box with driven wheels.

    ``chassis_height``: of the chassis' centre above the floor; ``centre_of_mass``: its height.
    ``scanner_height``: of a dark slot drawn around the chassis.
    """

    chassis_mass: Mass
    chassis_size: Size3
    chassis_height: PositiveLength
    centre_of_mass: PositiveLength
    wheel_radius: PositiveLength
    wheel_width: PositiveLength
    wheel_mass: Mass
    track: PositiveLength
    scanner_height: PositiveLength


@dataclass(frozen=True)
class DifferentialBase(Chassis):
    """Two driven wheels on the axis through the base frame, ball casters on the centre line in front and behind.

    ``caster_drop``: height of the wheels' contact above that of the casters.
    """

    caster_radius: PositiveLength
    caster_distance: PositiveLength
    caster_mass: Mass
    caster_drop: Length
    color: Color = (0.16, 0.29, 0.42)


@dataclass(frozen=True)
class SteeredBase(Chassis):
    """Four driven wheels with vertical steering axes. ``track``, ``wheelbase``: their distances along y and x."""

    wheelbase: PositiveLength
    fork_mass: Mass
    color: Color = (0.42, 0.44, 0.40)


def differential_base(name: str, d: DifferentialBase) -> list[ET.Element]:
    """Return links ``base_link, left_wheel, right_wheel, front_caster, rear_caster`` (``name`` is ``base``)."""
    root = f"{name}_link"
    elements = [_chassis(root, d, d.color)]
    for side, sign in (("left", 1), ("right", -1)):
        wheel = f"{side}_wheel"
        place = (0, sign * d.track / 2, d.wheel_radius)
        elements += [_wheel(wheel, d), turning_joint(f"{wheel}_joint", root, wheel, (0, 1, 0), place, continuous=True)]
    bottom = d.chassis_height - d.chassis_size[2] / 2
    ball = Sphere(d.caster_radius)
    neck = Cylinder(0.7 * d.caster_radius, max(bottom - d.caster_radius, 0.005))
    for end, sign in (("front", 1), ("rear", -1)):
        caster = f"{end}_caster"
        lift = (bottom - d.caster_radius) / 2
        elements += [
            link(
                caster,
                inertial(d.caster_mass, (0.4 * d.caster_mass * d.caster_radius**2,) * 3),
                shape("visual", ball, rgba=(*_RUBBER, 1), material=f"{caster}_ball"),
                shape("visual", neck, (0, 0, lift), rgba=(*_STEEL, 1), material=f"{caster}_neck"),
                shape("collision", ball),
            ),
            fixed_joint(
                f"{caster}_joint", root, caster, (sign * d.caster_distance, 0, d.caster_radius - d.caster_drop)
            ),
        ]
    return elements


def steered_base(name: str, d: SteeredBase) -> list[ET.Element]:
    """Return links ``base_link``, ``front_left_fork``, ``front_left_wheel``, …; joints ``front_left_steering_joint``,
    …"""
    root = f"{name}_link"
    elements = [_chassis(root, d, d.color)]
    arm = Box((0.03, 0.02, 0.03))
    for end, along in (("front", 1), ("rear", -1)):
        for side, across in (("left", 1), ("right", -1)):
            corner = f"{end}_{side}"
            fork, wheel = f"{corner}_fork", f"{corner}_wheel"
            place = (along * d.wheelbase / 2, across * d.track / 2, d.wheel_radius)
            elements += [
                link(
                    fork,
                    box_inertial(d.fork_mass, (0.08, 0.08, 0.08)),
                    shape("visual", arm, (0, 0, d.wheel_radius), rgba=(*_STEEL, 1), material=f"{fork}_steel"),
                ),
                turning_joint(f"{corner}_steering_joint", root, fork, (0, 0, 1), place, continuous=True),
                _wheel(wheel, d),
                turning_joint(f"{wheel}_joint", fork, wheel, (0, 1, 0), continuous=True),
            ]
    return elements


def _chassis(root: str, d: Chassis, color: Color) -> ET.Element:
    x, y, z = d.chassis_size
    top = d.chassis_height + z / 2
    slot = Box((x + 0.004, y + 0.004, 0.035))
    deck = Box((x - 0.03, y - 0.03, 0.006))
    return link(
        root,
        box_inertial(d.chassis_mass, (x, y, z * 5 / 6), (0, 0, d.centre_of_mass)),
        shape("visual", Box((x, y, z)), (0, 0, d.chassis_height), rgba=(*color, 1), material=f"{root}_paint"),
        shape("visual", slot, (0, 0, d.scanner_height), rgba=(*_DARK, 1), material=f"{root}_slot"),
        shape("visual", deck, (0, 0, top + 0.003), rgba=(*_STEEL, 1), material=f"{root}_deck"),
        shape("collision", Box((x, y, z)), (0, 0, d.chassis_height)),
    )


def _wheel(name: str, d: Chassis) -> ET.Element:
    radius, width, mass = d.wheel_radius, d.wheel_width, d.wheel_mass
    across = mass / 12 * (3 * radius**2 + width**2)
    tyre, hub = Cylinder(radius, width), Cylinder(0.6 * radius, width + 0.004)
    return link(
        name,
        inertial(mass, (across, mass * radius**2 / 2, across)),
        shape("visual", tyre, rpy=_ACROSS, rgba=(*_RUBBER, 1), material=f"{name}_tyre"),
        shape("visual", hub, rpy=_ACROSS, rgba=(*_STEEL, 1), material=f"{name}_hub"),
        shape("collision", tyre, rpy=_ACROSS),
    )


_ALONG = (0.0, math.pi / 2, 0.0)  # … from z to x


@dataclass(frozen=True)
class Post:
    """An upright box or tube standing on its root link, with the frame ``<part>_top`` at its upper end.

    ``plate``: edge length of a square mounting plate drawn at the top, inside the height (0: none).
    """

    size: Size3
    mass: Mass
    plate: Length = 0.0
    color: Color = _STEEL


@dataclass(frozen=True)
class PanTilt:
    """A pan axis (z) with a tilt axis (y, positive looks down) ``tilt_height`` above the root."""

    tilt_height: PositiveLength
    radius: PositiveLength
    mass: Mass
    color: Color = _DARK


@dataclass(frozen=True)
class CameraBody:
    """A camera whose optical centre is the root link, in the middle of its front face; x looks forward."""

    size: Size3
    mass: Mass
    color: Color = (0.80, 0.81, 0.82)


@dataclass(frozen=True)
class BuiltInLidar:
    """A scanner inside another part's housing: a frame without a shape of its own."""

    xyz: Lengths3 = (0.0, 0.0, 0.0)


def post(name: str, d: Post) -> list[ET.Element]:
    """Return links ``<name>_link`` (solid) and ``<name>_top`` (a frame)."""
    body, top = f"{name}_link", f"{name}_top"
    middle = (0, 0, d.size[2] / 2)
    children = [
        box_inertial(d.mass, d.size, middle),
        shape("visual", Box(d.size), middle, rgba=(*d.color, 1), material=f"{name}_paint"),
        shape("collision", Box(d.size), middle),
    ]
    if d.plate:
        plate = Box((d.plate, d.plate, 0.012))
        children.append(shape("visual", plate, (0, 0, d.size[2] - 0.008), rgba=(*_DARK, 1), material=f"{name}_plate"))
    return [link(body, *children), link(top), fixed_joint(f"{top}_joint", body, top, (0, 0, d.size[2]))]


def pan_tilt(name: str, d: PanTilt) -> list[ET.Element]:
    """Return links ``<name>_mount, <name>_pan_link, <name>_tilt_link``, joints ``<name>_pan_joint,
    <name>_tilt_joint``."""
    root, pan, tilt = f"{name}_mount", f"{name}_pan_link", f"{name}_tilt_link"
    neck = Cylinder(d.radius, d.tilt_height)
    bar = Cylinder(0.8 * d.radius, 2.6 * d.radius)
    half = d.mass / 2
    return [
        link(root),
        link(
            pan,
            box_inertial(half, (2 * d.radius, 2 * d.radius, d.tilt_height), (0, 0, d.tilt_height / 2)),
            shape("visual", neck, (0, 0, d.tilt_height / 2), rgba=(*d.color, 1), material=f"{name}_paint"),
            shape("collision", neck, (0, 0, d.tilt_height / 2)),
        ),
        turning_joint(f"{name}_pan_joint", root, pan, (0, 0, 1)),
        link(
            tilt,
            box_inertial(half, (2 * d.radius,) * 3),
            shape("visual", bar, rpy=_ACROSS, rgba=(*_STEEL, 1), material=f"{name}_bar"),
        ),
        turning_joint(f"{name}_tilt_joint", pan, tilt, (0, 1, 0), (0, 0, d.tilt_height)),
    ]


def camera_body(name: str, d: CameraBody) -> list[ET.Element]:
    """Return links ``<name>_link`` (x forward) and ``<name>_optical_frame`` (x right, y down, z forward)."""
    body, optical = f"{name}_link", f"{name}_optical_frame"
    behind = (-d.size[0] / 2, 0, 0)
    children = [
        box_inertial(d.mass, d.size, behind),
        shape("visual", Box(d.size), behind, rgba=(*d.color, 1), material=f"{name}_paint"),
        shape("collision", Box(d.size), behind),
    ]
    lens = Cylinder(0.35 * d.size[2], 0.004)
    for number, y in enumerate((-0.3, 0.0, 0.3)):
        children.append(
            shape("visual", lens, (0, y * d.size[1], 0), _ALONG, (*_RUBBER, 1), material=f"{name}_lens{number}")
        )
    turn = (-math.pi / 2, 0.0, -math.pi / 2)
    return [link(body, *children), link(optical), fixed_joint(f"{optical}_joint", body, optical, rpy=turn)]


def built_in_lidar(name: str, d: BuiltInLidar) -> list[ET.Element]:
    """Return the link ``<name>_link``: the scan plane is its x-y plane."""
    root, frame = f"{name}_mount", f"{name}_link"
    return [link(root), link(frame), fixed_joint(f"{frame}_joint", root, frame, d.xyz)]


@dataclass(frozen=True)
class BuiltInSensor:
    """A sensor or battery inside its carrier, or too flat to matter for collisions: only a frame."""


def built_in_sensor(name: str, _: BuiltInSensor) -> list[ET.Element]:
    """Return the link ``<name>_link``; of a sensor between flange and hand, which carries the hand, z leaves the
    flange.
    """
    return [link(f"{name}_link")]


GENERATORS: dict[str, tuple[type, Callable[[str, Any], list[ET.Element] | Subtree]]] = {
    "differential_base": (DifferentialBase, differential_base),
    "offset_wrist_arm": (OffsetWristArm, offset_wrist_arm),
    "parallel_hand": (ParallelHand, parallel_hand),
    "post": (Post, post),
    "pan_tilt": (PanTilt, pan_tilt),
    "camera_body": (CameraBody, camera_body),
    "built_in_lidar": (BuiltInLidar, built_in_lidar),
    "steered_base": (SteeredBase, steered_base),
    "suction_cup": (SuctionCup, suction_cup),
    "swinging_hand": (SwingingHand, swinging_hand),
    "sensing_flange": (BuiltInSensor, built_in_sensor),
    "built_in_sensor": (BuiltInSensor, built_in_sensor),
}
