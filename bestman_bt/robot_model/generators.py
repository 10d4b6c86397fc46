"""Parts that are drawn from dimensions instead of a URDF file, by name; here posts, heads and sensors."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from bestman_bt.configuration.quantity import Color, Length, Lengths3, Mass, PositiveLength, Size3
from bestman_bt.messages import Box, Cylinder
from bestman_bt.robot_model.generated_bases import (
    DifferentialBase,
    SteeredBase,
    differential_base,
    steered_base,
)
from bestman_bt.robot_model.generated_hands import (
    ParallelHand,
    SuctionCup,
    SwingingHand,
    parallel_hand,
    suction_cup,
    swinging_hand,
)
from bestman_bt.robot_model.urdf_elements import (
    box_inertial,
    fixed_joint,
    link,
    shape,
    turning_joint,
)
from bestman_bt.robot_model.urdf_source import Subtree

_RUBBER, _STEEL, _DARK = (0.08, 0.08, 0.09), (0.62, 0.64, 0.67), (0.13, 0.14, 0.16)
_ACROSS = (math.pi / 2, 0.0, 0.0)  # turns a cylinder's axis from z to y
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
    """Links ``<name>_link`` (solid) and ``<name>_top`` (a frame)."""
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
    """Links ``<name>_mount, <name>_pan_link, <name>_tilt_link``, joints ``<name>_pan_joint, <name>_tilt_joint``."""
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
    """Links ``<name>_link`` (x forward) and ``<name>_optical_frame`` (x right, y down, z forward)."""
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
    """The link ``<name>_link``: the scan plane is its x-y plane."""
    root, frame = f"{name}_mount", f"{name}_link"
    return [link(root), link(frame), fixed_joint(f"{frame}_joint", root, frame, d.xyz)]


@dataclass(frozen=True)
class BuiltInSensor:
    """A sensor or battery inside or on the surface of what carries it, or too flat to count: nothing but a frame."""


def built_in_sensor(name: str, _: BuiltInSensor) -> list[ET.Element]:
    """The link ``<name>_link``; of a sensor between flange and hand, which carries the hand, z leaves the flange."""
    return [link(f"{name}_link")]


GENERATORS: dict[str, tuple[type, Callable[[str, Any], list[ET.Element] | Subtree]]] = {
    "differential_base": (DifferentialBase, differential_base),
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
