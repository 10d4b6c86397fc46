"""``tool_at``: the tool of the robot's arm is where it was asked to be."""

from __future__ import annotations

import math

import numpy as np

from bestman_bt.evaluation.predicates.verdict import Evidence, Verdict


def tool_at(evidence: Evidence) -> Verdict:
    """Within the tolerances of position and, all axes together, of ``tilt``; metrics: ``tool_error_mm``, ``_deg``."""
    goal, skills = evidence.session.setup.reach_goal, evidence.session.skills
    assert goal is not None
    tolerances = evidence.session.setup.config.task.tolerances
    tool = evidence.truth.frame_pose(skills.arm_model.tool_frame)
    off = goal.inverse() @ tool
    distance = float(np.linalg.norm(off.position))
    angle = 2.0 * math.acos(min(1.0, abs(float(off.quaternion[3]))))
    faults = []
    if distance > tolerances.position:
        faults.append(f"{1e3 * distance:.0f} mm from the goal")
    if angle > tolerances.tilt:
        faults.append(f"turned away by {math.degrees(angle):.0f}°")
    metrics = {"tool_error_mm": 1e3 * distance, "tool_error_deg": math.degrees(angle)}
    return Verdict(not faults, "the tool is " + ", ".join(faults) if faults else "", metrics)
