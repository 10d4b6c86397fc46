"""The tree of links and joints of a URDF file, for inferring the kind of part."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Sequence
from functools import cached_property
from pathlib import Path

from bestman_bt.registry import suggestion
from bestman_bt.robot_model.model import ArmModel, RobotModel
from bestman_bt.robot_model.sensor_parts import CameraPart, ImuPart, LidarPart, MountedForceTorque, TactilePart
from bestman_bt.robot_model.urdf_elements import child_of, joints_to, parent_of, structure_faults, value_faults
from bestman_bt.robot_model.urdf_source import Srdf, SrdfGroup, Subtree, UrdfError, distinguish_joints, read_subtree


def joints_above(model: RobotModel, frame: str) -> frozenset[str]:
    """Return the names of all joints between the robot's root and ``frame``; empty for the root or an unknown frame."""
    above = joints_to(ET.fromstring(model.urdf))
    joints = set()
    while frame in above:
        joints.add(above[frame].get("name", ""))
        frame = parent_of(above[frame])
    return frozenset(joints)


def arm_of(model: RobotModel, part: str) -> str | None:
    """Return the arm that a part is, or that carries it, or None.

    Raises KeyError for an unknown part.
    """
    if part in model.arm_names:
        return part
    if part in model.hand_of:
        return model.hand_of[part]
    mounted = model.parts[part]
    if not isinstance(mounted, CameraPart | ImuPart | LidarPart | MountedForceTorque | TactilePart):
        return None
    frame = mounted.part.frame if isinstance(mounted, MountedForceTorque) else mounted.frame
    joints = joints_above(model, frame)
    return next((name for name, arm in model.of(ArmModel).items() if joints & set(arm.joint_names)), None)


class UrdfTree:
    """The joints of the file, in order, without the subtrees ``cut``. Raises UrdfError listing every fault."""

    def __init__(self, path: Path, cut: Sequence[str] = (), packages: Sequence[Path] = ()) -> None:
        self.path = path
        self._cut, self._packages = tuple(cut), tuple(packages)
        try:
            robot = ET.parse(path).getroot()
        except (OSError, ET.ParseError) as error:
            raise UrdfError(f"{path} cannot be read as a URDF: {error}") from error
        if robot.tag != "robot":
            hint = "; xacro files have to be expanded first" if path.suffix == ".xacro" else ""
            raise UrdfError(f"{path} is not a URDF: its root element is <{robot.tag}>, it should be <robot>{hint}")
        if any("xacro" in element.tag for element in robot.iter()):
            raise UrdfError(f"{path} contains xacro macros: expand them first (xacro FILE > FILE.urdf)")
        distinguish_joints(robot)
        self.links = {link.get("name", ""): link for link in robot.findall("link")}
        self.joints = {joint.get("name", ""): joint for joint in robot.findall("joint")}
        self.above = joints_to(robot)
        faults = structure_faults(robot)
        if not faults:
            self._cut_off(cut)
        kept = [*self.links.values(), *self.joints.values()]
        faults += value_faults(kept)
        if faults:
            raise UrdfError(*(f"{path.name}: {fault}" for fault in faults))

    @cached_property
    def root(self) -> str:
        """The name of the root link, which has no parent joint."""
        return next(name for name in self.links if name not in self.above)

    def moves(self, joint: ET.Element) -> bool:
        """Return whether the joint is not fixed."""
        return joint.get("type") != "fixed"

    def driven(self, joint: ET.Element) -> bool:
        """Return whether the joint is driven, not a mimic joint."""
        return self.moves(joint) and joint.find("mimic") is None

    def path_to(self, tip: str, base: str | None = None) -> list[ET.Element]:
        """Return the joints from ``base`` (default: the root) to ``tip``.

        Raises UrdfError if ``tip`` is not a descendant of ``base``.
        """
        chain: list[ET.Element] = []
        link = self.known(tip)
        while link != base and link in self.above:
            chain.append(self.above[link])
            link = parent_of(self.above[link])
        if base is not None and link != base:
            raise UrdfError(f"{self.path.name}: {tip!r} is not below {base!r}")
        return chain[::-1]

    def subtree(self, root: str | None = None) -> Subtree:
        """Return links and joints below ``root`` (default: the tree's root) for a part."""
        return read_subtree(self.path, root, self._cut, self._packages)

    def below(self, link: str) -> list[ET.Element]:
        """Return all joints beyond ``link``."""
        found, waiting = [], [link]
        while waiting:
            name = waiting.pop(0)
            for joint in self.joints.values():
                if parent_of(joint) == name:
                    found.append(joint)
                    waiting.append(child_of(joint))
        return found

    def known(self, link: str) -> str:
        """Return ``link`` if it exists. Raises UrdfError suggesting the closest name."""
        if link not in self.links:
            raise UrdfError(f"{self.path.name} has no link {link!r}; {suggestion(link, list(self.links))}")
        return link

    def group_joints(self, srdf: Srdf, name: str) -> list[str]:
        """Return the driven joints of an SRDF group, in the file's order. Raises UrdfError listing what the URDF
        lacks.
        """
        group = srdf.group(name)
        faults = self._lacking(f"the SRDF's group {name!r}", group)
        if faults:
            raise UrdfError(*faults)
        names = set(group.joints)
        names |= {self.above[link].get("name", "") for link in group.links if link in self.above}
        for base, tip in group.chains:
            names |= {joint.get("name", "") for joint in self.path_to(tip, base)}
        for inner in group.groups:
            names |= set(self.group_joints(srdf, inner))
        return [joint for joint in self.joints if joint in names and self.driven(self.joints[joint])]

    def _lacking(self, who: str, group: SrdfGroup) -> list[str]:
        ends = [link for chain in group.chains for link in chain]
        lost = [f"link {name!r}; {suggestion(name, list(self.links))}" for name in ends if name not in self.links]
        lost += [
            f"joint {name!r}; {suggestion(name, list(self.joints))}" for name in group.joints if name not in self.joints
        ]
        return [f"{who} names what {self.path.name} lacks: {name}" for name in lost]

    def _cut_off(self, cut: Sequence[str]) -> None:
        for link in cut:
            if self.known(link) == self.root:
                raise UrdfError(f"{self.path.name}: {link!r} is its root: nothing would be left with that cut off")
            for joint in (self.above[link], *self.below(link)):
                del self.joints[joint.get("name", "")], self.links[child_of(joint)], self.above[child_of(joint)]
