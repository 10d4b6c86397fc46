"""Arms generated from Denavit-Hartenberg parameters, with tubes as link shapes; hands generated from dimensions."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from bestman_bt.configuration.quantity import Color, Length, Lengths3, Mass, PositiveLength, Size3
from bestman_bt.messages import Box, Cylinder
from bestman_bt.robot_model.finger_linkage import MimicJoint
from bestman_bt.robot_model.urdf_elements import (
    box_inertial,
    fixed_joint,
    link,
    mesh_visual,
    numbers,
    shape,
    sliding_joint,
    turning_joint,
)
from bestman_bt.robot_model.urdf_source import Subtree, locate_urdf

JOINTS = ("shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3")
LINKS = ("shoulder", "upper_arm", "forearm", "wrist_1", "wrist_2", "wrist_3")
_TURNS = {"x": (0.0, math.pi / 2, 0.0), "y": (math.pi / 2, 0.0, 0.0), "z": (0.0, 0.0, 0.0)}  # of a cylinder's axis
_CAP = (0.30, 0.42, 0.55)


@dataclass(frozen=True)
class _Tube:
    """Along an ``axis`` of its link, from ``start`` to ``end``, ``beside`` the link's frame; metres."""

    radius: float
    axis: Literal["x", "y", "z"]
    start: float
    end: float
    beside: tuple[float, float, float] = (0.0, 0.0, 0.0)

    @property
    def middle(self) -> tuple[float, float, float]:
        """In the link's frame."""
        half = (self.start + self.end) / 2
        x, y, z = (half * (axis == self.axis) + at for axis, at in zip("xyz", self.beside, strict=True))
        return x, y, z


@dataclass(frozen=True)
class OffsetWristArm:
    """Six joints, of which 2, 3 and 4 are parallel and 5 and 6 perpendicular, each with an offset.

    ``shoulder_height`` d1, ``upper_arm`` -a2, ``forearm`` -a3, ``wrist_1_offset`` d4, ``wrist_2_offset`` d5,
    ``wrist_3_offset`` d6: as given by the manufacturer. ``masses``, ``centres``: of the six moving links, kg and metres
    in the Denavit-Hartenberg frames rotated to the previous joint. ``upper_arm_beside``, ``forearm_beside``: offsets of
    the tubes along the axis of joint 2; ``radii``: of shoulder and upper arm, of the forearm, of the wrists.
    """

    shoulder_height: PositiveLength
    upper_arm: PositiveLength
    forearm: PositiveLength
    wrist_1_offset: PositiveLength
    wrist_2_offset: PositiveLength
    wrist_3_offset: PositiveLength
    masses: tuple[Mass, Mass, Mass, Mass, Mass, Mass]
    centres: tuple[Lengths3, Lengths3, Lengths3, Lengths3, Lengths3, Lengths3]
    upper_arm_beside: PositiveLength
    forearm_beside: Length
    radii: tuple[PositiveLength, PositiveLength, PositiveLength]
    base_mass: Mass = 4.0
    color: Color = (0.72, 0.74, 0.76)


def offset_wrist_arm(name: str, d: OffsetWristArm) -> list[ET.Element]:
    """Return links ``<name>_base_link``, ``<name>_shoulder_link`` … ``<name>_wrist_3_link``, and the flange
    ``<name>_tool0``.

    The root's x and y are opposite to those of the manufacturer's base frame, as usual in URDFs of such arms.
    """
    upper, lower, wrist = d.radii
    root = f"{name}_base_link"
    quarter = math.pi / 2
    frames: tuple[tuple[tuple[float, float, float], tuple[float, float, float]], ...] = (
        ((0.0, 0.0, d.shoulder_height), (0.0, 0.0, math.pi)),
        ((0.0, 0.0, 0.0), (quarter, 0.0, 0.0)),
        ((-d.upper_arm, 0.0, 0.0), (0.0, 0.0, 0.0)),
        ((-d.forearm, 0.0, d.wrist_1_offset), (0.0, 0.0, 0.0)),
        ((0.0, -d.wrist_2_offset, 0.0), (quarter, 0.0, 0.0)),
        ((0.0, d.wrist_3_offset, 0.0), (-quarter, 0.0, 0.0)),
    )
    tubes = (
        [_Tube(upper, "z", -0.45 * d.shoulder_height, upper)],
        [
            _Tube(upper, "z", upper, d.upper_arm_beside + upper),
            _Tube(0.9 * upper, "x", -d.upper_arm, 0.0, (0.0, 0.0, d.upper_arm_beside)),
            _Tube(0.9 * upper, "z", *_around(d.upper_arm_beside, upper), (-d.upper_arm, 0.0, 0.0)),
        ],
        [
            _Tube(0.9 * upper, "z", d.forearm_beside - lower, d.upper_arm_beside - upper),
            _Tube(lower, "x", -d.forearm, 0.0, (0.0, 0.0, d.forearm_beside)),
            _Tube(wrist, "z", d.forearm_beside - lower, d.wrist_1_offset - wrist, (-d.forearm, 0.0, 0.0)),
        ],
        [_Tube(wrist, "y", wrist - d.wrist_2_offset, 0.0), _Tube(wrist, "z", *_around(0.0, wrist))],
        [_Tube(wrist, "y", 0.0, 0.6 * d.wrist_3_offset), _Tube(wrist, "z", *_around(0.0, wrist))],
        [_Tube(0.85 * wrist, "z", -0.4 * d.wrist_3_offset, 0.0)],
    )
    sizes: tuple[tuple[float, ...], ...] = (
        (2 * upper,) * 3,
        (d.upper_arm, 2 * upper, 2 * upper),
        (d.forearm, 2 * lower, 2 * lower),
    )
    sizes += ((2 * wrist,) * 3,) * 3
    paint, cap = (*d.color, 1.0), (*_CAP, 1.0)
    foot = Cylinder(1.25 * upper, 0.5 * d.shoulder_height)
    middle = (0.0, 0.0, 0.25 * d.shoulder_height)
    elements: list[ET.Element] = [
        link(
            root,
            box_inertial(d.base_mass, (2.0 * upper, 2.0 * upper, 0.5 * d.shoulder_height), middle),
            shape("visual", foot, middle, rgba=cap, material=f"{name}_cap"),
            shape("collision", foot, middle),
        )
    ]
    parent = root
    for index, (part, joint) in enumerate(zip(LINKS, JOINTS, strict=True)):
        child, solids = f"{name}_{part}_link", list[ET.Element]()
        for tube in tubes[index]:
            solid, at, turn = Cylinder(tube.radius, tube.end - tube.start), tube.middle, _TURNS[tube.axis]
            capped = tube is tubes[index][-1] and index > 0
            seen = (cap, f"{name}_cap") if capped else (paint, f"{name}_paint")
            solids += [shape("visual", solid, at, turn, *seen), shape("collision", solid, at, turn)]
        elements.append(link(child, box_inertial(d.masses[index], sizes[index], d.centres[index]), *solids))
        place, rpy = frames[index]
        hinge = turning_joint(f"{name}_{joint}_joint", parent, child, (0, 0, 1), place)
        found = hinge.find("origin")
        assert found is not None
        found.set("rpy", numbers(rpy))
        elements.append(hinge)
        parent = child
    tip = f"{name}_tool0"
    elements += [link(tip), fixed_joint(f"{tip}_joint", parent, tip)]
    return elements


def _around(middle: float, half: float) -> tuple[float, float]:
    return middle - half, middle + half


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
