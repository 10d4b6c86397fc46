"""Trying a policy in kinematics alone: of each chunk what is meant to be executed is, exactly; then the next."""

from __future__ import annotations

from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray

from bestman_bt.manipulation.kinematics import InverseKinematics
from bestman_bt.manipulation.policy.base import Observation, Policy
from bestman_bt.manipulation.policy.chunk_stream import chunk_path
from bestman_bt.manipulation.policy.errors import PolicyModelError
from bestman_bt.manipulation.policy.features import pose_error, pose_vector
from bestman_bt.manipulation.policy.onnx_policy import OnnxPolicy
from bestman_bt.manipulation.policy.openpi_client import OpenpiPolicy
from bestman_bt.messages import Pose
from bestman_bt.robot_model import ArmModel

# Policies from files: a network (.onnx with its .json) or the description of a server (.yaml).


def load_policy(path: str | Path) -> Policy:
    """The policy of a file; PolicyModelError if it is none. A .yaml holds the fields of OpenpiPolicy."""
    path = Path(path)
    if path.suffix == ".onnx":
        return OnnxPolicy(str(path))
    if path.suffix != ".yaml":
        raise PolicyModelError(f"a policy is an .onnx or a .yaml file, not {str(path)!r}")
    try:
        values = yaml.safe_load(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
        raise PolicyModelError(f"{path} does not describe a policy server: {error}") from error
    return _server(path, values)


def _server(path: Path, values: Any) -> OpenpiPolicy:
    known = {field.name for field in fields(OpenpiPolicy) if field.init}
    if not isinstance(values, dict) or not values.get("url") or set(values) - known:
        wrong = sorted(set(values) - known) if isinstance(values, dict) else "no fields"
        raise PolicyModelError(f"{path} should have 'url' and other fields of a policy server; it has {wrong}")
    try:
        for name in ("joint_names", "image_size"):
            if name in values:
                if not isinstance(values[name], list):
                    raise TypeError(f"{name} should be a list, got {values[name]!r}")
                values[name] = tuple(values[name])
        return OpenpiPolicy(**values)
    except (TypeError, PolicyModelError) as error:
        raise PolicyModelError(f"{path} does not describe a policy server: {error}") from error


@dataclass(frozen=True, eq=False)
class Rollout:
    """How it went: ``path`` (N, n) radians; ``errors`` (C, 2) metres and radians to the goal after each chunk."""

    path: NDArray[np.float64]
    errors: NDArray[np.float64]

    def reached(self, position_tolerance: float, rotation_tolerance: float) -> bool:
        """Whether the tool was at the goal after some chunk."""
        return bool((self.errors <= (position_tolerance, rotation_tolerance)).all(axis=1).any())


def roll_out(
    policy: Policy,
    kinematics: InverseKinematics,
    arm: ArmModel,
    start: NDArray[np.float64],
    told: Pose,
    judged: Pose | None = None,
    chunks: int = 16,
) -> Rollout:
    """From ``start`` (n,) with the goal ``told``; errors are those to ``judged`` (default: the same)."""
    judged = judged or told
    path, errors = [start], []
    velocities = np.zeros(len(start))
    policy.reset()
    for _ in range(chunks):
        tool = kinematics.tool_pose(path[-1])
        chunk = policy.act(Observation(path[-1], tool, pose_vector(told), joint_velocities=velocities))
        steps = chunk_path(chunk, path[-1], kinematics, arm)
        done = policy.specification.executed or max(1, (len(steps) - 1) // 2)
        path.extend(steps[1 : done + 1])
        velocities = (steps[min(done + 1, len(steps) - 1)] - steps[done - 1]) / (2.0 * chunk.dt)
        error = pose_error(judged, kinematics.tool_pose(path[-1]))
        errors.append((np.linalg.norm(error[:3]), np.linalg.norm(error[3:])))
    return Rollout(np.array(path), np.array(errors))
