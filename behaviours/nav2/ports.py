"""Ports of Nav2's trees: names of algorithms, and what means nothing here but is taken, so that its files load."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

from py_trees.ports import PortInformation

from behaviours.skill import SkillFailure

Algorithm = TypeVar("Algorithm")


def without_meaning(*names: str) -> dict[str, PortInformation]:
    """Input ports that nothing reads: names of ROS servers and frames, their timeouts, plug-ins of theirs."""
    return {
        name: PortInformation(Any, required=False, description="without meaning here; accepted for Nav2's files")
        for name in names
    }


SERVER = without_meaning("server_name", "server_timeout")
SERVICE = without_meaning("service_name", "server_timeout")
FRAMES = without_meaning("global_frame", "robot_base_frame")


def named(by_name: Callable[[str], Algorithm], name: str) -> Algorithm:
    """The algorithm that a port names; SkillFailure (``bad_input``) where there is none of that name."""
    try:
        return by_name(name)
    except LookupError as error:
        raise SkillFailure("bad_input", str(error)) from error
