"""URDF text of scene bodies: placed shapes with colours, furniture with doors and drawers, people on slides."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from hashlib import sha256
from math import asin, atan2
from pathlib import Path
from tempfile import TemporaryDirectory
from threading import Lock
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linprog
from scipy.spatial import ConvexHull, HalfspaceIntersection

from bestman_bt.messages import Box, Cylinder, Mesh, PlacedShape, Pose, Shape, Sphere
from bestman_bt.scene.scene import Articulation, FurnitureModel, Walker
from hal.simulation.joint_motors import mass_distribution

Color = tuple[float, float, float, float]
_EFFORT, _VELOCITY = 1000.0, 10.0  # URDF asks for limits


def body_urdf(
    name: str,
    mass: float,
    collision: Sequence[PlacedShape],
    visual: Sequence[tuple[PlacedShape, Color]],
) -> str:
    """Return the URDF of a rigid body; ``mass`` in kg (0: fixed). It names its meshes by path, see ``mesh_file``.

    PyBullet uses the convex hull of colliding meshes, and derives the inertia from the collision shapes, about the
    body's frame.
    """
    robot = ElementTree.Element("robot", name=name)
    link = ElementTree.SubElement(robot, "link", name=name)
    inertial = ElementTree.SubElement(link, "inertial")
    ElementTree.SubElement(inertial, "mass", value=repr(float(mass)))
    zero = dict.fromkeys(("ixx", "ixy", "ixz", "iyy", "iyz", "izz"), "0")
    ElementTree.SubElement(inertial, "inertia", zero)
    for i, (placed, color) in enumerate(visual):
        element = _placed(link, "visual", placed)
        material = ElementTree.SubElement(element, "material", name=f"{name}_{i}")
        ElementTree.SubElement(material, "color", rgba=" ".join(map(repr, map(float, color))))
    for placed in collision:
        solid = PlacedShape(without_margin(placed.shape), placed.pose) if isinstance(placed.shape, Mesh) else placed
        _placed(link, "collision", solid)
    ElementTree.indent(robot)  # pybullet breaks lines after 8 kB, wherever that is
    return ElementTree.tostring(robot, encoding="unicode")


def _placed(link: ElementTree.Element, tag: str, placed: PlacedShape) -> ElementTree.Element:
    element = ElementTree.SubElement(link, tag)
    ElementTree.SubElement(element, "origin", _origin(placed.pose))
    _geometry(ElementTree.SubElement(element, "geometry"), placed.shape)
    return element


def _origin(pose: Pose) -> dict[str, str]:
    r = pose.rotation
    pitch = asin(max(-1.0, min(1.0, -r[2, 0])))
    if abs(r[2, 0]) < 1.0 - 1e-9:
        roll, yaw = atan2(r[2, 1], r[2, 2]), atan2(r[1, 0], r[0, 0])
    else:  # gimbal lock: only roll ± yaw is determined
        roll, yaw = atan2(-r[1, 2], r[1, 1]), 0.0
    return {"xyz": " ".join(repr(float(v)) for v in pose.position), "rpy": f"{roll!r} {pitch!r} {yaw!r}"}


def _geometry(parent: ElementTree.Element, shape: Shape) -> None:
    match shape:
        case Box():
            ElementTree.SubElement(parent, "box", size=" ".join(repr(float(v)) for v in shape.size))
        case Cylinder():
            size = {"radius": repr(float(shape.radius)), "length": repr(float(shape.length))}
            ElementTree.SubElement(parent, "cylinder", size)
        case Sphere():
            ElementTree.SubElement(parent, "sphere", radius=repr(float(shape.radius)))
        case Mesh():
            ElementTree.SubElement(parent, "mesh", filename=str(mesh_file(shape)))


_writing = Lock()


def mesh_file(mesh: Mesh) -> Path:
    """Return a file of these triangles in a temporary folder of this process; equal meshes share a file.

    PyBullet never frees a mesh that it has read from a file, and reads each file name once.
    """
    digest = sha256(mesh.vertices.tobytes() + mesh.faces.tobytes()).hexdigest()
    file = Path(_mesh_folder().name) / f"{digest}.obj"
    with _writing:
        if not file.exists():
            _write_obj(mesh, file)
    return file


@cache
def _mesh_folder() -> TemporaryDirectory[str]:
    return TemporaryDirectory(prefix="bestman_bt_meshes_")


def _write_obj(mesh: Mesh, file: Path) -> None:
    """Write triangles as Wavefront OBJ, with a normal per face so that the renderer shades them flat."""
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    normals = np.cross(b - a, c - a)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    lines = [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in mesh.vertices]
    lines += [f"vn {x:.6g} {y:.6g} {z:.6g}" for x, y, z in normals]
    lines += [f"f {i + 1}//{n} {j + 1}//{n} {k + 1}//{n}" for n, (i, j, k) in enumerate(mesh.faces, start=1)]
    file.write_text("\n".join(lines) + "\n", encoding="ascii")


MARGIN = 0.001
"""Margin that pybullet adds to the hull of a mesh, metres."""


def without_margin(mesh: Mesh, margin: float = MARGIN) -> Mesh:
    """Return the convex hull of a mesh with all faces moved inwards by ``margin``; less where it is too thin for
    that.
    """
    planes = np.unique(ConvexHull(mesh.vertices).equations.round(9), axis=0)
    middle, depth = _deepest_point(planes)
    eroded = planes + np.array([0.0, 0.0, 0.0, min(margin, 0.8 * depth)])
    corners = HalfspaceIntersection(eroded, middle).intersections
    hull = ConvexHull(corners)
    return Mesh(corners, hull.simplices)


def _deepest_point(planes: NDArray[np.float64]) -> tuple[NDArray[np.float64], float]:
    """Return the centre (3,) and the radius of the largest ball inside planes (n, 4): normal, offset (a linear
    program).
    """
    rows = np.column_stack([planes[:, :3], np.ones(len(planes))])
    solved = linprog([0.0, 0.0, 0.0, -1.0], A_ub=rows, b_ub=-planes[:, 3], bounds=[(None, None)] * 3 + [(0.0, None)])
    return solved.x[:3], float(solved.x[3])


def joint_name(articulation: Articulation) -> str:
    """Return the joint name of a door or drawer. The link is ``piece/door``, because a piece may have the name of its
    door."""
    return f"{articulation.name}_joint"


def _link_name(piece: str, articulation: Articulation) -> str:
    return f"{piece}/{articulation.name}"


def furniture_urdf(name: str, model: FurnitureModel) -> str:
    """Return the URDF of furniture with closed doors and drawers."""
    colored = list(zip(model.parts, model.colors, strict=True))
    robot = ElementTree.fromstring(body_urdf(name, 0.0, model.parts, colored))
    for articulation in model.articulations:
        robot.append(_door(name, articulation))
        joint = ElementTree.SubElement(robot, "joint", name=joint_name(articulation), type=articulation.kind)
        ElementTree.SubElement(joint, "parent", link=name)
        ElementTree.SubElement(joint, "child", link=_link_name(name, articulation))
        ElementTree.SubElement(joint, "origin", xyz=_text(articulation.origin), rpy="0 0 0")
        ElementTree.SubElement(joint, "axis", xyz=_text(articulation.axis))
        limit = {"lower": "0", "upper": repr(articulation.upper), "effort": str(_EFFORT), "velocity": str(_VELOCITY)}
        ElementTree.SubElement(joint, "limit", limit)
    ElementTree.indent(robot)  # pybullet breaks lines after 8 kB, wherever that is
    return ElementTree.tostring(robot, encoding="unicode")


def _door(name: str, articulation: Articulation) -> ElementTree.Element:
    """Return the link of a door or drawer; its frame lies at the joint, turned as the furniture's."""
    from_furniture = Pose(-np.array(articulation.origin))
    parts = [PlacedShape(part.shape, from_furniture @ part.pose) for part in articulation.parts]
    colored = list(zip(parts, articulation.colors, strict=True))
    text = body_urdf(f"{name}_{articulation.name}", articulation.mass, parts, colored)
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


COLOR: Color = (0.85, 0.45, 0.20, 1.0)
SLIDES = ("along_x", "along_y")
_ABOVE_FLOOR = 0.01
_CARRIER_MASS = 1.0  # of the first slide, without a shape
_REACH = 30.0


def walker_urdf(walker: Walker) -> str:
    """Return an upright cylinder on two slides, along x and y, that motors move; they are at 0 at the start of its
    route.
    """
    robot = ElementTree.Element("robot", name=walker.name)
    ElementTree.SubElement(robot, "link", name="world")
    robot.append(_carrier())
    shape = PlacedShape(
        Cylinder(walker.radius, walker.height - _ABOVE_FLOOR),
        Pose.from_xyz_rpy((0.0, 0.0, (walker.height + _ABOVE_FLOOR) / 2), (0.0, 0.0, 0.0)),
    )
    body = ElementTree.fromstring(body_urdf("body", walker.mass, [shape], [(shape, COLOR)])).find("link")
    assert body is not None
    robot.append(body)
    for parent, child, slide, axis in (
        ("world", "carrier", SLIDES[0], "1 0 0"),
        ("carrier", "body", SLIDES[1], "0 1 0"),
    ):
        joint = ElementTree.SubElement(robot, "joint", name=slide, type="prismatic")
        ElementTree.SubElement(joint, "parent", link=parent)
        ElementTree.SubElement(joint, "child", link=child)
        ElementTree.SubElement(joint, "axis", xyz=axis)
        limit = {"lower": str(-_REACH), "upper": str(_REACH), "effort": str(_EFFORT), "velocity": str(_VELOCITY)}
        ElementTree.SubElement(joint, "limit", limit)
    ElementTree.indent(robot)
    return ElementTree.tostring(robot, encoding="unicode")


def _carrier() -> ElementTree.Element:
    link = ElementTree.Element("link", name="carrier")
    inertial = ElementTree.SubElement(link, "inertial")
    ElementTree.SubElement(inertial, "mass", value=str(_CARRIER_MASS))
    inertia = {"ixx": "0.01", "ixy": "0", "ixz": "0", "iyy": "0.01", "iyz": "0", "izz": "0.01"}
    ElementTree.SubElement(inertial, "inertia", inertia)
    return link
