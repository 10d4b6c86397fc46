"""Success predicates: what must be true at the end of a run, judged by ground truth."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from bestman_bt.configuration import ConfigurationError, RunConfig
from bestman_bt.messages import Pose, wrap_angle
from bestman_bt.registry import suggestion
from bestman_bt.runtime import Session
from hal.api import Clock
from hal.pybullet import GroundTruth

AT_REST = 0.001
"""Metres that an object may move during the rest time."""


@dataclass(frozen=True)
class Verdict:
    """``holds``: whether the predicate is true. ``why``: in words where it is not. ``metrics``: what was measured."""

    holds: bool
    why: str = ""
    metrics: dict[str, float] = field(default_factory=dict)


Predicate = Callable[[Session, GroundTruth, Clock], Verdict]


def placed(session: Session, truth: GroundTruth, clock: Clock) -> Verdict:
    """The goal's object stands at the goal: let go, upright, within the tolerance, at rest, on the right surface."""
    task = session.setup.config.task
    goal, tolerances = task.goal, task.tolerances
    assert goal is not None
    if goal.object not in truth.object_names:
        clock.sleep(tolerances.rest_time)
        return Verdict(False, f"there is no {goal.object} in the scene")
    asked = session.setup.world.goals[goal.name]
    before = truth.object_pose(goal.object)
    clock.sleep(tolerances.rest_time)
    pose = truth.object_pose(goal.object)
    symmetry = session.setup.world_model.models[goal.object].symmetry_order
    metrics = _errors(pose, asked, symmetry)
    faults = []
    if metrics["place_error_mm"] > 1e3 * tolerances.position:
        faults.append(f"{metrics['place_error_mm']:.0f} mm from the goal")
    if metrics["tilt_deg"] > math.degrees(tolerances.tilt):
        faults.append(f"tilted by {metrics['tilt_deg']:.0f}°")
    if tolerances.yaw is not None and metrics.get("yaw_error_deg", 0.0) > math.degrees(tolerances.yaw):
        faults.append(f"turned by {metrics['yaw_error_deg']:.0f}°")
    if float(np.linalg.norm(pose.position - before.position)) > AT_REST:
        faults.append("still moving")
    if truth.touches_robot(goal.object):
        faults.append("not let go")
    support = goal.surface.partition("/")[0]
    if support not in truth.supports(goal.object):
        faults.append(f"not standing on the {support}")
    return Verdict(not faults, f"the {goal.object} is " + ", ".join(faults) if faults else "", metrics)


PREDICATES: dict[str, Predicate] = {"placed": placed}


def find_predicate(config: RunConfig) -> Predicate | None:
    """The task's predicate; None where it names none. ConfigurationError for an unknown name or a missing goal."""
    name = config.task.predicate
    if name is None:
        return None
    if name not in PREDICATES:
        message = f"unknown predicate {name!r}; {suggestion(name, list(PREDICATES))}"
        raise ConfigurationError([config.problem(("predicate",), message)])
    if config.task.goal is None:
        raise ConfigurationError([config.problem(("goal",), f"is missing: the predicate {name!r} needs a goal")])
    return PREDICATES[name]


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
