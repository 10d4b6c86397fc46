"""Calibration without hardware: views are recorded by a simulated robot that differs from its file by known errors."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from bestman_bt.configuration.errors import ConfigurationError, Problem
from bestman_bt.messages import Pose
from bestman_bt.perception.calibration.boards import CharucoBoard, project
from bestman_bt.robot_model.compose import load_robot_model
from bestman_bt.robot_model.model import ArmModel, JointGroupModel, RobotModel
from bestman_bt.robot_model.sensor_parts import CameraPart
from bestman_bt.runtime.calibration.dataset import Progress
from bestman_bt.runtime.calibration.robot_chain import RobotChain
from bestman_bt.runtime.calibration.simulated_recording import Span, Views, in_hand, on_base, record

Kind = Literal["intrinsics", "hand-eye", "head"]
SMALL_BOARD = CharucoBoard(7, 5, 0.04, 0.03)
LARGE_BOARD = CharucoBoard(7, 5, 0.05, 0.0375)
POSITION_ERROR, ROTATION_ERROR = 0.006, math.radians(1.5)
"""Standard deviations, per axis, of how parts are mounted: metres, radians."""


@dataclass(frozen=True)
class Simulated:
    """``robot``: its name; ``camera``: the calibrated one; ``built``: the robot as simulated."""

    robot: str
    settings: Mapping[str, Any]
    camera: str
    built: RobotModel


def simulate(
    kind: Kind,
    robot: str,
    settings: Mapping[str, Any],
    camera: str | None,
    views: int,
    seed: int,
    folder: Path,
    progress: Progress,
) -> Simulated:
    """Record a dataset into ``folder``. Raises ConfigurationError or CalibrationError."""
    model = load_robot_model(robot, settings)
    chain = RobotChain(model, camera or _first_camera(kind, model))
    if not model.of(ArmModel):
        raise ConfigurationError([Problem("--simulate", None, "", f"robot {model.name!r} has no arm to record with")])
    if chain.head is None and (kind == "head" or chain.arm is None):
        message = f"no joint of robot {model.name!r} moves camera {chain.camera!r}"
        raise ConfigurationError([Problem("--simulate", None, "", message)])
    built = load_robot_model(robot, {**settings, **_as_built(kind, chain, np.random.default_rng([seed, 3]))})
    carried = chain.arm is not None
    placement = on_base(SMALL_BOARD, model) if carried else in_hand(LARGE_BOARD, model)
    asked = Views(placement, _span(kind, carried), views, seed)
    record(model, robot, built, chain.camera, asked, folder, progress)
    return Simulated(robot, settings, chain.camera, built)


def compare(kind: Kind, simulated: Simulated, calibration: Path) -> dict[str, float]:
    """Return the errors of this calibration, and of the robot's own file, with respect to the simulated robot."""
    settings = simulated.settings
    found = load_robot_model(simulated.robot, {**settings, "calibration": [str(calibration)]})
    before = load_robot_model(simulated.robot, settings)
    built = simulated.built
    if kind == "intrinsics":
        return {
            **{f"{key}_before": value for key, value in _lens_error(before, built, simulated.camera).items()},
            **_lens_error(found, built, simulated.camera),
        }
    return {
        **{f"{key}_before": value for key, value in _pose_error(before, built, simulated.camera).items()},
        **_pose_error(found, built, simulated.camera),
        **_depth_error(found, built, simulated.camera),
    }


def _first_camera(kind: Kind, model: RobotModel) -> str:
    chains = {name: RobotChain(model, name) for name in model.of(CameraPart)}
    if kind != "head":
        on_arm = next((name for name, chain in chains.items() if chain.arm is not None), None)
        if on_arm is not None or kind == "hand-eye":
            return _there(on_arm, kind, model)
    return _there(next((name for name, chain in chains.items() if chain.head is not None), None), kind, model)


def _there(camera: str | None, kind: Kind, model: RobotModel) -> str:
    if camera is not None:
        return camera
    what = {"intrinsics": " that moves", "head": " on a pan-tilt", "hand-eye": " on an arm"}[kind]
    raise ConfigurationError([Problem("--simulate", None, "", f"robot {model.name!r} has no camera{what}")])


def _span(kind: Kind, carried: bool) -> Span:
    if carried and kind == "intrinsics":
        return Span(0.25, 0.6, math.radians(50.0), math.radians(90.0), 0.85)
    if carried:
        return Span(0.28, 0.62, math.radians(40.0), math.radians(70.0), 0.35)
    if kind == "intrinsics":
        return Span(0.55, 0.9, math.radians(45.0), math.radians(60.0), 0.8)
    return Span(0.55, 0.9, math.radians(35.0), math.radians(40.0), 0.5)


def _as_built(kind: Kind, chain: RobotChain, rng: np.random.Generator) -> dict[str, Any]:
    """Return settings with random errors of mounts, lens and depth: the robot as built."""
    camera = f"parts.{chain.camera}"
    settings: dict[str, Any] = {
        f"{camera}.set.depth_scale": float(1.0 + 0.01 * rng.uniform(-1, 1)),
        f"{camera}.set.depth_offset": float(0.004 * rng.uniform(-1, 1)),
    }
    if kind == "intrinsics":
        k = chain.intrinsics
        settings[f"{camera}.set.focal_length"] = (np.array([k.fx, k.fy]) + rng.uniform(-8, 8, 2)).tolist()
        settings[f"{camera}.set.principal_point"] = (np.array([k.cx, k.cy]) + rng.uniform(-6, 6, 2)).tolist()
        lens = rng.uniform([-0.2, 0.02, -0.001, -0.001], [-0.1, 0.05, 0.001, 0.001])
        settings[f"{camera}.set.distortion"] = [*lens.tolist(), 0.0]
        return settings
    mounts = {chain.camera: chain.camera_mount(_shaken(chain.carrier_from_camera(), rng))}
    if chain.head is not None:
        base_from_head = chain.kinematics.pose(chain.head_root(chain.head), {})
        mounts[chain.head] = chain.head_mount(chain.head, _shaken(base_from_head, rng))
    for part, mount in mounts.items():
        settings |= {f"parts.{part}.{field}": value for field, value in mount.items()}
    return settings


def _shaken(pose: Pose, rng: np.random.Generator) -> Pose:
    turn = Pose.from_xyz_rpy((0.0, 0.0, 0.0), rng.normal(0.0, ROTATION_ERROR, 3))
    return Pose(pose.position + rng.normal(0.0, POSITION_ERROR, 3), (pose @ turn).quaternion)


def _pose_error(found: RobotModel, built: RobotModel, camera: str) -> dict[str, float]:
    """Return the pose error of the camera in the base, over nine postures of its head; for an arm, of the camera on its
    carrier.
    """
    chains = RobotChain(found, camera), RobotChain(built, camera)
    head = chains[0].head
    if head is None:
        pairs = [(chains[0].carrier_from_camera(), chains[1].carrier_from_camera())]
    else:
        joints = found.of(JointGroupModel)[head].joint_names
        postures = [dict(zip(joints, (pan, tilt), strict=True)) for pan in (-0.4, 0, 0.4) for tilt in (0.4, 0.7, 1)]
        pairs = [
            (
                chains[0].kinematics.pose(chains[0].optical_frame, p),
                chains[1].kinematics.pose(chains[1].optical_frame, p),
            )
            for p in postures
        ]
    return {
        "position_mm": max(1e3 * float(np.linalg.norm(a.position - b.position)) for a, b in pairs),
        "rotation_deg": max(
            math.degrees(2 * math.asin(min(1.0, float(np.linalg.norm((a.inverse() @ b).quaternion[:3])))))
            for a, b in pairs
        ),
    }


def _lens_error(found: RobotModel, built: RobotModel, camera: str) -> dict[str, float]:
    """Return the root mean square and largest pixel error over the image of the built camera, up to a camera
    rotation.
    """
    true, k = built.of(CameraPart)[camera].intrinsics, found.of(CameraPart)[camera].intrinsics
    x, y = np.meshgrid(np.linspace(-0.62, 0.62, 15), np.linspace(-0.46, 0.46, 11))
    wall = np.stack([x.ravel(), y.ravel(), np.ones(x.size)], axis=1)
    seen = project(wall, Pose(), true)
    inside = ((seen >= 0) & (seen <= (true.width - 1, true.height - 1))).all(axis=1)
    difference = (project(wall, Pose(), k) - seen)[inside]
    lengths = np.linalg.norm(difference - difference.mean(axis=0), axis=1)
    return {
        "pixels_rms": float(np.sqrt(np.mean(lengths**2))),
        "pixels_max": float(lengths.max()),
        "focal_length_px": max(abs(k.fx - true.fx), abs(k.fy - true.fy)),
        "principal_point_px": max(abs(k.cx - true.cx), abs(k.cy - true.cy)),
    }


def _depth_error(found: RobotModel, built: RobotModel, camera: str) -> dict[str, float]:
    """Return the error of the corrected depth between 0.3 and 1 m, millimetres."""
    z = np.linspace(0.3, 1.0, 8)
    a, b = found.of(CameraPart)[camera], built.of(CameraPart)[camera]
    corrected = (b.depth_scale * z + b.depth_offset - a.depth_offset) / a.depth_scale
    return {"depth_mm": 1e3 * float(np.abs(corrected - z).max())}
