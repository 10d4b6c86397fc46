"""Arms generated from Denavit-Hartenberg parameters, with tubes as link shapes."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from dataclasses import dataclass
from typing import Literal

from bestman_bt.configuration.quantity import Color, Length, Lengths3, Mass, PositiveLength
from bestman_bt.messages import Cylinder
from bestman_bt.robot_model.urdf_elements import box_inertial, fixed_joint, link, numbers, shape, turning_joint

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
