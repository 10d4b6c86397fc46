"""Ports of Nav2's trees: names of algorithms, and ports that are accepted without effect so that its files load."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, Final

from py_trees.ports import PortInformation
from typing_extensions import override

from behaviours.skill import ErrorReporting
from bestman_bt.engine import Node, OneOf, Out
from bestman_bt.engine.core.ports import key_of
from bestman_bt.messages import Failure
from bestman_bt.registry import ALGORITHMS


def _planners() -> list[str]:
    from bestman_bt.navigation.global_planning.base import GlobalPlanner

    return _names("global_planning", GlobalPlanner)


def _followers() -> list[str]:
    from bestman_bt.navigation.local_planning.base import PathFollower

    return _names("local_planning", PathFollower)


def _names(kind: str, base: type) -> list[str]:
    """Return the registered algorithms of a class, and no name for the configured one."""
    return ["", *(name for name, (algorithm, _) in ALGORITHMS.of_kind(kind).items() if issubclass(algorithm, base))]


NAV2_NAMES: Final = ("GridBased", "FollowPath", "route_smoother", "SmoothPath")
"""Names of planner, controller and smoothers in Nav2's configuration; a task may map these and others."""


@dataclass(frozen=True)
class OursOrNav2s(OneOf):
    """A name from this library, or a Nav2 name that a task maps to a configured algorithm."""

    @override
    def refusal(self, value: Any) -> str:
        return "" if value in NAV2_NAMES else super().refusal(value)


@dataclass(frozen=True)
class AlgorithmName(OursOrNav2s):
    """A registered algorithm, or a user's own as ``file.py:Class`` or ``module:Class``, resolved when the tree is
    loaded for a robot.

    ``slot``: the slot of the configuration for these algorithms.
    """

    slot: str

    @override
    def refusal(self, value: Any) -> str:
        return "" if ":" in value else super().refusal(value)


class Nav2Errors(ErrorReporting):
    """Also writes the failure to Nav2's output ports; the code is a word, not Nav2's number."""

    error_code_id = Out(str, "error_code by Nav2's name")
    error_msg = Out(str, "error_message by Nav2's name")

    def explain(self, code: str, why: str, failure: Failure | None = None) -> int:
        """Record why the leaf fails; returns FAILURE."""
        self.error_code_id = code
        self.error_msg = why
        return super().explain(code, why, failure)

    @override
    def succeed(self, why: str = "") -> int:
        self.error_code_id = ""
        self.error_msg = ""
        return super().succeed(why)


PlannerName = Annotated[str, AlgorithmName(_planners, "global_planning")]
FollowerName = Annotated[str, AlgorithmName(_followers, "local_planning")]
SmootherName = Annotated[str, OursOrNav2s(lambda: ("", "simple_smoother"))]
"""Names of algorithms; empty: the configured one, or the only one."""


def without_meaning(*names: str) -> dict[str, PortInformation]:
    """Return input ports that are not read: names of ROS servers and frames, their timeouts and plug-ins."""
    return {
        name: PortInformation(Any, required=False, description="no effect; accepted for Nav2's files") for name in names
    }


def nothing_written(*names: str) -> dict[str, PortInformation]:
    """Return output ports that are never written."""
    return {
        name: PortInformation(Any, required=False, description="never written; accepted for Nav2's files")
        for name in names
    }


SERVER = without_meaning("server_name", "server_timeout")
SERVICE = without_meaning("service_name", "server_timeout")
FRAMES = without_meaning("global_frame", "robot_base_frame")


def are_literals(node: Node, *ports: str) -> bool:
    """Return whether no port is mapped to an entry, so that their values can be checked when the tree is loaded."""
    return all(key_of(node.attributes.get(port, ""), port) is None for port in ports)
