"""``at_goal``: the base stands where it was asked to be, and did not go a long way round."""

from __future__ import annotations

import math

from bestman_bt.evaluation.predicates.verdict import Evidence, Verdict
from bestman_bt.messages import wrap_angle
from bestman_bt.navigation.global_planning import shortest_length
from bestman_bt.runtime.drive_goals import true_costmap


def at_goal(evidence: Evidence) -> Verdict:
    """Its true pose is within the tolerances of ``position`` and ``yaw``.

    Metrics: ``final_error_mm``, ``final_yaw_deg``, and ``path_ratio``: the way that was driven to the shortest one on
    the grid of what really stands there, for the circle inside the base.
    """
    setup = evidence.session.setup
    goal, tolerances = setup.drive_goal, setup.config.task.tolerances
    assert goal is not None
    pose = evidence.truth.base_pose().to_pose2d()
    distance, turn = pose.distance_to(goal), abs(wrap_angle(pose.theta - goal.theta))
    faults = []
    if distance > tolerances.position:
        faults.append(f"{1e3 * distance:.0f} mm from the goal")
    if tolerances.yaw is not None and turn > tolerances.yaw:
        faults.append(f"turned away by {math.degrees(turn):.1f}°")
    metrics = {"final_error_mm": 1e3 * distance, "final_yaw_deg": math.degrees(turn)}
    if not faults:
        costmap = true_costmap(setup.world, setup.robot_model)
        shortest = shortest_length(setup.world.robot_start.xy, goal.xy, costmap, costmap.footprint.inscribed_radius)
        metrics["path_ratio"] = evidence.driven / shortest
    return Verdict(not faults, "the base is " + ", ".join(faults) if faults else "", metrics)
