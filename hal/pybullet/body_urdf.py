"""URDF text of scene bodies: one link made of placed shapes with colours."""

from __future__ import annotations

from collections.abc import Sequence
from math import asin, atan2
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from bestman_bt.messages import Box, Cylinder, Mesh, PlacedShape, Pose, Shape, Sphere
from hal.pybullet.convex_margin import without_margin

Color = tuple[float, float, float, float]


def body_urdf(
    name: str,
    mass: float,
    collision: Sequence[PlacedShape],
    visual: Sequence[tuple[PlacedShape, Color]],
    folder: Path,
) -> str:
    """One rigid body; ``mass`` in kg (0: fixed). Meshes are written into ``folder`` as OBJ; of one that collides
    pybullet takes the convex hull.

    Pybullet derives the inertia from the collision shapes, about the body's frame.
    """
    robot = ElementTree.Element("robot", name=name)
    link = ElementTree.SubElement(robot, "link", name=name)
    inertial = ElementTree.SubElement(link, "inertial")
    ElementTree.SubElement(inertial, "mass", value=repr(float(mass)))
    zero = dict.fromkeys(("ixx", "ixy", "ixz", "iyy", "iyz", "izz"), "0")
    ElementTree.SubElement(inertial, "inertia", zero)
    for i, (placed, color) in enumerate(visual):
        element = _placed(link, "visual", placed, folder / f"{name}_visual_{i}.obj")
        material = ElementTree.SubElement(element, "material", name=f"{name}_{i}")
        ElementTree.SubElement(material, "color", rgba=" ".join(map(repr, map(float, color))))
    for i, placed in enumerate(collision):
        solid = PlacedShape(without_margin(placed.shape), placed.pose) if isinstance(placed.shape, Mesh) else placed
        _placed(link, "collision", solid, folder / f"{name}_collision_{i}.obj")
    ElementTree.indent(robot)  # pybullet breaks lines after 8 kB, wherever that is
    return ElementTree.tostring(robot, encoding="unicode")


def _placed(link: ElementTree.Element, tag: str, placed: PlacedShape, mesh_file: Path) -> ElementTree.Element:
    element = ElementTree.SubElement(link, tag)
    ElementTree.SubElement(element, "origin", _origin(placed.pose))
    geometry = ElementTree.SubElement(element, "geometry")
    _geometry(geometry, placed.shape, mesh_file)
    return element


def _origin(pose: Pose) -> dict[str, str]:
    r = pose.rotation
    pitch = asin(max(-1.0, min(1.0, -r[2, 0])))
    if abs(r[2, 0]) < 1.0 - 1e-9:
        roll, yaw = atan2(r[2, 1], r[2, 2]), atan2(r[1, 0], r[0, 0])
    else:  # gimbal lock: only roll ± yaw is determined
        roll, yaw = atan2(-r[1, 2], r[1, 1]), 0.0
    return {"xyz": " ".join(repr(float(v)) for v in pose.position), "rpy": f"{roll!r} {pitch!r} {yaw!r}"}


def _geometry(parent: ElementTree.Element, shape: Shape, mesh_file: Path) -> None:
    match shape:
        case Box():
            ElementTree.SubElement(parent, "box", size=" ".join(repr(float(v)) for v in shape.size))
        case Cylinder():
            size = {"radius": repr(float(shape.radius)), "length": repr(float(shape.length))}
            ElementTree.SubElement(parent, "cylinder", size)
        case Sphere():
            ElementTree.SubElement(parent, "sphere", radius=repr(float(shape.radius)))
        case Mesh():
            write_obj(shape, mesh_file)
            ElementTree.SubElement(parent, "mesh", filename=str(mesh_file))


def write_obj(mesh: Mesh, file: Path) -> None:
    """Write triangles as Wavefront OBJ, with a normal per face so that the renderer shades them flat."""
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    normals = np.cross(b - a, c - a)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    lines = [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in mesh.vertices]
    lines += [f"vn {x:.6g} {y:.6g} {z:.6g}" for x, y, z in normals]
    lines += [f"f {i + 1}//{n} {j + 1}//{n} {k + 1}//{n}" for n, (i, j, k) in enumerate(mesh.faces, start=1)]
    file.write_text("\n".join(lines) + "\n", encoding="ascii")
