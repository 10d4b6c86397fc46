"""Ports of Nav2's trees: names of algorithms, and what means nothing here but is taken, so that its files load."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, Final

from py_trees.ports import PortInformation

from behaviours.skill import Explained
from bestman_bt.engine import Node, OneOf, Out
from bestman_bt.engine.core.ports import key_of
from bestman_bt.messages import Failure
from bestman_bt.registry import ALGORITHMS


def _planners() -> list[str]:
    from bestman_bt.navigation.global_planning.base import GlobalPlanner

    return ["", *ALGORITHMS.of_kind("global_planning", GlobalPlanner)]


def _followers() -> list[str]:
    from bestman_bt.navigation.local_planning.base import PathFollower

    return ["", *ALGORITHMS.of_kind("local_planning", PathFollower)]


NAV2_NAMES: Final = ("GridBased", "FollowPath", "route_smoother", "SmoothPath")
"""What Nav2's configuration calls its planner, controller and smoothers; a task may say what they and others mean."""


@dataclass(frozen=True)
class OursOrNav2s(OneOf):
    """One of our names, or of Nav2's for what is configured."""

    def refusal(self, value: Any) -> str:
        """Return why ``value`` is not accepted, in words, or an empty text."""
        return "" if value in NAV2_NAMES else super().refusal(value)


@dataclass(frozen=True)
class AlgorithmName(OursOrNav2s):
    """A registered algorithm, or one's own as ``file.py:Class`` or ``module:Class``: whoever runs the tree finds it.

    ``slot``: the slot of the configuration whose algorithms these are.
    """

    slot: str

    def refusal(self, value: Any) -> str:
        """Return why ``value`` is not accepted, in words, or an empty text."""
        return "" if ":" in value else super().refusal(value)


class Nav2Errors(Explained):
    """Tells why a leaf has failed by Nav2's names of the outputs, too; the code is ours, a word."""

    error_code_id = Out(str, "error_code by Nav2's name")
    error_msg = Out(str, "error_message by Nav2's name")

    def explain(self, code: str, why: str, failure: Failure | None = None) -> int:
        """Record why the leaf fails; returns FAILURE."""
        self.error_code_id = code
        self.error_msg = why
        return super().explain(code, why, failure)

    def succeed(self, why: str = "") -> int:
        """Clear the error outputs; returns SUCCESS."""
        self.error_code_id = ""
        self.error_msg = ""
        return super().succeed(why)


PlannerName = Annotated[str, AlgorithmName(_planners, "global_planning")]
FollowerName = Annotated[str, AlgorithmName(_followers, "local_planning")]
SmootherName = Annotated[str, OursOrNav2s(lambda: ("", "simple_smoother"))]
"""Names of algorithms; an empty one is what is configured, or the only one that there is."""


def without_meaning(*names: str) -> dict[str, PortInformation]:
    """Input ports that nothing reads: names of ROS servers and frames, their timeouts, plug-ins of theirs."""
    return {
        name: PortInformation(Any, required=False, description="without meaning here; accepted for Nav2's files")
        for name in names
    }


def nothing_written(*names: str) -> dict[str, PortInformation]:
    """Output ports to which nothing is written."""
    return {
        name: PortInformation(Any, required=False, description="nothing is written; accepted for Nav2's files")
        for name in names
    }


SERVER = without_meaning("server_name", "server_timeout")
SERVICE = without_meaning("service_name", "server_timeout")
FRAMES = without_meaning("global_frame", "robot_base_frame")


def are_literals(node: Node, *ports: str) -> bool:
    """Whether none of the ports is mapped to an entry: what they say together can be judged when the tree is loaded."""
    return all(key_of(node.attributes.get(port, ""), port) is None for port in ports)
