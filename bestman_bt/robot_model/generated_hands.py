"""Hands that are drawn from dimensions."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from dataclasses import dataclass
from pathlib import Path

from bestman_bt.configuration.quantity import Color, Length, Mass, Size3
from bestman_bt.messages import Box
from bestman_bt.robot_model.urdf_elements import (
    box_inertial,
    fixed_joint,
    link,
    mesh_visual,
    shape,
    sliding_joint,
)
from bestman_bt.robot_model.urdf_source import locate_urdf

_DARK, _PAD = (0.13, 0.14, 0.16), (0.08, 0.08, 0.09)


@dataclass(frozen=True)
class ParallelHand:
    """A housing with two fingers that slide along y; z leaves the hand.

    ``housing`` and ``finger``: extents (x, y, z); ``tip``: from the tool frame to the ends of the fingers.
    ``housing_mesh``: what is drawn instead of the housing's box, ``PACKAGE:FILE``, its fingers sliding along x.
    """

    housing: Size3
    housing_mass: Mass
    finger: Size3
    finger_mass: Mass
    tip: Length = 0.01
    housing_mesh: str | None = None
    color: Color = (0.55, 0.57, 0.60)


def parallel_hand(name: str, d: ParallelHand) -> list[ET.Element]:
    """Links ``<name>_link``, ``<name>_left_finger``, ``<name>_right_finger``, ``<name>_tool``; the joints alike."""
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
