"""The hardware sections of a robot's YAML: connections to controllers, and safety limits."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from bestman_bt.configuration.quantity import (
    AngularSpeedLimit,
    ForceLimit,
    LengthLimit,
    PositiveShare,
    SpeedLimit,
    TimeLimit,
    WholeNumber,
)
from bestman_bt.configuration.secret import Secret


@dataclass(frozen=True)
class ConnectionConfig:
    """One controller: ``driver``: name of the connection class; ``parts``: the robot's parts behind it.

    ``address`` and ``token`` are hidden in all texts; ``${NAME}`` is replaced from the environment. ``options``: of the
    driver; in a robot model an instance of the driver's own dataclass.
    """

    driver: str
    parts: tuple[str, ...]
    address: Secret = field(default="", repr=False)
    port: WholeNumber | None = None
    token: Secret = field(default="", repr=False)
    options: Any = field(default_factory=dict)


@dataclass(frozen=True)
class WorkspaceConfig:
    """A box, metres in the robot's base frame, that the tools and elbows of all arms stay in."""

    lower: tuple[LengthLimit, LengthLimit, LengthLimit]
    upper: tuple[LengthLimit, LengthLimit, LengthLimit]


@dataclass(frozen=True)
class StopInputConfig:
    """A source of datagrams (UDP) with ``run`` or ``stop``; ``silence``: seconds without one that also stop the robot.

    ``address``: ``HOST:PORT`` of this machine to listen on.
    """

    address: str
    silence: TimeLimit = 0.5


def host_and_port(address: str) -> tuple[str, int]:
    """Return host and port of ``HOST:PORT``, an IPv6 host in brackets. Raises ValueError."""
    host, _, port = address.rpartition(":")
    host = host.removeprefix("[").removesuffix("]")
    if not host or not port.isascii() or not port.isdigit() or not 0 < int(port) < 65536:
        raise ValueError(f"should be HOST:PORT, as 127.0.0.1:5005, got {address!r}")
    return host, int(port)


@dataclass(frozen=True)
class SafetyConfig:
    """Limits of the robot, enforced above the vendors' own limits.

    ``joint_speed``: fraction of the arms' speed limits, default 1; real arms without this and ``tool_speed`` start
    slowly. ``base_speed``, ``base_turn``, ``gripper_force``: upper limits, replacing higher ones of the parts. They are
    part of the robot model, so that planners and the simulation respect them. ``tool_speed`` limits the arms' tools,
    ``workspace`` tools and elbows. ``watchdog``: seconds without a heartbeat after which a controller counts as lost
    and everything else is stopped; ``heartbeat``: the same for the planning process, or the one with the connections,
    after which the robot brakes. ``stop_input``: an external stop signal.
    """

    joint_speed: PositiveShare | None = None
    tool_speed: SpeedLimit | None = None
    gripper_force: ForceLimit | None = None
    base_speed: SpeedLimit | None = None
    base_turn: AngularSpeedLimit | None = None
    workspace: WorkspaceConfig | None = None
    watchdog: TimeLimit = 0.25
    heartbeat: TimeLimit = 0.2
    stop_input: StopInputConfig | None = None
