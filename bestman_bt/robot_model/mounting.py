"""The mounts of parts: on a link of an earlier part, or on the part itself."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Mapping
from difflib import get_close_matches

from bestman_bt.configuration.document import Document
from bestman_bt.configuration.errors import Problem
from bestman_bt.messages import Pose
from bestman_bt.registry import suggestion
from bestman_bt.robot_model.footprint import origin_pose
from bestman_bt.robot_model.part_config import ArmPart, BasePart, LeggedBasePart, StructurePart
from bestman_bt.robot_model.placed_part import PlacedPart
from bestman_bt.robot_model.robot_config import MountedPart
from bestman_bt.robot_model.urdf_elements import child_of, joints_to, parent_of

Places = dict[str, tuple[str, Pose]]
"""Frame → (link that it is fixed to, link_from_frame)."""


def without_frame_links(urdf: str) -> tuple[str, Places]:
    """Return ``urdf`` without the links that have no shape and a fixed joint, and the poses of these frames.

    Their children are attached to the previous link. Their masses are dropped: RobotModel gives frames tiny ones.
    """
    robot = ET.fromstring(urdf)
    joint_above = joints_to(robot)
    above: Places = {}
    for link in robot.findall("link"):
        name = link.get("name", "")
        joint = joint_above.get(name)
        has_shape = link.find("collision") is not None or link.find("visual") is not None
        if joint is not None and joint.get("type") == "fixed" and not has_shape:
            above[name] = (parent_of(joint), origin_pose(joint))
            robot.remove(link)
            robot.remove(joint)
    places = {name: _place(name, above) for name in above}
    for joint in robot.findall("joint"):
        parent = joint.find("parent")
        if parent is not None and parent.get("link", "") in places:
            link_name, link_from_frame = places[parent.get("link", "")]
            parent.set("link", link_name)
            _move(joint, link_from_frame @ origin_pose(joint))
    return ET.tostring(robot, encoding="unicode"), places


def _place(name: str, above: Places) -> tuple[str, Pose]:
    link, pose = above[name]
    while link in above:
        link, link_from_previous = above[link]
        pose = link_from_previous @ pose
    return link, pose


def _move(joint: ET.Element, pose: Pose) -> None:
    origin = joint.find("origin")
    if origin is None:
        origin = ET.SubElement(joint, "origin")
    origin.set("xyz", " ".join(repr(float(value)) for value in pose.position))
    origin.set("rpy", " ".join(map(repr, pose.roll_pitch_yaw)))


Vector = tuple[float, float, float]
Place = tuple[str, Vector, Vector]
"""A link, and the pose of the part's root on it: xyz in metres, roll, pitch and yaw in radians."""


def mount_place(mounted: MountedPart, part: PlacedPart | None, placed: Mapping[str, PlacedPart]) -> Place | None:
    """Return the mount of ``part``, or None if ``mount`` is neither a link nor a part that can carry others.

    The name of a part means its ``tip`` (of an arm), ``top`` (of a structure) or ``deck`` (of a base).
    """
    own, name = _seated(mounted, part), mounted.mount or ""
    if any(name in part.links for part in placed.values()):
        return name, *own
    carrier = placed[name].config if name in placed else None
    if isinstance(carrier, ArmPart):
        return carrier.tip, *own
    if isinstance(carrier, StructurePart) and carrier.top is not None:
        return carrier.top, *own
    if isinstance(carrier, BasePart) and carrier.deck is not None:
        pose = Pose.from_xyz_rpy(carrier.deck.xyz, carrier.deck.rpy) @ Pose.from_xyz_rpy(*own)
        return carrier.deck.link, *_numbers(pose)
    return None


def mount_problems(
    document: Document,
    name: str,
    mounted: MountedPart,
    part: PlacedPart | None,
    placed: Mapping[str, PlacedPart],
    unread: Mapping[str, list[str] | None] = {},
) -> list[Problem]:
    """Return the faults of the mount of ``part`` (None: it could not be read); ``placed``: the parts before it.

    ``unread``: earlier parts with faults, on which it may be mounted, and the names of their links (None: unknown).
    """
    field = ("parts", name, "mount")
    links = [link for earlier in placed.values() for link in earlier.links]
    first = next(iter(document.data["parts"]), None)
    if part is not None and isinstance(part.config, BasePart | LeggedBasePart) and name != first:
        return [document.problem(("parts", name), "a base stands on the floor: it has to be the first part")]
    if not links and None in unread.values():
        return _misspelt_part(document, field, mounted.mount or "")
    links += [link for known in unread.values() for link in known or ()]
    if not links:
        if mounted.mount is None:
            return []
        return [document.problem(field, "the first part is the root and is mounted on nothing")]
    if mounted.mount is None:
        message = f"'mount' is missing: the link that carries the part; there are {', '.join(links)}"
        return [document.problem(("parts", name), message)]
    if mounted.mount == name:
        return [document.problem(field, f"{name!r} cannot be mounted on itself: name a part above it")]
    place = mount_place(mounted, part, placed)
    if place is None:
        return _mount_faults(document, field, mounted.mount, placed, unread, links)
    wheel = _wheel_that_turns(place[0], placed)
    if wheel is not None:
        message = f"{place[0]!r} turns with the joint {wheel!r} of a wheel: nothing can be mounted there"
        return [document.problem(field, message)]
    return []


def _mount_faults(
    document: Document,
    field: tuple[str, str, str],
    mount: str,
    placed: Mapping[str, PlacedPart],
    unread: Mapping[str, list[str] | None],
    links: list[str],
) -> list[Problem]:
    """Return the fault of a mount that is on no placed part, and cannot be on an unread part either."""
    if mount in unread or any(mount in known for known in unread.values() if known is not None):
        return []
    misspelt = _misspelt_part(document, field, mount) if unread else []
    if misspelt or None in unread.values():
        return misspelt
    return [document.problem(field, _no_frame(mount, placed, links))]


def _misspelt_part(document: Document, field: tuple[str, str, str], mount: str) -> list[Problem]:
    """Return a problem if the mount is probably the misspelt name of a part; otherwise it may be a frame of an unread
    part.
    """
    parts = [name for name in document.data["parts"] if isinstance(name, str) and field[1] != name]
    names = [name for name in parts if name.count("_") == mount.count("_")]  # column_top is no misspelt column
    close = get_close_matches(mount, names, n=1, cutoff=0.7)
    if not close or mount in names:
        return []
    return [document.problem(field, f"no part {mount!r} to mount on; did you mean {close[0]!r}?")]


def _seated(mounted: MountedPart, part: PlacedPart | None) -> tuple[Vector, Vector]:
    seat = None if part is None else part.config.seat
    if seat is None:
        return mounted.xyz, mounted.rpy
    return _numbers(Pose.from_xyz_rpy(mounted.xyz, mounted.rpy) @ Pose.from_xyz_rpy(seat.xyz, seat.rpy))


def _numbers(pose: Pose) -> tuple[Vector, Vector]:
    x, y, z = pose.position.tolist()
    roll, pitch, yaw = (angle + 0.0 for angle in pose.roll_pitch_yaw)  # no minus zero
    return (x, y, z), (roll, pitch, yaw)


def _no_frame(mount: str, placed: Mapping[str, PlacedPart], links: list[str]) -> str:
    if mount in placed:
        return (
            f"the {placed[mount].config.kind} {mount!r} does not say where it carries something: name a link of it "
            f"({', '.join(placed[mount].links)})"
        )
    hint = suggestion(mount, [*placed, *links])
    frames = "" if hint.startswith("known: ") else f" (frames: {', '.join(links)})"
    return f"no frame {mount!r} to mount on; {hint}{frames}"


def _wheel_that_turns(link: str, placed: Mapping[str, PlacedPart]) -> str | None:
    for part in placed.values():
        if isinstance(part.config, BasePart):
            turned = {*part.config.wheel_joints, *part.config.steering_joints}
            for element in part.elements:
                if element.get("name", "") in turned and child_of(element) == link:
                    return element.get("name", "")
    return None
