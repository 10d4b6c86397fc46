"""Semantic robot descriptions (SRDF): groups of joints, their states, end effectors, pairs that need no check.

The format: https://wiki.ros.org/srdf/review, as MoveIt reads it.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from bestman_bt.registry import suggestion
from bestman_bt.robot_model.urdf_source import UrdfError


@dataclass(frozen=True)
class SrdfGroup:
    """The content of a group: joints, links, chains (base link, tip link), and other groups."""

    joints: tuple[str, ...] = ()
    links: tuple[str, ...] = ()
    chains: tuple[tuple[str, str], ...] = ()
    groups: tuple[str, ...] = ()


@dataclass(frozen=True)
class Srdf:
    """``states``: group → state → joint → position. ``faults``: positions that are not numbers, left out."""

    groups: Mapping[str, SrdfGroup]
    states: Mapping[str, Mapping[str, Mapping[str, float]]]
    disabled_pairs: tuple[tuple[str, str], ...]
    faults: tuple[str, ...] = ()

    def group(self, name: str) -> SrdfGroup:
        """Return a group by name. Raises UrdfError naming those there are."""
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
