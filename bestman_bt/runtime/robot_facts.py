"""Summary of a robot: plain values for people and programs."""

from __future__ import annotations

import shutil
import subprocess
import sys
import tempfile
import zipfile
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from behaviours.parts import parts_by_kind
from bestman_bt.configuration.data import data_names, find_data, own_pybullet_data
from bestman_bt.configuration.document import read_document
from bestman_bt.configuration.errors import ConfigurationError, Problem
from bestman_bt.manipulation.kinematics.damped_least_squares import DampedLeastSquares
from bestman_bt.robot_model.compose import combine, load_robot_model
from bestman_bt.robot_model.model import (
    ArmModel,
    BaseModel,
    GripperModel,
    JointGroupModel,
    LeggedBaseModel,
    RobotModel,
    WheeledBaseModel,
)
from bestman_bt.robot_model.payload import payload

REQUIREMENT = "pybullet==3.2.7"
SHA256 = "5d858abf7c12a21ef3ed351cf81dac1b5e486ec25c9ab59bfc84beb89034edff"
"""Hash of the wheel for CPython 3.11 on Linux x86-64; its models work on any machine."""
FOLDER = "pybullet_data"


def bring_pybullet_data(wheel: Path | None = None) -> Path:
    """Unpack the folder pybullet_data into ``own_pybullet_data()`` and return its path.

    ``wheel``: a file; by default ``REQUIREMENT`` is downloaded with the settings of pip or uv, and its hash is checked.
    Raises ConfigurationError if that fails; then nothing is left behind.
    """
    target = own_pybullet_data()
    target.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=target.parent, prefix=".descriptions_") as scratch:
        if wheel is None:
            _download(Path(scratch))
        else:
            _unpack(wheel, Path(scratch))
        (Path(scratch) / FOLDER).rename(target)
    return target


def _unpack(wheel: Path, into: Path) -> None:
    try:
        with zipfile.ZipFile(wheel) as opened:
            members = [name for name in opened.namelist() if name.startswith(f"{FOLDER}/")]
            opened.extractall(into, members)
    except (OSError, zipfile.BadZipFile) as error:
        raise _fault("--wheel", f"{wheel} cannot be read: {error}") from error
    if not members:
        raise _fault("--wheel", f"{wheel} does not contain {FOLDER}: pass a wheel of PyBullet")


def _download(into: Path) -> None:
    """Install the wheel into ``into`` with pip, else uv, which use the user's settings for package indexes."""
    lock = into / "lock.txt"
    lock.write_text(f"{REQUIREMENT} --hash=sha256:{SHA256}\n", encoding="utf-8")
    if find_spec("pip") is not None:
        command = [sys.executable, "-m", "pip", "install", "--platform", "manylinux2014_x86_64"]
    elif (uv := shutil.which("uv") or shutil.which("uv", path=Path(sys.executable).parent)) is not None:
        command = [uv, "pip", "install", "--python-platform", "x86_64-manylinux2014"]
    else:
        raise _fault("descriptions", f"cannot download {REQUIREMENT} without pip or uv; give a file with --wheel")
    command += ["--quiet", "--no-deps", "--only-binary=:all:", "--python-version", "3.11"]
    command += ["--target", str(into), "--require-hashes", "-r", str(lock)]
    done = subprocess.run(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, check=False)
    if done.returncode != 0:
        raise _fault("descriptions", f"{' '.join(command)} failed: {done.stderr.strip()[-500:]}")


def _fault(where: str, message: str) -> ConfigurationError:
    return ConfigurationError([Problem(where, None, "", message)])


MOVING = (BaseModel, ArmModel, GripperModel, JointGroupModel)


def find_robot(name: str) -> RobotModel:
    """Return a robot by its name or file, or ``BASE+ARM+HAND``: three parts combined by rule.

    Raises ConfigurationError.
    """
    parts = name.split("+")
    if len(parts) == 3:
        return combine(*parts)
    if len(parts) > 1 and not Path(name).is_file():
        message = f"a combination should have three parts, BASE+ARM+HAND, got {len(parts)}"
        raise ConfigurationError([Problem(name, None, "", message)])
    return load_robot_model(name)


def describe_robot(model: RobotModel) -> dict[str, Any]:
    """Return mass, footprint, reach, loads, widths, sensors and postures of a robot; SI units."""
    return {
        "name": model.name,
        "mass_kg": round(payload(model, model.base_frame).mass, 3),
        "bases": {
            name: {
                "drive": base.part.drive if isinstance(base, WheeledBaseModel) else "legged",
                "wheels": len(base.part.wheel_joints) if isinstance(base, WheeledBaseModel) else 0,
                "legs": len(base.legs) if isinstance(base, LeggedBaseModel) else 0,
                "max_vx": base.part.max_vx,
                "max_vy": base.part.max_vy,
                "max_wz": base.part.max_wz,
                "footprint_m": np.ptp(np.array(base.footprint), axis=0).round(3).tolist(),
            }
            for name, base in model.of(BaseModel).items()
        },
        "arms": {name: _arm(model, name) for name in model.of(ArmModel)},
        "grippers": {
            name: {
                "kind": gripper.part.kind,
                "on": model.hand_of.get(name),
                "max_width_m": round(gripper.max_width, 4),
                "max_force_n": gripper.part.max_force,
                "joints": len(gripper.part.joints) + len(gripper.followers),
            }
            for name, gripper in model.of(GripperModel).items()
        },
        "joint_groups": {name: len(group.joint_names) for name, group in model.of(JointGroupModel).items()},
        "sensors": [name for name, part in model.parts.items() if not isinstance(part, MOVING)],
        "postures": list(model.postures),
        "for_skills": list(parts_by_kind(model, model.parts)),
    }


def describe_parts() -> list[dict[str, Any]]:
    """Return name, kind and description of every known part, by kind, and whether it is an end effector."""
    parts = []
    for name in data_names("part"):
        data = read_document(find_data("part", name)).data
        facts = {"name": name, "kind": str(data.get("kind")), "description": str(data.get("description", ""))}
        parts.append({**facts, "end_effector": "tool" in data})
    return sorted(parts, key=lambda part: (part["kind"], part["name"]))


def _arm(model: RobotModel, name: str) -> dict[str, Any]:
    arm = model.of(ArmModel)[name]
    _, reach = DampedLeastSquares(model, name).reach
    hands = [hand for hand, of in model.hand_of.items() if of == name]
    load = sum(
        payload(model, model.of(GripperModel)[hand].hand_link).mass for hand in hands if hand in model.of(GripperModel)
    )
    return {
        "joints": len(arm.joint_names),
        "reach_m": round(float(reach), 3),
        "hand_kg": round(load, 3),
        "tool_frame": arm.tool_frame,
    }
