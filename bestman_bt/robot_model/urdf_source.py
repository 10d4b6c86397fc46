"""Links and joints of a part out of a URDF file: one subtree, meshes by absolute path, ready to be composed."""

from __future__ import annotations

import copy
import os
import xml.etree.ElementTree as ET
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path

from bestman_bt.registry import suggestion
from bestman_bt.robot_model.finger_linkage import MimicJoint
from bestman_bt.robot_model.urdf_elements import child_of, parent_of

EXAMPLE_ROBOTS = "example_robot_data"


class UrdfError(ValueError):
    """A URDF file, link or mesh that a part names and that is not there."""


def locate_urdf(source: str, folder: Path) -> Path:
    """The file behind ``package:path`` (data of an installed Python package) or a path relative to ``folder``."""
    package, separator, inside = source.partition(":")
    if not separator:
        path = folder / source
    elif package == EXAMPLE_ROBOTS:
        path = _example_robots() / inside
    elif package == "pybullet_data":
        path = Path(import_module("pybullet_data").getDataPath()) / inside
    else:
        try:
            module = import_module(package)
        except ImportError as error:
            raise UrdfError(f"the package {package!r} of {source!r} is not installed") from error
        path = Path(module.__path__[0]) / inside
    if not path.is_file():
        raise UrdfError(f"no such file: {source}")
    return path


@cache
def _example_robots() -> Path:
    """The folder of robots of the distribution example-robot-data, which is no importable package."""
    try:
        package = distribution("example-robot-data")
    except PackageNotFoundError as error:
        raise UrdfError("example-robot-data is not installed: pip install 'bestman-bt[robots]'") from error
    marker = next((file for file in package.files or [] if "ur_description" in file.parts), None)
    if marker is None:
        raise UrdfError("the installed example-robot-data holds no robots")
    parts = marker.parts[: marker.parts.index("ur_description")]
    return Path(str(package.locate_file("/".join(parts))))


@dataclass(frozen=True)
class Subtree:
    """``elements``: links and joints below ``root``; ``mimics``: what their ``<mimic>`` said, taken out of them."""

    elements: list[ET.Element]
    root: str
    mimics: tuple[MimicJoint, ...] = ()


def read_subtree(path: Path, root: str | None, cut: tuple[str, ...], packages: Sequence[Path] = ()) -> Subtree:
    """Links and joints below ``root`` (default: the file's root link) without the subtrees ``cut``.

    ``packages``: folders in which ``package://`` names are looked for first.
    ``<mimic>``, ``<contact>`` and inertials without mass are left out, mesh paths become absolute.
    """
    try:
        tree = ET.parse(path).getroot()
    except ET.ParseError as error:
        raise UrdfError(f"{path} is not XML: {error}") from error
    distinguish_joints(tree)
    links = {link.get("name", ""): link for link in tree.findall("link")}
    below: dict[str, list[ET.Element]] = {}
    children = set()
    for joint in tree.findall("joint"):
        below.setdefault(parent_of(joint), []).append(joint)
        children.add(child_of(joint))
    if root is None:
        root = next(name for name in links if name not in children)
    for name in (root, *cut):
        if name not in links:
            raise UrdfError(f"{path.name} has no link {name!r}; {suggestion(name, list(links))}")
    materials = {
        material.get("name", ""): material for material in tree.iter("material") if material.find("color") is not None
    }
    elements: list[ET.Element] = []
    mimics: list[MimicJoint] = []
    waiting = [root]
    while waiting:
        name = waiting.pop()
        elements.append(_clean_link(links[name], path, materials, packages))
        for joint in below.get(name, ()):
            child = child_of(joint)
            if child not in cut:
                elements.append(_clean_joint(joint))
                mimics += _mimics(joint)
                waiting.append(child)
    return Subtree(elements, root, tuple(mimics))


def distinguish_joints(robot: ET.Element) -> None:
    """Give joints that are called as a link is ``_joint`` at the end: here, names are of one thing only."""
    links = {link.get("name", "") for link in robot.findall("link")}
    shared = {joint.get("name", "") for joint in robot.findall("joint")} & links
    for joint in robot.findall("joint"):
        if joint.get("name", "") in shared:
            joint.set("name", f"{joint.get('name')}_joint")
        for mimic in joint.findall("mimic"):
            if mimic.get("joint", "") in shared:
                mimic.set("joint", f"{mimic.get('joint')}_joint")


def _mimics(joint: ET.Element) -> list[MimicJoint]:
    return [
        MimicJoint(
            joint.get("name", ""),
            mimic.get("joint", ""),
            float(mimic.get("multiplier", "1")),
            float(mimic.get("offset", "0")),
        )
        for mimic in joint.findall("mimic")
    ]


def _clean_joint(joint: ET.Element) -> ET.Element:
    joint = copy.deepcopy(joint)
    origin = joint.find("origin")
    for key in ("xyz", "rpy"):
        text = "0 0 0" if origin is None else origin.get(key, "0 0 0")
        if not _is_vector(text):
            what = f"joint {joint.get('name')!r} gives its {key} as {text!r}"
            raise UrdfError(f"{what}: that should be three numbers; cut the link behind it, or mend the file")
    for mimic in joint.findall("mimic"):
        joint.remove(mimic)
    return joint


def _clean_link(link: ET.Element, path: Path, materials: dict[str, ET.Element], packages: Sequence[Path]) -> ET.Element:
    link = copy.deepcopy(link)
    for contact in link.findall("contact"):
        link.remove(contact)
    inertial = link.find("inertial")
    mass = None if inertial is None else inertial.find("mass")
    if inertial is not None and (mass is None or float(mass.get("value", "0")) <= 0.0):
        link.remove(inertial)
    for mesh in link.iter("mesh"):
        mesh.set("filename", str(locate_mesh(mesh.get("filename", ""), path, packages)))
    for visual in link.findall("visual"):
        material = visual.find("material")
        if material is not None and len(material) == 0 and material.get("name", "") in materials:
            visual.remove(material)
            visual.append(copy.deepcopy(materials[material.get("name", "")]))
    for collision in link.findall("collision"):
        for material in collision.findall("material"):
            collision.remove(material)
    return link


def _is_vector(text: str) -> bool:
    try:
        return len([float(number) for number in text.split()]) == 3
    except ValueError:
        return False


def locate_mesh(filename: str, urdf: Path, packages: Sequence[Path] = ()) -> Path:
    """The file that a URDF calls ``filename``; UrdfError tells where it was looked for.

    ``package://NAME/…`` is looked for in ``packages``, in the folders above the URDF, as ROS does in
    ``ROS_PACKAGE_PATH`` and ``AMENT_PREFIX_PATH``, and, where the package's folder has another name, without it.
    """
    scheme, separator, relative = filename.rpartition("://")
    if scheme == "file" or Path(filename).is_absolute():
        file = Path(relative if separator else filename)
        if file.is_file():
            return file
        raise UrdfError(f"{urdf.name}: no such mesh: {filename}")
    above = urdf.absolute().parents
    folders = [*packages, *above, *_ros_folders()] if separator else [above[0], *packages, *above]
    names = [relative, relative.partition("/")[2]] if separator else [relative]
    for name in filter(None, names):
        for folder in folders:
            if (folder / name).is_file():
                return folder / name
    tried = ", ".join(str(folder) for folder in folders[:3])
    raise UrdfError(f"{urdf.name}: no such mesh: {filename} (looked for in {tried} and {len(folders) - 3} more)")


def _ros_folders() -> list[Path]:
    paths = [Path(path) for path in os.environ.get("ROS_PACKAGE_PATH", "").split(os.pathsep) if path]
    prefixes = [Path(path) for path in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep) if path]
    return paths + [prefix / "share" for prefix in prefixes]
