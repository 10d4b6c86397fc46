"""The robot for Blender: what its links look like, by its URDF, and where they are (pinocchio)."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import coal
import numpy as np
import pinocchio

from bestman_bt.messages import Box, Cylinder, Mesh, Pose, Sphere
from bestman_bt.visualization.blender.plain_values import pose_document, shape_document
from bestman_bt.visualization.errors import RecordingError

IMPORTED = (".obj", ".stl", ".ply")
"""Meshes that Blender reads itself, with their materials; others are read here, without."""


class PaintedRobot:
    """A URDF robot: ``urdf`` is its text with absolute mesh paths, ``base_frame`` the link whose pose is given."""

    def __init__(self, urdf: str, base_frame: str) -> None:
        try:
            self._links = ElementTree.fromstring(urdf).findall("link")
            self._model = pinocchio.buildModelFromXML(urdf)
        except (ElementTree.ParseError, RuntimeError, ValueError) as error:
            raise RecordingError(f"robot URDF: {error}") from error
        self._data = self._model.createData()
        self._base_frame = base_frame

    def link_poses(self, map_from_base: Pose, joint_positions: Mapping[str, float]) -> dict[str, Pose]:
        """Where every link is, map frame; joints that are not named stand at 0."""
        model, data = self._model, self._data
        q = pinocchio.neutral(model)
        for name, value in joint_positions.items():
            if not model.existJointName(name):
                raise RecordingError(f"the robot {model.name!r} has no joint {name!r}")
            joint = model.joints[model.getJointId(name)]
            # A joint that turns without limits is kept as a point on the unit circle.
            q[joint.idx_q : joint.idx_q + joint.nq] = [value] if joint.nq == 1 else [np.cos(value), np.sin(value)]
        pinocchio.framesForwardKinematics(model, data, q)
        placed = {link.get("name", ""): self._root_from(link.get("name", "")) for link in self._links}
        map_from_root = map_from_base @ placed[self._base_frame].inverse()
        return {name: map_from_root @ pose for name, pose in placed.items()}

    def _root_from(self, link: str) -> Pose:
        placement = self._data.oMf[self._model.getFrameId(link)]
        quaternion = pinocchio.Quaternion(placement.rotation)
        return Pose(placement.translation, quaternion.coeffs())

    def document(self) -> list[dict[str, Any]]:
        """Each link's name and what is seen of it, as plain values."""
        return [{"name": link.get("name", ""), "parts": list(_visuals(link))} for link in self._links]


def _visuals(link: ElementTree.Element) -> Iterator[dict[str, Any]]:
    for visual in link.findall("visual"):
        origin = visual.find("origin")
        xyz, rpy = _numbers(origin, "xyz", "0 0 0"), _numbers(origin, "rpy", "0 0 0")
        paint = visual.find("material/color")
        color = _numbers(paint, "rgba", "") if paint is not None else None
        (geometry,) = visual.findall("geometry/*")
        part = {"pose": pose_document(Pose.from_xyz_rpy(xyz, rpy)), "color": color}
        match geometry.tag:
            case "box":
                x, y, z = _numbers(geometry, "size", "")
                yield part | {"shape": shape_document(Box((x, y, z)))}
            case "cylinder":
                (radius,), (length,) = _numbers(geometry, "radius", ""), _numbers(geometry, "length", "")
                yield part | {"shape": shape_document(Cylinder(radius, length))}
            case "sphere":
                (radius,) = _numbers(geometry, "radius", "")
                yield part | {"shape": shape_document(Sphere(radius))}
            case "mesh":
                yield part | {"shape": _mesh(geometry)}


def _mesh(geometry: ElementTree.Element) -> dict[str, Any]:
    path = Path(geometry.get("filename", "").removeprefix("file://"))
    scale = _numbers(geometry, "scale", "1 1 1")
    if not path.is_absolute() or not path.is_file():
        raise RecordingError(f"robot URDF: mesh {str(path)!r} should be the absolute path of a file")
    if path.suffix.lower() in IMPORTED:
        return {"kind": "file", "path": str(path), "scale": scale}
    try:
        read = coal.MeshLoader().load(str(path), np.array(scale))
    except (RuntimeError, ValueError) as error:
        raise RecordingError(f"robot URDF: mesh {path}: {error}") from error
    faces = [[read.tri_indices(i)[corner] for corner in range(3)] for i in range(read.num_tris)]
    return shape_document(Mesh(np.array(read.vertices()), np.array(faces)))


def _numbers(element: ElementTree.Element | None, key: str, default: str) -> list[float]:
    text = default if element is None else element.get(key, default)
    return [float(number) for number in text.split()]
