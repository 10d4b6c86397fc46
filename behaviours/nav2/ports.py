"""Ports of Nav2's trees: names of algorithms, and what means nothing here but is taken, so that its files load."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

from py_trees.ports import PortInformation

from bestman_bt.engine import Node, OneOf
from bestman_bt.engine.core.ports import key_of
from bestman_bt.registry import ALGORITHMS


def _planners() -> list[str]:
    from bestman_bt.navigation.global_planning import GlobalPlanner

    return ["", *ALGORITHMS.of_kind("global_planning", GlobalPlanner)]


def _followers() -> list[str]:
    from bestman_bt.navigation.local_planning import PathFollower

    return ["", *ALGORITHMS.of_kind("local_planning", PathFollower)]


@dataclass(frozen=True)
class AlgorithmName(OneOf):
    """A registered algorithm, or one's own as ``file.py:Class`` or ``module:Class``: whoever runs the tree finds it.

    ``slot``: the slot of the configuration whose algorithms these are.
    """

    slot: str

    def refusal(self, value: Any) -> str:
        """Return why ``value`` is not accepted, in words, or an empty text."""
        return "" if ":" in value else super().refusal(value)


PlannerName = Annotated[str, AlgorithmName(_planners, "global_planning")]
FollowerName = Annotated[str, AlgorithmName(_followers, "local_planning")]
SmootherName = Annotated[str, OneOf(lambda: ("", "simple_smoother"))]
"""Names of algorithms; an empty one is what is configured, or the only one that there is."""


def without_meaning(*names: str) -> dict[str, PortInformation]:
    """Input ports that nothing reads: names of ROS servers and frames, their timeouts, plug-ins of theirs."""
    return {
        name: PortInformation(Any, required=False, description="without meaning here; accepted for Nav2's files")
        for name in names
    }


SERVER = without_meaning("server_name", "server_timeout")
SERVICE = without_meaning("service_name", "server_timeout")
FRAMES = without_meaning("global_frame", "robot_base_frame")


def are_literals(node: Node, *ports: str) -> bool:
    """Whether none of the ports is mapped to an entry: what they say together can be judged when the tree is loaded."""
    return all(key_of(node.attributes.get(port, ""), port) is None for port in ports)
