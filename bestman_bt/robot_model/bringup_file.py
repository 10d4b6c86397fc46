"""The bring-up file, with the signed commissioning of a real robot: beside the robot's file, under its name."""

from __future__ import annotations

import hashlib
import ipaddress
import json
import os
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

import yaml

from bestman_bt.configuration.checked import check
from bestman_bt.configuration.data import data_root, find_data, user_folders
from bestman_bt.configuration.document import Document, read_document
from bestman_bt.configuration.errors import ConfigurationError, Problem
from bestman_bt.robot_model.hardware_config import with_first_limits
from bestman_bt.robot_model.model import ArmModel, RobotModel

SUFFIX, TWIN_SUFFIX = ".bringup", ".twin-bringup"
_ADDRESSED = ("address", "port", "token", "driver")
"""Fields of a connection that give the location of its controller and are not properties of the robot."""


@dataclass(frozen=True)
class SignedStep:
    """The result of a bring-up step, ``when`` (UTC) and by ``who``; ``measured``: values by name, in SI units."""

    outcome: Literal["passed", "failed", "does not apply"]
    when: str
    who: str
    text: str
    measured: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Signature:
    """All steps have passed or do not apply; the person who signed that, and when (UTC)."""

    who: str
    when: str


@dataclass(frozen=True)
class BringUpFile:
    """The bring-up results of one robot, valid for these controllers and this content of its file.

    ``content``: as ``RobotModel.content``. ``serial_numbers``, ``firmware``: of the controllers that report them, by
    connection. ``twin``: the controllers were twins. ``signed``: None while steps are missing.
    """

    robot: str
    content: str
    serial_numbers: Mapping[str, str] = field(default_factory=dict)
    firmware: Mapping[str, str] = field(default_factory=dict)
    twin: bool = False
    steps: Mapping[str, SignedStep] = field(default_factory=dict)
    signed: Signature | None = None

    @classmethod
    def read(cls, path: Path) -> BringUpFile:
        """Read a bring-up file. Raises ConfigurationError with file, line and field if it is invalid."""
        return check(read_document(path), cls)

    def write(self, path: Path) -> None:
        """Write the file atomically."""
        path.parent.mkdir(parents=True, exist_ok=True)
        draft = path.with_name(f".{path.name}.{os.getpid()}")
        draft.write_text(yaml.safe_dump(asdict(self), sort_keys=False, allow_unicode=True), encoding="utf-8")
        draft.replace(path)


def bringup_path(robot_file: Path, twin: bool = False) -> Path:
    """Return the path of a robot's bring-up file: beside its file; for a shipped robot in the user's folder."""
    shipped = data_root() in robot_file.resolve().parents
    folder = user_folders()["robot"] if shipped else robot_file.parent
    return folder / f"{robot_file.stem}{TWIN_SUFFIX if twin else SUFFIX}"


def content_digest(document: Document) -> str:
    """Return a digest of the content of a robot's file and its parts' files, without the addresses of controllers."""
    data = {key: value for key, value in document.data.items() if key != "bringup"}
    data["connections"] = {
        name: {key: value for key, value in connection.items() if key not in _ADDRESSED}
        for name, connection in (data.get("connections") or {}).items()
    }
    digest = hashlib.sha256(json.dumps(data, sort_keys=True, default=str).encode())
    for part in sorted({str(mounted["part"]) for mounted in data["parts"].values()}):
        digest.update(find_data("part", part).read_bytes())
    return digest.hexdigest()[:32]


def with_bringup_limits(model: RobotModel) -> tuple[RobotModel, str]:
    """Return ``model`` with the current limits of the real robot, and the reason if its arms are slowed down.

    Arms are slowed down until the bring-up is signed; then the controllers must have the signed serial numbers. Raises
    ConfigurationError if the robot's file has changed since, or if the file was signed for a twin.
    """
    path = model.bringup
    if path is None or not path.is_file():
        return _slow(model, f"no bring-up was signed for this robot (bestman-bt robot bringup {model.name})")
    file = BringUpFile.read(path)
    problems = [Problem(str(path), None, "content", words) for words in _faults(file, model)]
    if problems:
        raise ConfigurationError(problems)
    model = replace(model, serial_numbers=file.serial_numbers)
    if file.signed is None:
        return _slow(model, f"its bring-up is not signed yet, {len(file.steps)} steps are done ({path})")
    measured = {name: frozenset(step.measured) for name, step in file.steps.items()}
    return replace(model, measured=measured), ""


def _faults(file: BringUpFile, model: RobotModel) -> list[str]:
    faults = []
    if file.content != model.content:
        faults.append(
            f"was signed for another version of {model.name}'s file or its parts: bring the robot up again "
            f"(bestman-bt robot bringup {model.name}), or delete the file to run slowly"
        )
    elsewhere = [name for name, connection in model.connections.items() if not _is_loopback(connection.address)]
    if file.twin and elsewhere:
        faults.append(f"was signed for a twin, and {elsewhere[0]} is at an address that is not a twin's")
    return faults


def _is_loopback(address: str) -> bool:
    try:
        return not address or ipaddress.ip_address(address).is_loopback
    except ValueError:
        return address == "localhost"


def _slow(model: RobotModel, why: str) -> tuple[RobotModel, str]:
    return with_first_limits(model), why if model.of(ArmModel) else ""
