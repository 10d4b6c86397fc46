"""Data that controllers report about themselves and their arms, for comparison with the robot's file."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import GRAVITY, Pose
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


TOOL_TOLERANCE = 0.002
"""Metres."""
PAYLOAD_TOLERANCE = 0.5
"""Kilograms of cables and other parts that the URDF lacks."""
MOUNTING_TOLERANCE = math.radians(5.0)
DOWN = np.array([0.0, 0.0, -1.0])
"""Direction of gravity in the base frame of a robot on the floor."""
HOLDING_TOLERANCE = 0.08
"""As a fraction of the largest joint torque that any mounting causes in a posture. Assumed: 5 % for rounded masses and
centres of links in a URDF, and 3 % for a hand's centre that the controller has elsewhere (1 kg by 5 cm: 1 to 3 % on a
UR5e and a UR3e). Masses of a sister model exceed it: those of a UR5 differ from a UR5e's by 4 to 16 %.
"""


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
    """Compare the controller's direction of gravity, or else the torques caused by it, with the robot file.

    Return None if the controller reports neither, or if according to both, gravity hardly loads the joints in this
    posture.
    """
    if facts.gravity is None:
        return _compare_holding(model, arm, facts)
    base = _placed(model, model.of(ArmModel)[arm].base_frame, model.base_frame)
    ours = base.rotation.T @ DOWN
    angle = math.acos(float(np.clip(ours @ facts.gravity / max(np.linalg.norm(facts.gravity), 1e-9), -1.0, 1.0)))
    text = (
        f"gravity pulls along {(np.round(facts.gravity, 2) + 0.0).tolist()} by the controller, "
        f"{(np.round(ours, 2) + 0.0).tolist()} by the file: {math.degrees(angle):.1f}° apart"
    )
    return ModelComparison(angle <= MOUNTING_TOLERANCE, text, {"apart_deg": math.degrees(angle)})


def _compare_holding(model: RobotModel, arm: str, facts: ArmFacts) -> ModelComparison | None:
    if facts.holding_torques is None:
        return None
    loads = _gravity_loads(model, arm, facts)
    ours, theirs = loads @ DOWN, facts.holding_torques
    allowed = HOLDING_TOLERANCE * float(np.linalg.norm(loads, 2))
    apart = float(np.linalg.norm(theirs - ours))
    if apart <= allowed and float(np.linalg.norm(ours)) <= allowed:
        return None
    text = (
        f"the controller holds the arm with {np.round(theirs, 1).tolist()} N m; mounted as in the file, it needs "
        f"{np.round(ours, 1).tolist()} N m"
    )
    figures = {"apart_nm": apart, "allowed_nm": allowed}
    if apart > allowed:
        text += ": correct the mounting at the controller, or the arm's place or the masses of its links in the file"
        return ModelComparison(False, text, figures)
    hidden = _hidden_tilt(loads, allowed)
    text += f"; a mounting tilted by up to {hidden:.0f}° might not show in this posture"
    return ModelComparison(True, text, {**figures, "hidden_deg": hidden})


def _hidden_tilt(loads: NDArray[np.float64], allowed: float) -> float:
    """Return the largest tilt of the mounting, degrees, that changes the torques by at most ``allowed`` N m."""
    tilts, headings = np.meshgrid(np.arange(181.0), np.radians(np.arange(0.0, 360.0, 5.0)))
    level, upright = np.sin(np.radians(tilts)), np.cos(np.radians(tilts))
    directions = np.stack([level * np.cos(headings), level * np.sin(headings), -upright], axis=-1)
    apart = np.linalg.norm((directions - DOWN) @ loads.T, axis=-1)
    return float(tilts[apart <= allowed].max())


def _gravity_loads(model: RobotModel, arm: str, facts: ArmFacts) -> NDArray[np.float64]:
    """Return the torques (n, 3), N m, that hold an arm at rest with gravity along x, y and z of the base frame.

    The URDF's masses, but for the hand that of the controller's payload; other joints at zero.
    """
    import pinocchio

    dynamics = pinocchio.buildModelFromXML(model.urdf)
    flange = dynamics.frames[dynamics.getFrameId(flange_of(model, arm))]
    if facts.payload is not None:
        missing = facts.payload - payload(model, flange.name).mass
        dynamics.appendBodyToJoint(
            flange.parentJoint, pinocchio.Inertia(missing, np.zeros(3), np.zeros((3, 3))), flange.placement
        )
    data, q = dynamics.createData(), pinocchio.neutral(dynamics)
    joints = [dynamics.joints[dynamics.getJointId(name)] for name in model.of(ArmModel)[arm].joint_names]
    for joint, position in zip(joints, facts.positions, strict=True):
        q[joint.idx_q] = position
    pinocchio.framesForwardKinematics(dynamics, data, pinocchio.neutral(dynamics))
    base = data.oMf[dynamics.getFrameId(model.base_frame)].rotation
    columns = []
    for axis in base.T:
        dynamics.gravity.linear = GRAVITY * axis
        columns.append(pinocchio.computeGeneralizedGravity(dynamics, data, q)[[joint.idx_v for joint in joints]])
    return np.array(columns).T


COMPARISONS: Mapping[str, Callable[[RobotModel, str, ArmFacts], ModelComparison | None]] = {
    "tool": compare_tool,
    "payload": compare_payload,
    "mounting": compare_mounting,
}
"""The comparison, by the step of the bring-up that measures it."""


def _placed(model: RobotModel, link: str, reference: str) -> Pose:
    """Return the pose of one link in another, all joints at zero."""
    poses = link_poses(list(ET.fromstring(model.urdf)), {}, (link, reference))
    return poses[reference].inverse() @ poses[link]
