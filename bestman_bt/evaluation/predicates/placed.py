"""``placed``: each goal's object stands at its goal."""

from __future__ import annotations

import math

import numpy as np

from bestman_bt.evaluation.predicates.standing import moved_by_drawer, rest_faults, tilt_fault
from bestman_bt.evaluation.predicates.verdict import Evidence, Verdict, joined
from bestman_bt.messages import Pose, wrap_angle
from bestman_bt.runtime import TaskGoal


def placed(evidence: Evidence) -> Verdict:
    """Let go, upright, within the tolerance, at rest, on the right surface: each object.

    With several goals the metrics are ``place_error_mm_plate`` … and, over all, the largest ``place_error_mm``.
    """
    goals = evidence.session.setup.goals
    verdicts = [_placed(evidence, goal) for goal in goals]
    if len(goals) == 1:
        return verdicts[0]
    both = joined(verdicts)
    metrics = {
        f"{key}_{goal.object}": value
        for goal, verdict in zip(goals, verdicts, strict=True)
        for key, value in verdict.metrics.items()
    }
    for key in sorted({key for verdict in verdicts for key in verdict.metrics}):
        metrics[key] = max(verdict.metrics[key] for verdict in verdicts if key in verdict.metrics)
    return Verdict(both.holds, both.why, metrics)


def _placed(evidence: Evidence, goal: TaskGoal) -> Verdict:
    tolerances = evidence.session.setup.config.task.tolerances
    if goal.object not in evidence.before:
        return Verdict(False, f"there is no {goal.object} in the scene")
    pose = evidence.truth.object_pose(goal.object)
    symmetry = evidence.session.setup.world_model.models[goal.object].symmetry_order
    metrics = _errors(pose, _asked(evidence, goal), symmetry)
    faults = []
    if metrics["place_error_mm"] > 1e3 * tolerances.position:
        faults.append(f"{metrics['place_error_mm']:.0f} mm from the goal")
    faults += tilt_fault(evidence, pose)
    if tolerances.yaw is not None and metrics.get("yaw_error_deg", 0.0) > math.degrees(tolerances.yaw):
        faults.append(f"turned by {metrics['yaw_error_deg']:.0f}°")
    faults += rest_faults(evidence, goal.object, goal.surface)
    return Verdict(not faults, f"the {goal.object} is " + ", ".join(faults) if faults else "", metrics)


def _asked(evidence: Evidence, goal: TaskGoal) -> Pose:
    """The goal's pose; in a drawer it is given for the closed one and goes with it."""
    piece = next(p for p in evidence.session.setup.world.furniture if p.name == goal.surface.partition("/")[0])
    return piece.pose @ moved_by_drawer(evidence, goal.surface) @ piece.pose.inverse() @ goal.pose


def _errors(pose: Pose, asked: Pose, symmetry_order: int) -> dict[str, float]:
    metrics = {
        "place_error_mm": 1e3 * float(np.linalg.norm(pose.position[:2] - asked.position[:2])),
        "tilt_deg": math.degrees(pose.tilt),
    }
    if symmetry_order:
        turn = 2.0 * math.pi / symmetry_order
        off = abs(wrap_angle((pose.yaw - asked.yaw) * symmetry_order)) / (2.0 * math.pi) * turn
        metrics["yaw_error_deg"] = math.degrees(off)
    return metrics
