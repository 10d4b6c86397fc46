"""Controllers that a person has to release, and the log of releases."""

from __future__ import annotations

import getpass
import json
import os
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path

from bestman_bt.configuration.errors import ConfigurationError, Problem
from bestman_bt.configuration.run import parse_settings
from bestman_bt.robot_model.compose import load_robot_model
from hal.hardware.connection import Connection
from hal.hardware.robot import HardwareRobot


def real_robot(name: str, settings: Sequence[str] = ()) -> HardwareRobot:
    """Return a robot with its controllers, not connected yet. Raises ConfigurationError if an address is missing."""
    values = parse_settings(settings)
    strange = [key for key in values if not key.startswith("robot.")]
    if strange:
        problems = [Problem(f"--set {key}", None, "", "should begin with robot.") for key in strange]
        raise ConfigurationError(problems)
    model = load_robot_model(name, {key.removeprefix("robot."): value for key, value in values.items()})
    if not model.connections:
        problem = Problem(name, None, "connections", "is missing, so there is no controller")
        raise ConfigurationError([problem])
    robot = HardwareRobot(model)
    missing = [
        Problem(name, None, f"connections.{connection.name}.address", "is missing")
        for connection in robot.connections.values()
        if connection.needs_address and not connection.settings.address
    ]
    if missing:
        raise ConfigurationError(missing)
    return robot


def held_controllers(name: str, settings: Sequence[str] = ()) -> list[tuple[Connection, str]]:
    """Return the connections of a robot that people have to release, each with the reason.

    Raises ConnectionFailedError or ConfigurationError.
    """
    causes = [(connection, connection.held()) for connection in real_robot(name, settings).connections.values()]
    return [(connection, cause) for connection, cause in causes if cause is not None]


def log_file() -> Path:
    """Return ``$XDG_STATE_HOME/bestman-bt/releases.jsonl``, a log with a line for each release."""
    return Path(os.environ.get("XDG_STATE_HOME") or Path.home() / ".local/state") / "bestman-bt" / "releases.jsonl"


def log_release(robot: str, controller: str, cause: str) -> dict[str, str]:
    """Append user, controller, cause and time of a release to the log, and return the entry."""
    at = datetime.now(UTC).isoformat(timespec="seconds")
    entry = {"at": at, "by": getpass.getuser(), "robot": robot, "controller": controller, "cause": cause}
    file = log_file()
    file.parent.mkdir(parents=True, exist_ok=True)
    with file.open("a", encoding="utf-8") as lines:
        lines.write(json.dumps(entry) + "\n")
    return entry
