"""Hands generated from dimensions."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from dataclasses import dataclass
from pathlib import Path

from bestman_bt.configuration.quantity import Color, Length, Mass, PositiveLength, Size3
from bestman_bt.messages import Box, Cylinder
from bestman_bt.robot_model.finger_linkage import MimicJoint
from bestman_bt.robot_model.urdf_elements import (
    box_inertial,
    fixed_joint,
    link,
    mesh_visual,
    shape,
    sliding_joint,
    turning_joint,
)
from bestman_bt.robot_model.urdf_source import Subtree, locate_urdf

_DARK, _PAD = (0.13, 0.14, 0.16), (0.08, 0.08, 0.09)


@dataclass(frozen=True)
class ParallelHand:
    """A housing with two fingers that slide along y; z leaves the hand.

    ``housing`` and ``finger``: extents (x, y, z); ``tip``: from the tool frame to the ends of the fingers.
    ``housing_mesh``: visual mesh of the housing, ``PACKAGE:FILE``, its fingers sliding along x.
    """

    housing: Size3
    housing_mass: Mass
    finger: Size3
    finger_mass: Mass
    tip: Length = 0.01
    housing_mesh: str | None = None
    color: Color = (0.55, 0.57, 0.60)


def parallel_hand(name: str, d: ParallelHand) -> list[ET.Element]:
    """Return links ``<name>_link``, ``<name>_left_finger``, ``<name>_right_finger``, ``<name>_tool``, and their
    joints."""
    root, tool = f"{name}_link", f"{name}_tool"
    palm, length = d.housing[2], d.finger[2]
    middle = (0.0, 0.0, palm / 2)
    if d.housing_mesh is None:
        seen = shape("visual", Box(d.housing), middle, rgba=(*d.color, 1), material=f"{name}_paint")
    else:
        file = locate_urdf(d.housing_mesh, Path())
        seen = mesh_visual(str(file), rpy=(0.0, 0.0, math.pi / 2), rgba=(*d.color, 1), material=f"{name}_paint")
    elements = [
        link(root, box_inertial(d.housing_mass, d.housing, middle), seen, shape("collision", Box(d.housing), middle)),
        link(tool),
        fixed_joint(f"{tool}_joint", root, tool, (0.0, 0.0, palm + length - d.tip)),
    ]
    for side, sign in (("left", 1.0), ("right", -1.0)):
        finger = f"{name}_{side}_finger"
        centre = (0.0, sign * d.finger[1] / 2, length / 2)
        pad = Box((d.finger[0], 0.002, 2.5 * d.tip))
        at_tip = (0.0, sign * 0.001, length - 1.25 * d.tip)
        elements += [
            link(
                finger,
                box_inertial(d.finger_mass, d.finger, centre),
                shape("visual", Box(d.finger), centre, rgba=(*_DARK, 1), material=f"{finger}_paint"),
                shape("visual", pad, at_tip, rgba=(*_PAD, 1), material=f"{finger}_pad"),
                shape("collision", Box(d.finger), centre),
            ),
            sliding_joint(f"{name}_{side}_joint", root, finger, (0.0, sign, 0.0), (0.0, 0.0, palm)),
        ]
    return elements


@dataclass(frozen=True)
class SwingingHand:
    """A palm with two fingers on parallel linkages: they swing about x, their pads stay parallel; z leaves the hand.

    ``pivot``: (y, z) of a finger's axis at the palm, ``tip``: (y, z) from there to its pad's axis, both for the left
    finger pointing straight ahead. ``pad``: extents of the pad, ``pad_face``: distance of its face inside the pad's
    axis. ``finger_mesh``, ``tip_mesh``: visual meshes, ``PACKAGE:FILE``, x leaving the hand and y to the left.
    """

    palm: Size3
    palm_mass: Mass
    pivot: tuple[Length, Length]
    tip: tuple[Length, Length]
    finger_mass: Mass
    pad: Size3
    pad_face: Length
    finger_mesh: str | None = None
    tip_mesh: str | None = None
    color: Color = (0.70, 0.70, 0.72)


def swinging_hand(name: str, d: SwingingHand) -> Subtree:
    """Return links ``<name>_palm``, ``<name>_left_finger``, ``<name>_left_tip``, …, ``<name>_tool``; the joints of the
    tips are mimic joints."""
    root, tool = f"{name}_palm", f"{name}_tool"
    middle = (0.0, 0.0, d.palm[2] / 2)
    reach = d.pivot[1] + d.tip[1]
    elements = [
        link(
            root,
            box_inertial(d.palm_mass, d.palm, middle),
            shape("visual", Box(d.palm), middle, rgba=(*_DARK, 1), material=f"{name}_paint"),
            shape("collision", Box(d.palm), middle),
        ),
        link(tool),
        fixed_joint(f"{tool}_joint", root, tool, (0.0, 0.0, reach + d.pad[2] / 2)),
    ]
    mimics = []
    for side, sign in (("left", 1.0), ("right", -1.0)):
        finger, pad = f"{name}_{side}_finger", f"{name}_{side}_tip"
        # Drawn with x ahead and y to the left: x becomes z; the right finger is the left one turned over.
        turn = (0.0, -math.pi / 2, 0.0) if sign > 0 else (math.pi, -math.pi / 2, 0.0)
        bar = (0.014, 0.012, math.hypot(*d.tip))
        lean = math.atan2(-sign * d.tip[0], d.tip[1])
        middle_of_bar = (0.0, sign * d.tip[0] / 2, d.tip[1] / 2)
        at_pad = (0.0, sign * (d.pad[1] / 2 - d.pad_face), d.pad[2] / 2)
        drawn = {
            key: shape("visual", Box(size), xyz, rpy, (*d.color, 1), material=f"{name}_{key}")
            if mesh is None
            else mesh_visual(str(locate_urdf(mesh, Path())), rpy=turn, rgba=(*d.color, 1), material=f"{name}_{key}")
            for key, mesh, size, xyz, rpy in (
                ("finger", d.finger_mesh, bar, middle_of_bar, (lean, 0.0, 0.0)),
                ("tip", d.tip_mesh, d.pad, at_pad, (0.0, 0.0, 0.0)),
            )
        }
        elements += [
            link(
                finger,
                box_inertial(d.finger_mass, bar, middle_of_bar),
                drawn["finger"],
                shape("collision", Box(bar), middle_of_bar, (lean, 0.0, 0.0)),
            ),
            turning_joint(
                f"{name}_{side}_joint", root, finger, (-sign, 0.0, 0.0), (0.0, sign * d.pivot[0], d.pivot[1])
            ),
            link(
                pad,
                box_inertial(d.finger_mass / 2, d.pad, at_pad),
                drawn["tip"],
                shape("collision", Box(d.pad), at_pad),
            ),
            turning_joint(f"{name}_{side}_tip_joint", finger, pad, (sign, 0.0, 0.0), (0.0, sign * d.tip[0], d.tip[1])),
        ]
        mimics.append(MimicJoint(f"{name}_{side}_tip_joint", f"{name}_{side}_joint"))
    return Subtree(elements, root, tuple(mimics))


@dataclass(frozen=True)
class SuctionCup:
    """A tube with a rubber cup at its end; z leaves the cup."""

    length: PositiveLength
    cup_radius: PositiveLength
    cup_length: PositiveLength
    mass: Mass
    color: Color = (0.55, 0.57, 0.60)


def suction_cup(name: str, d: SuctionCup) -> list[ET.Element]:
    """Return links ``<name>_link``, ``<name>_cup`` and, in the middle of the cup's rim, ``<name>_tool``."""
    root, cup, tool = f"{name}_link", f"{name}_cup", f"{name}_tool"
    tube, bell = Cylinder(0.6 * d.cup_radius, d.length), Cylinder(d.cup_radius, d.cup_length)
    half, half_cup = (0.0, 0.0, d.length / 2), (0.0, 0.0, d.cup_length / 2)
    size = (1.2 * d.cup_radius, 1.2 * d.cup_radius, d.length)
    return [
        link(
            root,
            box_inertial(0.9 * d.mass, size, half),
            shape("visual", tube, half, rgba=(*d.color, 1), material=f"{name}_paint"),
            shape("collision", tube, half),
        ),
        link(
            cup,
            box_inertial(0.1 * d.mass, (2 * d.cup_radius, 2 * d.cup_radius, d.cup_length), half_cup),
            shape("visual", bell, half_cup, rgba=(*_PAD, 1), material=f"{name}_rubber"),
            shape("collision", bell, half_cup),
        ),
        fixed_joint(f"{cup}_joint", root, cup, (0.0, 0.0, d.length)),
        link(tool),
        fixed_joint(f"{tool}_joint", root, tool, (0.0, 0.0, d.length + d.cup_length)),
    ]
