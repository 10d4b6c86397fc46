"""The parts of a robot's YAML that only hardware needs: who speaks to which controller, and what it may do at most."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from bestman_bt.configuration.quantity import (
    AngularSpeedLimitOrNone,
    ForceLimit,
    LengthLimit,
    Share,
    SpeedLimit,
    SpeedLimitOrNone,
    TimeLimit,
    WholeNumber,
)
from bestman_bt.configuration.secret import Secret


@dataclass(frozen=True)
class ConnectionConfig:
    """One controller: ``driver`` names the class that speaks to it, ``parts`` the robot's parts behind it.

    ``address`` and ``token`` never show in a text made of this; ``${NAME}`` is what the environment says of them.
    ``options``: what the driver wants to know besides;
    in a robot model, checked: an instance of the driver's own dataclass.
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
    """Where datagrams (UDP) say ``run`` or ``stop``; ``silence``: seconds without one that stop the robot, too.

    ``address``: ``HOST:PORT`` of this machine to listen at.
    """

    address: str
    silence: TimeLimit = 0.5


def host_and_port(address: str) -> tuple[str, int]:
    """Return the two of ``HOST:PORT``, an IPv6 host in brackets; ValueError."""
    host, _, port = address.rpartition(":")
    host = host.removeprefix("[").removesuffix("]")
    if not host or not port.isascii() or not port.isdigit() or not 0 < int(port) < 65536:
        raise ValueError(f"should be HOST:PORT, as 127.0.0.1:5005, got {address!r}")
    return host, int(port)


@dataclass(frozen=True)
class SafetyConfig:
    """What the robot may do at most, enforced above the vendors' own limits.

    ``joint_speed``: share of the arms' speed limits, 1 if nothing is said; real arms of which neither this nor
    ``tool_speed`` is said begin slowly. ``base_speed``, ``base_turn``, ``gripper_force``: at most, in place of the
    parts' own where those are higher. These are written into the robot model, so planners and the simulation keep them,
    too. ``tool_speed`` bounds the arms' tools, ``workspace`` their elbows, too. ``watchdog``: seconds without a sign of
    life after which a controller counts as lost and everything else is stopped; ``heartbeat``: of the process that
    plans, or of the one that holds the connections, after which the robot brakes. ``stop_input``: what stops it from
    outside.
    """

    joint_speed: Share | None = None
    tool_speed: SpeedLimit | None = None
    gripper_force: ForceLimit | None = None
    base_speed: SpeedLimitOrNone | None = None
    base_turn: AngularSpeedLimitOrNone | None = None
    workspace: WorkspaceConfig | None = None
    watchdog: TimeLimit = 0.25
    heartbeat: TimeLimit = 0.2
    stop_input: StopInputConfig | None = None
