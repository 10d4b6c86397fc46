"""Data that controllers report about themselves and their arms, for comparison with the robot's file."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import Pose
from bestman_bt.robot_model.finger_linkage import link_poses
from bestman_bt.robot_model.model import ArmModel, RobotModel
from bestman_bt.robot_model.payload import flange_of, payload


@dataclass(frozen=True)
class Identity:
    """The identity of a controller; fields that it does not report are empty."""

    model: str = ""
    serial_number: str = ""
    firmware: str = ""


@dataclass(frozen=True, eq=False)
class ArmFacts:
    """The state of an arm in its controller; values that it does not report are None. SI units.

    ``positions``: (n,) of the joints. ``tool_pose``: of the controller's tool at these positions, in the ``base_frame``
    of the robot's arm. ``tool_offset``: of that tool from the flange, the tip of the arm's part. ``joint_limits``: (n,
    2). ``payload``: kg at the flange. ``gravity``: (3,), its direction in the ``base_frame``. ``holding_torques``:
    (n,), N m, with which the controller's model, by its mounting and payload, holds the arm at rest at ``positions``.
    """

    positions: NDArray[np.float64]
    tool_pose: Pose
    tool_offset: Pose | None = None
    joint_limits: NDArray[np.float64] | None = None
    payload: float | None = None
    gravity: NDArray[np.float64] | None = None
    holding_torques: NDArray[np.float64] | None = None


GRAVITY = 9.81
"""m/s²."""
TOOL_TOLERANCE = 0.002
"""Metres."""
PAYLOAD_TOLERANCE = 0.5
"""Kilograms of cables and other parts that the URDF lacks."""
MOUNTING_TOLERANCE = math.radians(5.0)
HOLDING_TOLERANCE = 0.15
"""Of the largest joint torque that any mounting causes in a posture: masses of links differ by a few percent."""


@dataclass(frozen=True)
class ModelComparison:
    """A comparison of controller and robot file. ``text``: both values; ``measured``: the figures."""

    agrees: bool
    text: str
    measured: Mapping[str, float]


def compare_tool(model: RobotModel, arm: str, facts: ArmFacts) -> ModelComparison | None:
    """Compare the controller's tool with flange and tool of the file; None if it is not reported."""
    if facts.tool_offset is None:
        return None
    ours = _placed(model, model.of(ArmModel)[arm].tool_frame, flange_of(model, arm)).position
    theirs = facts.tool_offset.position
    apart, out = float(np.linalg.norm(theirs - ours)), float(np.linalg.norm(theirs))
    if out <= TOOL_TOLERANCE:
        return ModelComparison(True, "the controller's tool is the flange", {"from_flange": out})
    text = (
        f"the controller's tool is {np.round(1e3 * theirs, 1).tolist()} mm from the flange; "
        f"the file's is {np.round(1e3 * ours, 1).tolist()} mm: set that, or no offset"
    )
    return ModelComparison(apart <= TOOL_TOLERANCE, text, {"from_flange": out, "apart": apart})


def compare_payload(model: RobotModel, arm: str, facts: ArmFacts) -> ModelComparison | None:
    """Compare the controller's payload with the mass of the file's hand; None if it is not reported."""
    if facts.payload is None:
        return None
    ours = payload(model, flange_of(model, arm)).mass
    text = f"the controller counts on {facts.payload:.2f} kg at the flange, the file's hand has {ours:.2f} kg"
    agrees = abs(facts.payload - ours) <= PAYLOAD_TOLERANCE
    if not agrees:
        text += ": set it at the controller, or by the option 'payload'"
    return ModelComparison(agrees, text, {"controller_kg": facts.payload, "model_kg": ours})


def compare_mounting(model: RobotModel, arm: str, facts: ArmFacts) -> ModelComparison | None:
    """Compare the controller's direction of gravity, or else its effect on the joints, with that of the file.

    None if the controller reports neither, or gravity hardly loads the joints in this posture.
    """
    if facts.gravity is None:
        return _compare_holding(model, arm, facts)
    base = _placed(model, model.of(ArmModel)[arm].base_frame, model.base_frame)
    ours = base.rotation.T @ np.array([0.0, 0.0, -1.0])
    angle = math.acos(float(np.clip(ours @ facts.gravity / max(np.linalg.norm(facts.gravity), 1e-9), -1.0, 1.0)))
    text = (
        f"gravity pulls along {np.round(facts.gravity, 2).tolist()} by the controller, {np.round(ours, 2).tolist()} by "
        f"the file: {math.degrees(angle):.1f}° apart"
    )
    return ModelComparison(angle <= MOUNTING_TOLERANCE, text, {"apart_deg": math.degrees(angle)})


def _compare_holding(model: RobotModel, arm: str, facts: ArmFacts) -> ModelComparison | None:
    if facts.holding_torques is None:
        return None
    loads = _gravity_loads(model, arm, facts.positions)
    ours, theirs = loads @ np.array([0.0, 0.0, -GRAVITY]), facts.holding_torques
    allowed = HOLDING_TOLERANCE * GRAVITY * float(np.linalg.norm(loads, 2))
    if float(np.linalg.norm(ours)) < allowed:
        return None
    apart = float(np.linalg.norm(theirs - ours))
    text = (
        f"the controller holds the arm with {np.round(theirs, 1).tolist()} N m; mounted as in the file, it needs "
        f"{np.round(ours, 1).tolist()} N m"
    )
    if apart > allowed:
        text += ": set the mounting at the controller, or the arm's place in the file"
    return ModelComparison(apart <= allowed, text, {"apart_nm": apart, "allowed_nm": allowed})


def _gravity_loads(model: RobotModel, arm: str, positions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the torques (n, 3), N m, that hold an arm at rest per m/s² of gravity along x, y and z of the base frame.

    The URDF's masses, other joints at zero.
    """
    import pinocchio

    dynamics = pinocchio.buildModelFromXML(model.urdf)
    data, q = dynamics.createData(), pinocchio.neutral(dynamics)
    joints = [dynamics.joints[dynamics.getJointId(name)] for name in model.of(ArmModel)[arm].joint_names]
    for joint, position in zip(joints, positions, strict=True):
        q[joint.idx_q] = position
    pinocchio.framesForwardKinematics(dynamics, data, pinocchio.neutral(dynamics))
    base = data.oMf[dynamics.getFrameId(model.base_frame)].rotation
    columns = []
    for axis in base.T:
        dynamics.gravity.linear = axis
        columns.append(pinocchio.computeGeneralizedGravity(dynamics, data, q)[[joint.idx_v for joint in joints]])
    return np.array(columns).T


COMPARISONS: tuple[Callable[[RobotModel, str, ArmFacts], ModelComparison | None], ...] = (
    compare_tool,
    compare_payload,
    compare_mounting,
)


def _placed(model: RobotModel, link: str, reference: str) -> Pose:
    """Return the pose of one link in another, all joints at zero."""
    poses = link_poses(list(ET.fromstring(model.urdf)), {}, (link, reference))
    return poses[reference].inverse() @ poses[link]
