"""URDF text of furniture with doors and drawers: a fixed body and a link for each of them on its joint."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import PlacedShape, Pose
from bestman_bt.scene import Articulation, FurnitureModel
from hal.pybullet.body_urdf import body_urdf
from hal.simulation.mass_distribution import mass_distribution

_EFFORT, _VELOCITY = 1000.0, 10.0  # URDF asks for limits; nothing here drives the joints


def joint_name(articulation: Articulation) -> str:
    """Name of the joint of a door or drawer; its link is ``piece/door``, as a piece may be named like its door."""
    return f"{articulation.name}_joint"


def _link_name(piece: str, articulation: Articulation) -> str:
    return f"{piece}/{articulation.name}"


def furniture_urdf(name: str, model: FurnitureModel, folder: Path) -> str:
    """Furniture with its articulations closed; meshes are written into ``folder``."""
    colored = list(zip(model.parts, model.colors, strict=True))
    robot = ElementTree.fromstring(body_urdf(name, 0.0, model.parts, colored, folder))
    for articulation in model.articulations:
        robot.append(_leaf(name, articulation, folder))
        joint = ElementTree.SubElement(robot, "joint", name=joint_name(articulation), type=articulation.kind)
        ElementTree.SubElement(joint, "parent", link=name)
        ElementTree.SubElement(joint, "child", link=_link_name(name, articulation))
        ElementTree.SubElement(joint, "origin", xyz=_text(articulation.origin), rpy="0 0 0")
        ElementTree.SubElement(joint, "axis", xyz=_text(articulation.axis))
        limit = {"lower": "0", "upper": repr(articulation.upper), "effort": str(_EFFORT), "velocity": str(_VELOCITY)}
        ElementTree.SubElement(joint, "limit", limit)
    ElementTree.indent(robot)  # pybullet breaks lines after 8 kB, wherever that is
    return ElementTree.tostring(robot, encoding="unicode")


def _leaf(name: str, articulation: Articulation, folder: Path) -> ElementTree.Element:
    """The link of a door or drawer; its frame lies at the joint, turned as the furniture's."""
    from_furniture = Pose(-np.array(articulation.origin))
    parts = [PlacedShape(part.shape, from_furniture @ part.pose) for part in articulation.parts]
    colored = list(zip(parts, articulation.colors, strict=True))
    text = body_urdf(f"{name}_{articulation.name}", articulation.mass, parts, colored, folder)
    link = ElementTree.fromstring(text).find("link")
    assert link is not None
    link.set("name", _link_name(name, articulation))
    inertial = link.find("inertial")
    assert inertial is not None
    inertial.clear()
    centre, inertia = mass_distribution(parts, articulation.mass)
    ElementTree.SubElement(inertial, "origin", xyz=_text(centre), rpy="0 0 0")
    ElementTree.SubElement(inertial, "mass", value=repr(articulation.mass))
    terms = {f"i{'xyz'[i]}{'xyz'[j]}": repr(float(inertia[i, j])) for i in range(3) for j in range(i, 3)}
    ElementTree.SubElement(inertial, "inertia", terms)
    return link


def _text(values: Sequence[float] | NDArray[np.float64]) -> str:
    return " ".join(repr(float(value)) for value in values)
