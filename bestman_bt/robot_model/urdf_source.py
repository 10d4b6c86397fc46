"""Links and joints of a part out of a URDF file, with meshes by absolute path, and the groups of an SRDF file."""

from __future__ import annotations

import copy
import os
import xml.etree.ElementTree as ET
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path

from bestman_bt.configuration.data import no_pybullet_data, pybullet_data
from bestman_bt.errors import Error
from bestman_bt.extras import install_command
from bestman_bt.registry import suggestion
from bestman_bt.robot_model.finger_linkage import MimicJoint
from bestman_bt.robot_model.urdf_elements import child_of, parent_of, structure_faults, value_faults

EXAMPLE_ROBOTS = "example_robot_data"


class UrdfError(Error, ValueError):
    """A URDF or SRDF cannot be used; ``faults`` lists every fault, one line each."""

    def __init__(self, *faults: str) -> None:
        self.faults = faults
        super().__init__("\n".join(faults))


def locate_urdf(source: str, folder: Path) -> Path:
    """Return the file behind ``package:path`` (data of an installed Python package) or a path relative to
    ``folder``.
    """
    package, separator, inside = source.partition(":")
    if not separator:
        path = folder / source
    elif package == EXAMPLE_ROBOTS:
        path = example_robots() / inside
    elif package == "pybullet_data":
        models = pybullet_data()
        if models is None:
            raise UrdfError(f"{inside} {no_pybullet_data()}")
        path = models / inside
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
def example_robots() -> Path:
    """Return the folder of robots of the distribution example-robot-data, which is not an importable package."""
    try:
        package = distribution("example-robot-data")
    except PackageNotFoundError as error:
        raise UrdfError(f"example-robot-data is not installed: {install_command('robots')}") from error
    marker = next((file for file in package.files or [] if "ur_description" in file.parts), None)
    if marker is None:
        raise UrdfError("the installed example-robot-data holds no robots")
    parts = marker.parts[: marker.parts.index("ur_description")]
    return Path(str(package.locate_file("/".join(parts))))


@dataclass(frozen=True)
class Subtree:
    """``elements``: links and joints below ``root``; ``mimics``: their ``<mimic>`` elements, removed from them."""

    elements: list[ET.Element]
    root: str
    mimics: tuple[MimicJoint, ...] = ()


def read_subtree(path: Path, root: str | None, cut: tuple[str, ...], packages: Sequence[Path] = ()) -> Subtree:
    """Return the links and joints below ``root`` (default: the file's root link) without the subtrees ``cut``.

    ``packages``: folders to search first for ``package://`` names. ``<mimic>``, ``<contact>`` and inertials without
    mass are removed, mesh paths become absolute. Raises UrdfError listing every fault of the rest.
    """
    try:
        tree = ET.parse(path).getroot()
    except ET.ParseError as error:
        raise UrdfError(f"{path} is not XML: {error}") from error
    faults = structure_faults(tree)
    if faults:
        raise UrdfError(*(f"{path.name}: {fault}" for fault in faults))
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
    kept = _kept(links, below, root, cut)
    faults = [*(f"{path.name}: {fault}" for fault in value_faults(kept)), *mesh_faults(kept, path, packages)]
    if faults:
        raise UrdfError(*faults)
    elements = [
        _clean_link(element, path, materials, packages) if element.tag == "link" else _clean_joint(element)
        for element in kept
    ]
    return Subtree(elements, root, tuple(mimic for element in kept for mimic in _mimics(element)))


def mesh_faults(elements: Iterable[ET.Element], urdf: Path, packages: Sequence[Path] = ()) -> list[str]:
    """Return the meshes of links that do not exist, each once."""
    names = dict.fromkeys(mesh.get("filename", "") for element in elements for mesh in element.iter("mesh"))
    faults: list[str] = []
    for name in names:
        try:
            locate_mesh(name, urdf, packages)
        except UrdfError as error:
            faults += error.faults
    return faults


def distinguish_joints(robot: ET.Element) -> None:
    """Append ``_joint`` to the names of joints that equal a link's name: names must be unique here."""
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


def locate_mesh(filename: str, urdf: Path, packages: Sequence[Path] = ()) -> Path:
    """Return the file of a URDF's ``filename``. Raises UrdfError listing the searched places.

    ``package://NAME/…`` is searched in ``packages``, in the folders above the URDF, in ``ROS_PACKAGE_PATH`` and
    ``AMENT_PREFIX_PATH`` as in ROS, and, if the package's folder has another name, without NAME.
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


def _kept(
    links: Mapping[str, ET.Element], below: Mapping[str, Sequence[ET.Element]], root: str, cut: tuple[str, ...]
) -> list[ET.Element]:
    """Return links and joints from ``root`` on, without the subtrees ``cut``; ``below``: link → the joints that it
    carries.
    """
    kept: list[ET.Element] = []
    waiting = [root]
    while waiting:
        name = waiting.pop()
        kept.append(links[name])
        for joint in below.get(name, ()):
            child = child_of(joint)
            if child not in cut:
                kept.append(joint)
                waiting.append(child)
    return kept


# Semantic robot descriptions (SRDF): groups of joints, their states, end effectors, pairs that need no check.
# The format: https://wiki.ros.org/srdf/review, as MoveIt reads it.


@dataclass(frozen=True)
class SrdfGroup:
    """The content of a group: joints, links, chains (base link, tip link), and other groups."""

    joints: tuple[str, ...] = ()
    links: tuple[str, ...] = ()
    chains: tuple[tuple[str, str], ...] = ()
    groups: tuple[str, ...] = ()


@dataclass(frozen=True)
class Srdf:
    """``states``: group → state → joint → position. ``faults``: positions that are not numbers; they are omitted."""

    groups: Mapping[str, SrdfGroup]
    states: Mapping[str, Mapping[str, Mapping[str, float]]]
    disabled_pairs: tuple[tuple[str, str], ...]
    faults: tuple[str, ...] = ()

    def group(self, name: str) -> SrdfGroup:
        """Return a group by name. Raises UrdfError listing the existing groups."""
        if name not in self.groups:
            raise UrdfError(f"the SRDF has no group {name!r}; {suggestion(name, list(self.groups))}")
        return self.groups[name]


def read_srdf(path: Path) -> Srdf:
    """Read an SRDF. Raises UrdfError if it is not one; other faults are listed in ``faults``."""
    try:
        robot = ET.parse(path).getroot()
    except (OSError, ET.ParseError) as error:
        raise UrdfError(f"{path} is not an SRDF: {error}") from error
    if robot.tag != "robot":
        raise UrdfError(f"{path} is not an SRDF: its root element is <{robot.tag}>, it should be <robot>")
    states: dict[str, dict[str, dict[str, float]]] = {}
    faults = []
    for state in robot.findall("group_state"):
        positions = {}
        for joint in state.findall("joint"):
            try:
                positions[joint.get("name", "")] = float(joint.get("value", ""))
            except ValueError:
                text = f"the state {state.get('name')!r} gives {joint.get('name')!r} the value {joint.get('value')!r}"
                faults.append(f"{path.name}: {text}: it should be one number")
        states.setdefault(state.get("group", ""), {})[state.get("name", "")] = positions
    return Srdf(
        groups={group.get("name", ""): _group(group) for group in robot.findall("group")},
        states=states,
        disabled_pairs=tuple(
            (pair.get("link1", ""), pair.get("link2", "")) for pair in robot.findall("disable_collisions")
        ),
        faults=tuple(faults),
    )


def _group(group: ET.Element) -> SrdfGroup:
    return SrdfGroup(
        joints=tuple(joint.get("name", "") for joint in group.findall("joint")),
        links=tuple(link.get("name", "") for link in group.findall("link")),
        chains=tuple((chain.get("base_link", ""), chain.get("tip_link", "")) for chain in group.findall("chain")),
        groups=tuple(inner.get("name", "") for inner in group.findall("group")),
    )
