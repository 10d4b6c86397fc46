"""Pairs of links that self-collision checks leave out: neighbours, rigid groups, and what the parts declare."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterable, Mapping
from itertools import combinations

from bestman_bt.robot_model.urdf_elements import child_of, parent_of


def allowed_self_pairs(
    robot: ET.Element, locked_joints: frozenset[str], declared: Iterable[tuple[str, str]]
) -> frozenset[frozenset[str]]:
    """Pairs of links with collision shapes that need no check.

    Links that fixed or ``locked_joints`` (wheels) join move as one; a link and its nearest ancestor with a shape
    are neighbours; ``declared`` pairs are taken as they are.
    """
    solid = {link.get("name", "") for link in robot.findall("link") if link.find("collision") is not None}
    parents: dict[str, tuple[str, bool]] = {}
    for joint in robot.findall("joint"):
        rigid = joint.get("type") == "fixed" or joint.get("name", "") in locked_joints
        parents[child_of(joint)] = (parent_of(joint), rigid)
    pairs = {frozenset(pair) for pair in declared}
    groups: dict[str, list[str]] = {}
    for link in sorted(solid):
        groups.setdefault(_group(link, parents), []).append(link)
        neighbour = _solid_ancestor(link, parents, solid)
        if neighbour is not None:
            pairs.add(frozenset((link, neighbour)))
    for members in groups.values():
        pairs.update(frozenset(pair) for pair in combinations(members, 2))
    return frozenset(pair for pair in pairs if len(pair) == 2 and pair <= solid)


def _group(link: str, parents: Mapping[str, tuple[str, bool]]) -> str:
    while link in parents and parents[link][1]:
        link = parents[link][0]
    return link


def _solid_ancestor(link: str, parents: Mapping[str, tuple[str, bool]], solid: set[str]) -> str | None:
    while link in parents:
        link = parents[link][0]
        if link in solid:
            return link
    return None
