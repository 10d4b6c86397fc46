"""Identity and arm facts that controllers report, compared with the robot's file; nothing moves."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

import numpy as np

from bestman_bt.bringup.brought_up_robot import BroughtUpRobot, for_each_part
from bestman_bt.bringup.finding import CheckFinding, judged, not_applicable
from bestman_bt.messages import Pose
from bestman_bt.robot_model.model import ArmModel, RobotModel
from bestman_bt.robot_model.payload import flange_of
from hal.api import Arm, JointGroup
from hal.hardware.controller_facts import ArmFacts, ModelComparison, compare_mounting, compare_payload, compare_tool

RANGE_TOLERANCE = 0.01
POSE_TOLERANCE, TURN_TOLERANCE = 0.002, math.radians(0.5)


def identity(subject: BroughtUpRobot) -> Iterator[CheckFinding]:
    """Compare the identities with those of an earlier part of this bring-up, if any."""
    for name, facts in subject.identities().items():
        owed = subject.signed_serials.get(name, "")
        firmware = subject.signed_firmware.get(name, "")
        driver = subject.model.connections[name].driver
        if not facts.serial_number and not owed:
            yield not_applicable(name, f"a controller behind {driver} reports no serial number")
            continue
        text = (
            f"{facts.model or driver}, serial number {facts.serial_number or 'not reported'}, firmware {facts.firmware}"
        )
        if owed and facts.serial_number != owed:
            text += f"; the bring-up was started with {owed}: start it again (--again)"
        elif firmware and facts.firmware != firmware:
            text += f"; the bring-up was started with firmware {firmware}: start it again (--again)"
        same = facts.serial_number == (owed or facts.serial_number) and facts.firmware == (firmware or facts.firmware)
        yield judged(name, same, text, model=facts.model, serial_number=facts.serial_number, firmware=facts.firmware)


def _of_each_arm(
    look: Callable[[BroughtUpRobot, str, ArmFacts], CheckFinding],
) -> Callable[[BroughtUpRobot], Iterator[CheckFinding]]:
    """Return the step that looks at each arm whose controller reports its state."""

    def look_at(subject: BroughtUpRobot, name: str, arm: Arm) -> CheckFinding:
        facts = subject.robot.arm_facts(name)
        return (
            not_applicable(name, "its controller does not report it") if facts is None else look(subject, name, facts)
        )

    return for_each_part(Arm, "no arm is", look_at)


def _limits(subject: BroughtUpRobot, name: str, group: JointGroup) -> CheckFinding:
    """Check that all joints are within their ranges, and that these are within the controller's limits."""
    here, model = group.positions(), group.model
    spare = np.minimum(here - model.lower, model.upper - here)
    worst = int(np.argmin(spare))
    inside = bool(spare[worst] >= -RANGE_TOLERANCE)
    text = f"{group.joint_names[worst]} is {spare[worst]:.3f} rad from the end of its range"
    facts = subject.robot.arm_facts(name) if name in subject.arms else None
    if facts is None or facts.joint_limits is None:
        return judged(name, inside, f"{text}; the controller reports no ranges", spare=float(spare[worst]))
    beyond = np.maximum(facts.joint_limits[:, 0] - model.lower, model.upper - facts.joint_limits[:, 1])
    widest = int(np.argmax(beyond))
    within = bool(beyond[widest] <= RANGE_TOLERANCE)
    text += "; all ranges are within the controller's"
    if not within:
        text = (
            f"the file lets {group.joint_names[widest]} go {beyond[widest]:.3f} rad further than the controller's "
            f"{np.round(facts.joint_limits[widest], 3).tolist()}: 'set' its limits"
        )
    figures = {"spare": float(spare[worst]), "beyond_controller": float(beyond[widest])}
    return judged(name, inside and within, text, **figures)


def _agreed(
    compare: Callable[[RobotModel, str, ArmFacts], ModelComparison | None], unreported: str, hidden: str = ""
) -> Callable[[BroughtUpRobot], Iterator[CheckFinding]]:
    """Return the step that compares one value with the file. ``unreported``: its name, for controllers that do not
    report it; ``hidden``: the reason if joint torques, which stand in for it, do not show it.
    """

    def look_at(subject: BroughtUpRobot, arm: str, facts: ArmFacts) -> CheckFinding:
        found = compare(subject.model, arm, facts)
        if found is not None:
            return judged(arm, found.agrees, found.text, **found.measured)
        if hidden and facts.holding_torques is not None:
            return not_applicable(arm, hidden)
        return not_applicable(arm, f"its controller does not report {unreported}")

    return _of_each_arm(look_at)


def _tool_pose(subject: BroughtUpRobot, arm: str, facts: ArmFacts) -> CheckFinding:
    expected = model_tool_pose(subject, arm, facts)
    apart = float(np.linalg.norm(facts.tool_pose.position - expected.position))
    turned = turn_between(facts.tool_pose, expected)
    text = f"the controller's tool is {1e3 * apart:.2f} mm and {math.degrees(turned):.2f}° from our kinematics"
    fits = apart <= POSE_TOLERANCE and turned <= TURN_TOLERANCE
    if not fits:
        text += f"; at most {1e3 * POSE_TOLERANCE:g} mm and {math.degrees(TURN_TOLERANCE):g}°: another arm, or frame"
    return judged(arm, fits, text, apart_mm=1e3 * apart, turned_deg=math.degrees(turned))


def model_tool_pose(subject: BroughtUpRobot, arm: str, facts: ArmFacts) -> Pose:
    """Return the controller's tool pose in the arm's base frame by our kinematics, at the joint positions it
    reports.
    """
    model = subject.model.of(ArmModel)[arm]
    joints = dict(zip(model.joint_names, facts.positions.tolist(), strict=True))
    flange = subject.pose(flange_of(subject.model, arm), model.base_frame, joints)
    return flange if facts.tool_offset is None else flange @ facts.tool_offset


def turn_between(one: Pose, other: Pose) -> float:
    """Return the angle between two rotations, radians."""
    trace = float(np.trace(one.rotation.T @ other.rotation))
    return math.acos(float(np.clip((trace - 1.0) / 2.0, -1.0, 1.0)))


limits = for_each_part(JointGroup, "no joints are", _limits)
tool = _agreed(compare_tool, "the offset of its tool")
payload_mass = _agreed(compare_payload, "what it carries")
mounting = _agreed(
    compare_mounting,
    "how it is mounted",
    "gravity hardly loads its joints in this posture, so its mounting does not show: move it until its upper arm is "
    "upright and its forearm level (elbow bent by 90°), and run this step again (--step mounting)",
)
tool_pose = _of_each_arm(_tool_pose)
