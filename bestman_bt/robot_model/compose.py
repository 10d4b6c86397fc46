"""Composition of robots from parts: one URDF, with groups, limits, frames, sensors and postures."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from difflib import get_close_matches
from pathlib import Path
from typing import Any

import numpy as np

from bestman_bt.configuration.checked import numbered, override, salvage
from bestman_bt.configuration.data import find_data
from bestman_bt.configuration.document import Document, read_document
from bestman_bt.configuration.errors import ConfigurationError, Problem, ProblemCollector
from bestman_bt.registry import suggestion
from bestman_bt.robot_model.bringup_file import bringup_path, content_digest
from bestman_bt.robot_model.describe import describe
from bestman_bt.robot_model.finger_linkage import all_positions
from bestman_bt.robot_model.hardware_config import read_connections, wider_limits, with_hardware
from bestman_bt.robot_model.model import RobotModel
from bestman_bt.robot_model.mounting import mount_place, mount_problems
from bestman_bt.robot_model.part_config import (
    ArmPart,
    BasePart,
    GripperPart,
    JointedPart,
    JointGroupPart,
    LeggedBasePart,
)
from bestman_bt.robot_model.payload import payload
from bestman_bt.robot_model.placed_part import PlacedPart, links_of_invalid_part, read_part
from bestman_bt.robot_model.robot_config import RobotConfig, name_fault
from bestman_bt.robot_model.sensor_parts import BumperPart, ImuPart
from bestman_bt.robot_model.urdf_elements import fixed_joint

FOLLOWER_SLACK = 0.1
_OF_A_RUN = ("connections.", "safety.", "bringup")
"""Settings of a run that do not change the robot."""


def write_limits(part: PlacedPart) -> None:
    """Replace the URDF's joint limits by those of the part's description."""
    config = part.config
    limits: dict[str, tuple[float, float, float, float]] = {}  # lower, upper, velocity, effort
    if isinstance(config, JointedPart):
        each = config.limits
        rows = zip(each.lower, each.upper, each.velocity, each.effort, strict=True)
        limits = dict(zip(config.joints, rows, strict=True))
    elif isinstance(config, GripperPart):
        limits = _gripper_limits(part, config)
    elif isinstance(config, BasePart):
        speed = (config.max_vx + config.max_wz * config.track / 2) / config.wheel_radius
        limits = dict.fromkeys(config.wheel_joints, (0.0, -1.0, speed, config.wheel_torque))
        steering = (0.0, -1.0, config.steering_speed, config.steering_torque)
        limits |= dict.fromkeys(config.steering_joints, steering)
    for element in part.elements:
        row_or_none = limits.get(element.get("name", "")) if element.tag == "joint" else None
        if row_or_none is None:
            continue
        if isinstance(config, JointGroupPart):
            # Hands come with dampings far beyond what their light links can take in a step of a simulation.
            for dynamics in element.findall("dynamics"):
                element.remove(dynamics)
        limit = element.find("limit")
        limit = ET.SubElement(element, "limit") if limit is None else limit
        lower, upper, velocity, effort = row_or_none
        if element.get("type") == "continuous" and isinstance(config, JointedPart):
            element.set("type", "revolute")  # its description says how far the cables let it turn
        if element.get("type") == "continuous":
            limit.attrib.pop("lower", None)
            limit.attrib.pop("upper", None)
        else:
            limit.set("lower", f"{lower:.9g}")
            limit.set("upper", f"{upper:.9g}")
        limit.set("velocity", f"{velocity:.9g}")
        limit.set("effort", f"{effort:.9g}")


def _gripper_limits(part: PlacedPart, config: GripperPart) -> dict[str, tuple[float, float, float, float]]:
    """Return the limits of the finger joints: by the widths, the speed and the force of the gripper."""
    n = len(config.joints)
    if not part.opening:
        row = (config.min_width / n, config.max_width / n, config.max_speed / n, config.max_force)
        return dict.fromkeys(config.joints, row)
    positions, widths = np.array(part.opening).T
    per_metre = np.abs(np.diff(positions) / np.diff(widths))
    speed, effort = float(per_metre.max() * config.max_speed), float(config.max_force / (n * per_metre.min()))
    ends = [
        all_positions(dict.fromkeys(config.joints, float(end)), part.mimics)
        for end in (positions.min(), positions.max())
    ]
    limits = {}
    for joint in ends[0]:
        lower, upper = sorted(end[joint] for end in ends)
        # Gears give a little: those that follow must not strike a limit before the one that leads.
        slack = 0.0 if joint in config.joints else FOLLOWER_SLACK
        limits[joint] = (lower - slack, upper + slack, speed, effort)
    return limits


def load_robot_model(name_or_path: str | Path, overrides: Mapping[str, Any] | None = None) -> RobotModel:
    """Compose the robot of a YAML of parts.

    A bare name means a shipped robot. ``overrides``: dotted keys → values, for example
    ``{"parts.mast.set.dimensions.mass": "2 kg"}``. Raises ConfigurationError with file, line and field.
    """
    path = find_data("robot", name_or_path)
    settings = dict(overrides or {})
    faults = ProblemCollector()
    document = read_document(path, faults.problems)
    given = {"calibration": settings.pop("calibration")} if "calibration" in settings else {}
    with faults.step():
        document = override(document, RobotConfig, given, prefix="robot.")
    document = with_calibration(document, Path() if given else path.parent, faults)
    of_run = {key: settings.pop(key) for key in tuple(settings) if key.startswith(_OF_A_RUN)}
    with faults.step():
        document = override(document, RobotConfig, settings, prefix="robot.")
    described = document
    with faults.step():
        document = override(document, RobotConfig, of_run, prefix="robot.")
    with faults.step():
        model = compose_robot(path.stem, document)
    faults.raise_if_any()
    named = document.data.get("bringup")
    bringup = path.parent / named if named else bringup_path(path)
    return replace(model, bringup=bringup, content=content_digest(described))


@dataclass
class _RobotFile:
    """The file of a robot as it is read: ``names`` of the parts that it lists, those that are placed, all faults."""

    document: Document
    config: RobotConfig
    names: list[str]
    faults: ProblemCollector
    placed: dict[str, PlacedPart] = field(default_factory=dict)

    def wrong(self, place: tuple[Any, ...], message: str) -> None:
        """Add a fault."""
        self.faults.problems.append(self.document.problem(place, message))

    def base_frame(self) -> str | None:
        """Return the base frame; None if no link has that name, or the root part, which should have it, is unread."""
        if not self.names or self.names[0] not in self.placed:
            return None
        base_frame = self.config.base_frame or self.placed[self.names[0]].root
        links = [link for part in self.placed.values() for link in part.links]
        if base_frame in links:
            return base_frame
        message = f"no link {base_frame!r}; {suggestion(base_frame, links)}"
        self.wrong(("base_frame",), message)
        return None

    def check_default_arm(self) -> None:
        """Add the fault of a default arm that does not exist."""
        arms = [name for name in self.names if name not in self.placed or isinstance(self.placed[name].config, ArmPart)]
        wanted = self.config.default_arm
        if wanted is not None and wanted not in arms:
            self.wrong(("default_arm",), f"the robot has no arm {wanted!r}; {suggestion(wanted, arms)}")

    def joined(self, name: str) -> ET.Element:
        """Return one URDF of all parts."""
        urdf = ET.Element("robot", name=name)
        for part in self.placed.values():
            urdf.extend(part.elements)
            place = mount_place(self.config.parts[part.name], part, self.placed)
            if place is not None:
                link, xyz, rpy = place
                urdf.append(fixed_joint(f"{part.name}_mount_joint", link, part.root, xyz, rpy))
            write_limits(part)
        ET.indent(urdf)
        return urdf

    def place_parts(self) -> bool:
        """Place the parts that can be read; return whether all were read and mounted without a fault."""
        taken: set[str] = set()
        unread: dict[str, list[str] | None] = {}
        mislaid = flawed = False
        if not self.document.data["parts"]:
            self.wrong(("parts",), "a robot needs at least one part")
        for part_name in self.document.data["parts"]:
            strange = name_fault(part_name) if isinstance(part_name, str) else None
            if strange is not None:
                self.wrong(("parts", part_name), strange)
            mounted = self.config.parts.get(part_name)
            if mounted is None:
                unread[part_name] = None
                continue
            changes = self.document.below("parts", part_name, "set") if mounted.set else Document({})
            asked_by = self.document.problem(("parts", part_name, "part"), "")
            part: PlacedPart | None = None
            found = ProblemCollector()
            with found.step():
                part = read_part(part_name, mounted.part, changes, asked_by, taken, found.problems)
            self.faults.problems += _seen_from_the_robot(found.problems, part_name, changes)
            flawed = flawed or bool(found.problems)
            wrong = mount_problems(self.document, part_name, mounted, part, self.placed, unread)
            self.faults.problems += wrong
            mislaid = mislaid or bool(wrong)
            if part is None:
                unread[part_name] = None
                with found.step():  # ``part`` itself may be what could not be read
                    unread[part_name] = links_of_invalid_part(part_name, mounted.part, changes, taken)
                taken.update(unread[part_name] or ())
                continue
            self.placed[part_name] = part
            taken |= {element.get("name", "") for element in part.elements}
        return bool(self.placed) and not unread and not mislaid and not flawed

    def check_companions(self) -> None:
        """Add the faults of parts that work only with another one, which the robot lacks."""
        kinds = {type(part.config) for part in self.placed.values()}
        for name, part in self.placed.items():
            if isinstance(part.config, LeggedBasePart) and ImuPart not in kinds:
                message = f"its legs balance by an imu, and the robot has none: mount one on {part.config.root!r}"
                self.wrong(("parts", name), message)
            if isinstance(part.config, BumperPart) and not kinds & {BasePart, LeggedBasePart}:
                message = "a bumper lies around the footprint of a base, and the robot has none: leave it out"
                self.wrong(("parts", name), message)

    def wider_limits(self) -> Iterable[Problem]:
        """Return limits of real arms that the robot's file sets beyond those of their parts."""
        for name in (part for connection in self.config.connections.values() for part in connection.parts):
            part = self.placed[name].config if name in self.placed else None
            if isinstance(part, ArmPart) and "limits" in self.config.parts[name].set:
                asked_by = self.document.problem(("parts", name, "part"), "")
                described = read_part(name, self.config.parts[name].part, Document({}), asked_by, set(), []).config
                if isinstance(described, ArmPart):
                    yield from wider_limits(name, part, described, self.document)

    def postures(self) -> dict[str, dict[str, float]]:
        """Return positions by name of posture and joint: the robot's own, then the states of its parts."""
        postures: dict[str, dict[str, float]] = {}
        for posture, of_parts in self.config.postures.items():
            postures[posture] = {}
            for part_name, positions in of_parts.items():
                field = ("postures", posture, part_name)
                part = self.placed.get(part_name)
                joints: tuple[str, ...] = getattr(part.config, "joints", ()) if part is not None else ()
                if part is None and part_name in self.names:
                    continue  # it could not be read, which is told
                if part is None:
                    message = f"unknown part; {suggestion(part_name, self.names)}"
                    self.wrong(field, message)
                elif (count := self.document.count(field)) not in (None, len(joints)):
                    message = f"should have {len(joints)} positions, one per joint, got {count}"
                    self.wrong(field, message)
                elif len(positions) == len(joints):
                    postures[posture] |= dict(zip(joints, positions, strict=True))
                    self.faults.problems += _limit_problems(self.document, field, part.config, positions)
        for state, joint, position in _states(self.placed.values()):
            postures.setdefault(state, {}).setdefault(joint, position)
        return postures

    def declared_pairs(self) -> list[tuple[str, str]]:
        """Return pairs of links that need no check, as the parts and the robot declare."""
        links = [link for part in self.placed.values() for link in part.links]
        pairs = [pair for part in self.placed.values() for pair in part.config.may_touch]
        # A link that is not there may be of one of them.
        unread = [name for name in self.names if name not in self.placed]
        for index, pair in numbered(self.config.never_touch):
            groups: list[list[str]] = []
            for name in pair:
                if name in self.placed:
                    groups.append(self.placed[name].links)
                elif name in links:
                    groups.append([name])
                elif name not in unread and (not unread or _is_misspelt(name, self.names, links)):
                    message = f"no part or link {name!r}; {suggestion(name, [*self.names, *links])}"
                    self.wrong(("never_touch", index), message)
            if len(groups) == 2:
                pairs += [(a, b) for a in groups[0] for b in groups[1]]
        return pairs


def compose_robot(name: str, document: Document) -> RobotModel:
    """Compose a robot from the document of a ``RobotConfig``. Raises ConfigurationError listing every fault."""
    faults = ProblemCollector()
    config, faults.problems = salvage(document, RobotConfig)
    written = document.data.get("parts")
    if not isinstance(written, dict):  # which is told
        raise ConfigurationError(faults.problems)
    file = _RobotFile(document, config, [part for part in written if isinstance(part, str)], faults)
    whole, placed = file.place_parts(), file.placed
    parts = {part: placed[part].config if part in placed else None for part in file.names}
    connections, problems = read_connections(config, document, parts)
    faults.problems += problems
    with faults.step():
        faults.problems += file.wider_limits()
    postures, base_frame = file.postures(), file.base_frame()
    file.check_default_arm()
    ignored = file.declared_pairs()
    if whole:
        file.check_companions()
    if base_frame is not None and whole:
        model = describe(name, file.joined(name), base_frame, placed, postures, ignored)
        faults.problems += load_problems(model, placed, document)
        if not faults.problems:
            return with_hardware(replace(model, default_arm=config.default_arm), connections, config.safety)
    raise ConfigurationError(dict.fromkeys(faults.problems))


def _seen_from_the_robot(faults: list[Problem], part: str, changes: Document) -> list[Problem]:
    """Rename faults of a part's description; those of fields that the robot has set are named as the robot's."""
    own = {source for source, _ in changes.origins.values()}
    return [
        replace(fault, field=f"parts.{part}.set.{fault.field}") if fault.source in own and fault.field else fault
        for fault in faults
    ]


def _states(placed: Iterable[PlacedPart]) -> Iterator[tuple[str, str, float]]:
    """Yield state, joint and position of each state of a part."""
    for part in placed:
        if isinstance(part.config, JointedPart):
            for state, positions in part.config.states.items():
                for joint, position in zip(part.config.joints, positions, strict=False):
                    yield state, joint, position


def _limit_problems(
    document: Document, field: tuple[str, str, str], config: Any, positions: tuple[float, ...]
) -> list[Problem]:
    if not isinstance(config, JointedPart):
        return []
    rows = zip(config.joints, positions, config.limits.lower, config.limits.upper, strict=True)
    return [
        document.problem((*field, index), f"{joint} should be within [{lower:g}, {upper:g}], got {position:g}")
        for index, (joint, position, lower, upper) in enumerate(rows)
        if not lower <= position <= upper
    ]


def _is_misspelt(name: str, parts: list[str], links: list[str]) -> bool:
    """Return whether a name is certainly wrong although links of some parts are unknown: it nearly equals a known
    one.
    """
    return bool(get_close_matches(name, [*parts, *links], n=1, cutoff=0.7))


def load_problems(model: RobotModel, placed: Mapping[str, PlacedPart], document: Document) -> list[Problem]:
    """Return a problem for each arm or base that carries more than its payload."""
    problems = []
    whole = payload(model, model.base_frame).mass
    for name, part in placed.items():
        limit = part.config.payload if isinstance(part.config, ArmPart | BasePart | LeggedBasePart) else None
        if limit is None:
            continue
        if isinstance(part.config, ArmPart):
            load = payload(model, part.config.tip).mass - part.mass_of([part.config.tip])
        else:
            load = whole - part.mass_of(part.links)
        if load > limit:
            message = f"{load:.3g} kg are mounted on it, more than its payload of {limit:.3g} kg"
            problems.append(document.problem(("parts", name), message))
    return problems


def with_calibration(document: Document, folder: Path, faults: ProblemCollector) -> Document:
    """Return a robot's document with the ``parts`` of its ``calibration`` files applied, in order.

    ``folder``: for relative names. Unreadable files and parts of another robot are skipped, and added to ``faults``.
    """
    names = document.data.get("calibration", [])
    if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
        message = f"should be a list of files that bestman-bt calibrate wrote, got {names!r}"
        faults.problems.append(document.problem(("calibration",), message))
        return replace(document, data={key: value for key, value in document.data.items() if key != "calibration"})
    for index, name in enumerate(names):
        with faults.step():
            path = folder / name
            if not path.is_file():
                message = f"no such calibration file: {path}"
                raise ConfigurationError([document.problem(("calibration", index), message)])
            found = read_document(path, faults.problems)
            parts, known = found.data.get("parts"), document.data.get("parts") or {}
            if not isinstance(parts, dict):
                message = "is missing: this file was not written by bestman-bt calibrate"
                raise ConfigurationError([found.problem(("parts",), message)])
            for part in [part for part in parts if part not in known]:
                message = f"the robot has no such part; {suggestion(str(part), [str(k) for k in known])}"
                faults.problems.append(found.problem(("parts", part), message))
            origins = {path: origin for path, origin in found.origins.items() if path[:1] == ("parts",)}
            own = {part: value for part, value in parts.items() if part in known}
            document = document.merged(Document({"parts": own}, origins))
    return document


def combine(base: str, arm: str, hand: str, column: str = "column") -> RobotModel:
    """Return the robot ``<base>+<arm>+<hand>``, with parts called ``base``, ``column``, ``arm`` and ``gripper``.

    The arguments are names or paths of part descriptions. Raises ConfigurationError if one is unknown or cannot carry
    the next one.
    """
    parts = {
        "base": {"part": base},
        "column": {"part": column, "mount": "base"},
        "arm": {"part": arm, "mount": "column"},
        "gripper": {"part": hand, "mount": "arm"},
    }
    name = "+".join((base, arm, hand))
    return compose_robot(name, Document({"parts": parts}, {(): (name, None)}))
