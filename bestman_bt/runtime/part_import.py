"""Import of parts from any URDF: the kind of part, properties missing from the file, and the description."""

from __future__ import annotations

import dataclasses
import itertools
import math
import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pinocchio
import yaml
from numpy.typing import NDArray

from bestman_bt.configuration.document import Document
from bestman_bt.configuration.errors import ConfigurationError
from bestman_bt.manipulation.collision.coal_world import CoalCollisionModel
from bestman_bt.manipulation.collision.planning_scene import PlanningScene
from bestman_bt.robot_model.compose import compose_robot
from bestman_bt.robot_model.finger_linkage import MimicJoint, all_positions, link_poses
from bestman_bt.robot_model.footprint import origin_pose, outline
from bestman_bt.robot_model.model import ArmModel, RobotModel
from bestman_bt.robot_model.urdf_elements import child_of, parent_of
from bestman_bt.robot_model.urdf_source import Srdf, UrdfError
from bestman_bt.robot_model.urdf_tree import UrdfTree


@dataclass(frozen=True)
class PartRequest:
    """``kind``: None to infer it. ``group``: of the SRDF, None for the whole file. ``packages``: for ``package://``.

    ``cut``: links to omit, with their descendants.
    """

    name: str
    kind: str | None = None
    group: str | None = None
    packages: tuple[Path, ...] = ()
    cut: tuple[str, ...] = ()


@dataclass(frozen=True)
class ImportedPart:
    """An imported part. ``description``: YAML text; ``robot``: the part alone; ``notes``: properties not inferred."""

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
    facts = {"arm": infer_arm, "gripper": infer_gripper, "base": infer_base}
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
    links = {link.get("name", "") for link in ET.fromstring(robot.urdf).findall("link")}
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
    """Return a note on joints and links that the SRDF names but the URDF lacks: the SRDF may describe a larger
    robot.
    """
    named = {joint for of_group in srdf.states.values() for state in of_group.values() for joint in state}
    paired = {link for pair in srdf.disabled_pairs for link in pair}
    lost = sorted({*(named - set(tree.joints)), *(paired - set(tree.links))})
    return [f"ignored, because the URDF lacks what the SRDF names there: {', '.join(lost)}"] if lost else []


def _left_out(tree: UrdfTree, fields: Mapping[str, Any]) -> list[str]:
    """Return notes on elements that are not imported: cut links, and joints that other parts have to move."""
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
    """Return the part as a separate robot, so that its errors are reported now, as errors in the user's file."""
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


def _text(data: Mapping[str, Any], notes: Sequence[str]) -> str:
    head = "".join(f"# {note}\n" for note in notes)
    return head + yaml.safe_dump(dict(data), sort_keys=False, allow_unicode=True, default_flow_style=None, width=110)


Facts = tuple[dict[str, Any], list[str]]
Array = NDArray[np.float64]

FEWEST_ARM_JOINTS = 4
TIME_TO_SPEED = 0.25  # seconds to full speed of a joint without a known acceleration
FRICTION = 0.8
GUESSED_SLIP = 2.0
SAMPLES = 200
ALWAYS = 0.95

_UNITS = {
    False: {"lower": "rad", "upper": "rad", "velocity": "rad/s", "acceleration": "rad/s²", "effort": "N m"},
    True: {"lower": "m", "upper": "m", "velocity": "m/s", "acceleration": "m/s²", "effort": "N"},
}
"""Units of limits, of revolute and of prismatic joints."""


def infer_arm(tree: UrdfTree, joints: Sequence[str] | None) -> Facts:
    """Infer an arm: the longest chain of driven joints, or ``joints``; links beyond its last joint are cut off.

    Raises UrdfError.
    """
    if joints is None:
        ends = [child_of(joint) for joint in tree.joints.values() if tree.driven(joint)]
        if not ends:
            raise UrdfError(f"{tree.path.name} has no movable joint: it is not an arm")
        longest = max((tree.path_to(end) for end in ends), key=lambda chain: sum(map(tree.driven, chain)))
        chain = _before_the_hand(tree, [joint for joint in longest if tree.driven(joint)])
        if len(chain) < 2:
            where = child_of(chain[-1])
            raise UrdfError(f"{tree.path.name} branches at {where!r}: say which part with a group of an SRDF")
    else:
        chain = [tree.joints[name] for name in joints]
    for before, after in itertools.pairwise(chain):
        if before not in tree.path_to(child_of(after)):
            names = f"{before.get('name')!r} and {after.get('name')!r}"
            raise UrdfError(f"{tree.path.name}: {names} are on different branches: they do not form a chain")
    tip, cut = _tip(tree, child_of(chain[-1]))
    limits, notes = _limits(chain)
    root = _foot(tree, [parent_of(joint) for joint in tree.path_to(child_of(chain[0]))])
    fields = {"root": root, "cut": cut, "tip": tip, "joints": [joint.get("name", "") for joint in chain]}
    notes.append("'payload' is not in a URDF: add the maker's figure, and heavier loads will be refused")
    return {**fields, "limits": limits}, notes


def infer_gripper(tree: UrdfTree, joints: Sequence[str] | None) -> Facts:
    """Infer a gripper with two fingers: joints, open and closed positions, the tool frame between the fingers.

    Raises UrdfError.
    """
    names = list(joints) if joints is not None else _hand_joints(tree)
    if not names:
        raise UrdfError(f"{tree.path.name} has no joint that moves fingers: it is not a gripper")
    root = _common_root(tree, names)
    subtree = tree.subtree(root)
    mimics = [mimic for mimic in subtree.mimics if mimic.leader in tree.joints]
    limits, notes = _limits([tree.joints[name] for name in names])
    ends = (limits["lower"][0], limits["upper"][0])
    shapes = {end: _finger_clouds(subtree.elements, all_positions(dict.fromkeys(names, end), mimics)) for end in ends}
    first, second = _finger_links(tree, root, shapes[ends[0]], names, mimics)
    opened, closed = sorted(ends, key=lambda end: -_apart(shapes[end], first, second))
    closing = shapes[opened][first].mean(axis=0) - shapes[opened][second].mean(axis=0)
    ahead, tip = _ahead(shapes[closed], (first, second), closing)
    across = closing - (closing @ ahead) * ahead
    across /= np.linalg.norm(across)
    gaps = [
        abs(float((shapes[end][first].mean(axis=0) - shapes[end][second].mean(axis=0)) @ across))
        for end in (opened, closed)
    ]
    width = gaps[0] - gaps[1]
    axes = np.column_stack([np.cross(across, ahead), across, ahead])
    depth = min(0.015, 0.2 * tip)
    middle = (shapes[closed][first].mean(axis=0) + shapes[closed][second].mean(axis=0)) / 2
    place = middle - (middle @ ahead) * ahead + (tip - depth) * ahead
    unit = _UNITS[tree.joints[names[0]].get("type") == "prismatic"]["lower"]
    sliding = unit == "m" and not mimics
    notes += [
        "the widths take the closed fingers to meet; the friction, the pads and the largest force are guesses",
        "check the tool frame in the picture: z leaves the hand, y is the closing direction",
    ]
    rpy = np.asarray(pinocchio.rpy.matrixToRpy(axes))
    fields: dict[str, Any] = {
        "root": root,
        "frames": {"tool": {"link": root, "xyz": _rounded(place), "rpy": _rounded(rpy)}},
        "tool": "tool",
        "joints": names,
        **({} if sliding and min(ends) == 0.0 else {"open_at": f"{opened} {unit}", "closed_at": f"{closed} {unit}"}),
        "finger_links": [first, second],
        "min_width": 0.0,
        "max_width": f"{round(float(width), 5)} m",
        "max_speed": "0.1 m/s",
        "max_force": "40 N",
        "finger_depth": round(float(min(0.05, 0.8 * tip)), 4),
        "pad_size": [0.02, 0.02],
        "friction": FRICTION,
        "contact": {finger: {"lateral_friction": FRICTION} for finger in (first, second)},
        "may_touch": [[first, second]],
    }
    return fields, notes


def infer_base(tree: UrdfTree, joints: Sequence[str] | None) -> Facts:
    """Infer a base: two wheels make a differential drive, four unsteered wheels a skid-steered drive. Raises
    UrdfError.
    """
    names = list(joints) if joints is not None else [n for n, joint in tree.joints.items() if tree.driven(joint)]
    wheels = [name for name in names if tree.joints[name].get("type") == "continuous"]
    if len(wheels) not in (2, 4):
        raise UrdfError(f"{tree.path.name}: a base with {len(wheels)} wheels cannot be imported, only with 2 or 4")
    subtree = tree.subtree()
    poses = link_poses(subtree.elements, {}, tree.links)
    places = {name: poses[child_of(tree.joints[name])].position for name in wheels}
    rows = sorted(wheels, key=lambda name: (-round(float(places[name][0]), 3), -float(places[name][1])))
    radius = max(_radius(subtree.elements, child_of(tree.joints[wheels[0]])), 1e-3)
    height = float(places[rows[0]][2])
    if abs(height - radius) > 0.02:
        raise UrdfError(
            f"{tree.path.name}: the wheels (radius {radius:.3f} m) are {height:.3f} m above the root link "
            f"{subtree.root!r}: it should lie on the floor below them"
        )
    track = float(places[rows[0]][1] - places[rows[1]][1])
    notes = ["speeds, accelerations and the torque of the wheels are guesses: they are not in a URDF"]
    if len(wheels) == 4:
        notes.append(
            f"'turning_slip: {GUESSED_SLIP:g}' and 'rotor_inertia' are guesses: "
            "measure_turning_slip of bestman_bt.control.wheeled.turning_slip measures how much wider the track seems "
            "in turns"
        )
    fields: dict[str, Any] = {
        "drive": "differential" if len(wheels) == 2 else "skid",
        "wheel_joints": rows,
        "wheel_radius": round(radius, 5),
        "track": round(track, 5),
        **({} if len(wheels) == 2 else {"turning_slip": GUESSED_SLIP, "rotor_inertia": 0.3}),
        "wheel_torque": "30 N m",
        "max_vx": "0.5 m/s",
        "max_wz": "1 rad/s",
        "max_acceleration": "0.5 m/s²",
        "max_angular_acceleration": "1.5 rad/s²",
    }
    return fields, notes


def written_limits(
    tree: UrdfTree, joints: Sequence[str], limits: Mapping[str, Sequence[float]]
) -> dict[str, list[str]]:
    """Return the limits of joints as text with units."""
    units = [_UNITS[tree.joints[name].get("type") == "prismatic"] for name in joints]
    return {
        key: [f"{value} {unit[key]}" for value, unit in zip(row, units, strict=True)] for key, row in limits.items()
    }


def overlapping_pairs(robot: RobotModel) -> list[tuple[str, str]]:
    """Return the pairs of links that overlap in nearly all of several random arm configurations: by construction."""
    found: dict[tuple[str, str], int] = {}
    for name, arm in robot.of(ArmModel).items():
        world = CoalCollisionModel(robot).world(
            PlanningScene(positions={}, self_padding=0.0, other_arm_padding=0.0), name
        )
        rng = np.random.default_rng(0)
        for _ in range(SAMPLES):
            for pair in world.colliding_pairs(rng.uniform(arm.lower, arm.upper)):
                found[pair] = found.get(pair, 0) + 1
    return [pair for pair, count in found.items() if count >= ALWAYS * SAMPLES]


def _limits(chain: Sequence[ET.Element]) -> tuple[dict[str, list[float]], list[str]]:
    limits: dict[str, list[float]] = {key: [] for key in ("lower", "upper", "velocity", "acceleration", "effort")}
    missing: list[str] = []
    faults: list[str] = []
    for joint in chain:
        limit = joint.find("limit")
        given = {} if limit is None else {key: float(value) for key, value in limit.attrib.items()}
        endless = joint.get("type") == "continuous"
        lower, upper = (-2 * math.pi, 2 * math.pi) if endless else (given.get("lower", 0.0), given.get("upper", 0.0))
        name = joint.get("name")
        if lower >= upper:
            faults.append(f"joint {name!r} has no range: lower {lower:g}, upper {upper:g}")
        missing.extend(f"{name} ({key})" for key in ("velocity", "effort") if given.get(key, 0.0) <= 0.0)
        speed = given.get("velocity", 0.0) or 1.0
        row = (lower, upper, speed, speed / TIME_TO_SPEED, given.get("effort", 0.0) or 50.0)
        for key, value in zip(limits, row, strict=True):
            limits[key].append(round(value, 6))
    if faults:
        raise UrdfError(*faults)
    notes = [f"accelerations are not in a URDF: full speed within {TIME_TO_SPEED:g} s"]
    if missing:
        notes.append(f"guessed, because the URDF says nothing: {', '.join(missing)}")
    return limits, notes


def _foot(tree: UrdfTree, links: Sequence[str]) -> str:
    """Return the first link of an arm: the first one on the way to it that has a shape, or its joint's own link."""
    solid = (link for link in links if tree.links[link].find("visual") is not None)
    return next(solid, links[-1])


def _hand_joints(tree: UrdfTree) -> list[str]:
    """Return the driven joints without those of an arm that carries the hand in the same file."""
    driven = [name for name, joint in tree.joints.items() if tree.driven(joint)]
    chains = [[joint.get("name", "") for joint in tree.path_to(child_of(tree.joints[name]))] for name in driven]
    chain = max(chains, key=len, default=[])
    if sum(name in driven for name in chain) < FEWEST_ARM_JOINTS:
        return driven
    fields, _ = infer_arm(tree, None)
    return [name for name in driven if name not in fields["joints"]]


def _before_the_hand(tree: UrdfTree, chain: list[ET.Element]) -> list[ET.Element]:
    """Return the joints without those of a hand: those beyond the first link that carries two moving branches."""
    for index, joint in enumerate(chain):
        branches = [b for b in tree.joints.values() if parent_of(b) == child_of(joint) and _moves_below(tree, b)]
        if len(branches) > 1:
            return chain[: index + 1]
        carried = child_of(joint)
        while len(branches) == 1 and not tree.moves(branches[0]):
            carried = child_of(branches[0])
            branches = [b for b in tree.joints.values() if parent_of(b) == carried and _moves_below(tree, b)]
        if len(branches) > 1:
            return chain[: index + 1]
    return chain


def _moves_below(tree: UrdfTree, joint: ET.Element) -> bool:
    return tree.moves(joint) or any(tree.moves(below) for below in tree.below(child_of(joint)))


def _tip(tree: UrdfTree, link: str) -> tuple[str, list[str]]:
    """Return the last frame rigidly connected to the arm's last link, and the links to cut off there."""
    cut = [child_of(j) for j in tree.joints.values() if parent_of(j) == link and _moves_below(tree, j)]
    rigid = [j for j in tree.below(link) if not _moves_below(tree, j) and not tree.moves(j)]
    frames = [child_of(j) for j in rigid if parent_of(j) == link and not tree.links[child_of(j)].findall("collision")]
    preferred = [name for name in frames if any(word in name for word in ("tool0", "flange", "eef", "ee", "tip"))]
    return (preferred or [link])[0], cut


def _common_root(tree: UrdfTree, names: Sequence[str]) -> str:
    parents = [[parent_of(j) for j in tree.path_to(child_of(tree.joints[name]))] for name in names]
    common = [link for link in parents[0] if all(link in other for other in parents)]
    if not common:
        raise UrdfError(f"{tree.path.name}: the joints {', '.join(names)} have no link in common")
    return common[-1]


def _finger_clouds(elements: list[ET.Element], positions: dict[str, float]) -> dict[str, Array]:
    """Return the corners of each link's shapes in the root link's frame, (N, 3) metres."""
    links = [element for element in elements if element.tag == "link"]
    poses = link_poses(elements, positions, [link.get("name", "") for link in links])
    clouds = {}
    for link in links:
        name = link.get("name", "")
        shapes = link.findall("collision") or link.findall("visual")
        points = [origin_pose(s).apply(outline(s.find("geometry"))) for s in shapes]
        if points:
            clouds[name] = poses[name].apply(np.concatenate(points))
    return clouds


def _finger_links(
    tree: UrdfTree, root: str, clouds: dict[str, Array], names: Sequence[str], mimics: Sequence[MimicJoint]
) -> tuple[str, str]:
    """Return the last links with a shape on two different branches that move."""
    moving = {*names, *(mimic.joint for mimic in mimics)}
    tips = []
    for branch in (j for j in tree.joints.values() if parent_of(j) == root):
        chain = [branch, *tree.below(child_of(branch))]
        if any(joint.get("name") in moving for joint in chain):
            solid = [child_of(joint) for joint in chain if child_of(joint) in clouds]
            if solid:
                tips.append(solid[-1])
    if len(tips) < 2:
        raise UrdfError(f"{tree.path.name}: a gripper needs two fingers that move on {root!r}, found {len(tips)}")
    farthest = sorted(tips, key=lambda link: -float(np.linalg.norm(clouds[link], axis=1).max()))
    return farthest[0], farthest[1]


def _apart(clouds: dict[str, Array], first: str, second: str) -> float:
    return float(np.linalg.norm(clouds[first].mean(axis=0) - clouds[second].mean(axis=0)))


def _ahead(clouds: dict[str, Array], fingers: tuple[str, str], closing: Array) -> tuple[Array, float]:
    """Return the axis of the root frame, other than the closing axis, along which the fingers extend farthest, and that
    extent in metres.
    """
    points = np.concatenate([clouds[finger] for finger in fingers])
    candidates = [sign * axis for axis in np.eye(3) for sign in (1.0, -1.0)]
    closing = closing / np.linalg.norm(closing)
    ahead = max(
        (axis for axis in candidates if abs(axis @ closing) < 0.7), key=lambda axis: float((points @ axis).mean())
    )
    return ahead, float((points @ ahead).max())


def _radius(elements: list[ET.Element], wheel: str) -> float:
    link = next(element for element in elements if element.tag == "link" and element.get("name") == wheel)
    shapes = link.findall("collision") or link.findall("visual")
    points = np.concatenate([origin_pose(s).apply(outline(s.find("geometry"))) for s in shapes])
    return float(np.ptp(points[:, 2]) / 2)


def _rounded(values: Array) -> list[float]:
    return [round(float(value), 6) + 0.0 for value in values]
