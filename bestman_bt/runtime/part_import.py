"""Import of parts from any URDF: the kind of part, what the file leaves out, and the description."""

from __future__ import annotations

import dataclasses
import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import yaml

from bestman_bt.configuration.document import Document
from bestman_bt.configuration.errors import ConfigurationError
from bestman_bt.robot_model.compose import compose_robot
from bestman_bt.robot_model.model import RobotModel
from bestman_bt.robot_model.srdf import Srdf
from bestman_bt.robot_model.urdf_elements import child_of, parent_of
from bestman_bt.robot_model.urdf_source import UrdfError
from bestman_bt.robot_model.urdf_tree import UrdfTree
from bestman_bt.runtime.part_facts import (
    FEWEST_ARM_JOINTS,
    arm_facts,
    base_facts,
    gripper_facts,
    overlapping_pairs,
    written_limits,
)


@dataclass(frozen=True)
class PartRequest:
    """``kind``: None to infer it. ``group``: of the SRDF, None for the whole file. ``packages``: for ``package://``.

    ``cut``: links to leave out, with their descendants.
    """

    name: str
    kind: str | None = None
    group: str | None = None
    packages: tuple[Path, ...] = ()
    cut: tuple[str, ...] = ()


@dataclass(frozen=True)
class ImportedPart:
    """``description``: its YAML text; ``robot``: the part alone; ``notes``: what the file left open."""

    name: str
    kind: str
    description: str
    robot: RobotModel
    notes: tuple[str, ...] = field(default=())


def import_part(urdf: Path, request: PartRequest, srdf: Srdf | None = None) -> ImportedPart:
    """Create the description of the part in a URDF file. Raises UrdfError or ConfigurationError.

    If not given, the kind follows from the joints: continuous wheels about a level axis make a base, a chain of at
    least four joints an arm, up to three joints that move fingers a gripper.
    """
    tree, joints = _read(urdf, request, srdf)
    kind = request.kind or _kind(tree, joints)
    facts = {"arm": arm_facts, "gripper": gripper_facts, "base": base_facts}
    if kind not in facts:
        raise UrdfError(f"a part of the kind {kind!r} cannot be imported, only {', '.join(facts)}")
    fields, notes = facts[kind](tree, joints)
    notes += _left_out(tree, fields)
    fields["cut"] = sorted({*fields.get("cut", ()), *request.cut})
    data: dict[str, Any] = {
        "kind": kind,
        "description": f"{request.name}, from {urdf.name}.",
        "urdf": str(tree.path),
        **({"packages": [str(folder.resolve()) for folder in request.packages]} if request.packages else {}),
        **fields,
    }
    if srdf is not None and kind == "arm":
        states, more = _states(data["joints"], data["limits"], srdf)
        notes += [*more, *_strangers(tree, srdf)]
        if states:
            data["states"] = states
    if "limits" in data:
        data["limits"] = written_limits(tree, data["joints"], data["limits"])
    robot = _alone(urdf, request.name, data)
    links = set(_links_of(robot))
    if srdf is not None:
        pairs = [sorted(pair) for pair in srdf.disabled_pairs if set(pair) <= links]
    else:
        pairs = [sorted(pair) for pair in overlapping_pairs(robot)]
        if pairs:
            notes.append(f"{len(pairs)} pairs of links always overlap: they are excluded from collision checks")
    if pairs:
        data["may_touch"] = sorted(map(list, {tuple(pair) for pair in pairs}))
        robot = _alone(urdf, request.name, data)
    return ImportedPart(request.name, kind, _text(data, notes), robot, tuple(notes))


def _kind(tree: UrdfTree, joints: Sequence[str] | None) -> str:
    names = [name for name in joints or tree.joints if tree.driven(tree.joints[name])]
    driven = [tree.joints[name] for name in names]
    wheels = [joint for joint in driven if joint.get("type") == "continuous"]
    if len(wheels) >= 2 and len(wheels) == len(driven) and len({parent_of(joint) for joint in wheels}) == 1:
        return "base"
    chains = [[joint.get("name") for joint in tree.path_to(child_of(end))] for end in driven]
    longest = max((len(set(chain) & set(names)) for chain in chains), default=0)
    if longest >= FEWEST_ARM_JOINTS:
        return "arm"
    if 1 <= len(driven) <= 3:
        return "gripper"
    raise UrdfError(
        f"{tree.path.name} is neither clearly a base, nor an arm, nor a gripper ({len(driven)} joints, at most "
        f"{longest} in a row): say which with --kind, or which group of an SRDF with --group"
    )


def _states(
    joints: Sequence[str], limits: Mapping[str, Sequence[float]], srdf: Srdf
) -> tuple[dict[str, list[float]], list[str]]:
    states: dict[str, list[float]] = {}
    notes = []
    for of_group in srdf.states.values():
        for name, positions in of_group.items():
            unsaid = [joint for joint in joints if joint not in positions]
            if unsaid:
                if len(unsaid) < len(joints):
                    notes.append(f"the state {name!r} of the SRDF was left out: it lacks {', '.join(unsaid)}")
                continue
            values = [positions[joint] for joint in joints]
            within = all(
                low <= value <= high for low, value, high in zip(limits["lower"], values, limits["upper"], strict=True)
            )
            if within:
                states[name] = values
            else:
                notes.append(f"the state {name!r} of the SRDF is beyond the joint limits and was left out")
    return states, notes


def _strangers(tree: UrdfTree, srdf: Srdf) -> list[str]:
    """Return a note of what states and pairs of an SRDF name and the URDF lacks: an SRDF may be of a larger robot."""
    named = {joint for of_group in srdf.states.values() for state in of_group.values() for joint in state}
    paired = {link for pair in srdf.disabled_pairs for link in pair}
    lost = sorted({*(named - set(tree.joints)), *(paired - set(tree.links))})
    return [f"ignored, because the URDF lacks what the SRDF names there: {', '.join(lost)}"] if lost else []


def _left_out(tree: UrdfTree, fields: Mapping[str, Any]) -> list[str]:
    """Return notes on what is not part of the import: cut links, and joints that others have to move."""
    cut = fields.get("cut", ())
    notes = [f"cut off, with all descendants: {', '.join(cut)}"] if cut else []
    moved = {*fields.get("joints", ()), *fields.get("wheel_joints", ())}
    others = [name for name, joint in tree.joints.items() if tree.driven(joint) and name not in moved]
    if others:
        notes.append(
            f"the file has joints outside this part: {', '.join(others)}; import them as separate parts, "
            "with --kind or a --group of an SRDF"
        )
    return notes


def _alone(urdf: Path, name: str, data: Mapping[str, Any]) -> RobotModel:
    """Return the part as a robot of its own: whatever is wrong with it shows now, as a fault of the user's file."""
    with TemporaryDirectory() as folder:
        file = Path(folder) / f"{name}.yaml"
        file.write_text(_text(data, ()), encoding="utf-8")
        try:
            return compose_robot(name, Document({"parts": {name: {"part": str(file)}}}))
        except ConfigurationError as error:
            problems = [dataclasses.replace(fault, source=str(urdf), line=None) for fault in error.problems]
            raise ConfigurationError(problems) from error


def _read(urdf: Path, request: PartRequest, srdf: Srdf | None) -> tuple[UrdfTree, list[str] | None]:
    """Return the URDF and the joints of the requested group. Raises UrdfError listing the faults of both files."""
    faults = list(srdf.faults) if srdf is not None else []
    joints: list[str] | None = None
    try:
        tree = UrdfTree(urdf.resolve(), request.cut, request.packages)
        if srdf is not None and request.group is not None:
            joints = tree.group_joints(srdf, request.group)
    except UrdfError as error:
        raise UrdfError(*faults, *error.faults) from error
    if faults:
        raise UrdfError(*faults)
    return tree, joints


def _links_of(robot: RobotModel) -> list[str]:
    return [link.get("name", "") for link in ET.fromstring(robot.urdf).findall("link")]


def _text(data: Mapping[str, Any], notes: Sequence[str]) -> str:
    head = "".join(f"# {note}\n" for note in notes)
    return head + yaml.safe_dump(dict(data), sort_keys=False, allow_unicode=True, default_flow_style=None, width=110)
