"""The YAML of a robot: its parts, their mounts, its postures."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from bestman_bt.configuration.quantity import Angles3, JointPosition, Lengths3
from bestman_bt.robot_model.connection_config import ConnectionConfig, SafetyConfig

_NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_-]*")


def name_fault(name: str) -> str | None:
    """Return why a part cannot have this name, or None if it can. The name is used in links, files and --set keys."""
    if _NAME.fullmatch(name):
        return None
    return f"{name!r} cannot be a part's name: letters, digits, '_' and '-' can"


@dataclass(frozen=True)
class MountedPart:
    """One part of a robot: ``part``: its description, ``mount``: the link of an earlier part that carries it.

    The name of an earlier part means its carrying link: an arm's tip, a column's top, a base's deck. ``xyz`` (metres)
    and ``rpy`` (radians) place the part's root on that link. ``set`` overrides single fields of the part's description.
    """

    part: str
    mount: str | None = None
    xyz: Lengths3 = (0.0, 0.0, 0.0)
    rpy: Angles3 = (0.0, 0.0, 0.0)
    set: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class RobotConfig:
    """A robot: its parts by name, the first one is the root. ``base_frame``: by default the root of the first part.

    ``default_arm``: the arm of skills that do not name one of several. ``calibration``: calibration files that override
    ``parts``. ``postures``: posture → part → joint positions. ``never_touch``: pairs of parts or links that cannot
    collide, excluded from self-collision checks. ``connections``: the controllers of the real robot, by name;
    ``safety``: its limits; ``bringup``: the file of its bring-up, by default beside this one.
    """

    parts: Mapping[str, MountedPart]
    base_frame: str | None = None
    default_arm: str | None = None
    postures: Mapping[str, Mapping[str, tuple[JointPosition, ...]]] = field(default_factory=dict)
    never_touch: tuple[tuple[str, str], ...] = ()
    calibration: tuple[str, ...] = ()
    connections: Mapping[str, ConnectionConfig] = field(default_factory=dict)
    safety: SafetyConfig = field(default_factory=SafetyConfig)
    bringup: str = ""
    description: str = ""
