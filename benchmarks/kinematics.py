"""Kinematics figures on this machine: prints one JSON document.

IK: poses reached by random configurations of a Panda and a UR5, from one fixed start; solved counts 1 mm, 0.5°, inside
the limits. Doors: random hinges, radii and heights, opened by 80° by a bar about which the hand may turn by ±50°; for
each the ranked stands of diff_panda, with the whole arm's path re-checked between stations: how far the tool leaves
the bar's arc. Times are CPU time of this one thread, so that a loaded machine gives nearly the figures of an idle one.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import sys
import time
from itertools import pairwise
from pathlib import Path

from bestman_bt.manipulation.base_placement import PathPlacements
from bestman_bt.manipulation.kinematics.reachability_map import ReachabilitySampling

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).parents[1]))

import numpy as np

from bestman_bt.evaluation.interval import wilson_interval
from bestman_bt.manipulation.base_placement import ReachingArm, placements_around
from bestman_bt.manipulation.kinematics.damped_least_squares import DampedLeastSquares
from bestman_bt.messages import Pose
from bestman_bt.robot_model.compose import load_robot_model
from bestman_bt.robot_model.model import ArmModel, RobotModel
from tests.manipulation.fixed_ur5 import fixed_ur5
from tests.manipulation.kinematics.door_stations import door_stations
from tests.manipulation.table_and_shelf import fixed_panda

STARTS = {
    "fixed_panda": np.array([0.0, -0.5, 0.0, -2.2, 0.0, 1.8, 0.785]),
    "fixed_ur5": np.array([0.0, -1.2, 1.4, -1.7, -1.57, 0.0]),
}


def inverse_kinematics(robot: RobotModel, count: int, seed: int) -> dict[str, object]:
    arm, kinematics, start = robot.of(ArmModel)["arm"], DampedLeastSquares(robot), STARTS[robot.name]
    rng = np.random.default_rng(seed)
    solved, seconds = 0, []
    for q in rng.uniform(arm.lower + 0.03, arm.upper - 0.03, (count, len(start))):
        target = kinematics.tool_pose(q)
        began = time.process_time()
        result = kinematics.solve(target, start, rng)
        seconds.append(time.process_time() - began)
        if result.found:
            reached = kinematics.tool_pose(result.best)
            turn = 2 * math.acos(min(1.0, abs(float(reached.quaternion @ target.quaternion))))
            inside = bool(np.all((result.best >= arm.lower) & (result.best <= arm.upper)))
            near = float(np.linalg.norm(reached.position - target.position)) < 1e-3
            solved += inside and near and turn < math.radians(0.5)
    return {"poses": count, "solved": solved, **share(solved, count), "ms": spread(seconds)}


def doors(count: int, seed: int) -> dict[str, object]:
    robot = load_robot_model("diff_panda")
    arm, kinematics = robot.of(ArmModel)["arm"], DampedLeastSquares(robot)
    home = robot.posture("home", arm.joint_names)
    began = time.process_time()
    reachability = ReachabilitySampling().build(kinematics, arm)
    map_seconds = time.process_time() - began
    figures: dict[str, object] = {"doors": count, "map_seconds": round(map_seconds, 2)}
    for name, stiff, used in (
        ("hand_turns", False, reachability),
        ("hand_turns_without_map", False, None),
        ("hand_stiff", True, reachability),
    ):
        rng = np.random.default_rng(seed)
        opened, stands, margins, deviations, seconds = 0, [], [], [0.0], []
        for _ in range(count):
            hinge = Pose.from_xyz_rpy((0, 0, rng.uniform(0.6, 1.4)), (0, 0, rng.uniform(-math.pi, math.pi)))
            door = door_stations(hinge, rng.uniform(0.25, 0.6), int(rng.choice([-1, 1])))
            if stiff:
                door = [[poses[5]] for poses in door]
            around = placements_around(door[len(door) // 2][len(door[0]) // 2].position)
            candidates = [s for s in around if hinge.inverse().apply(np.array([s.x, s.y, 0.0]))[0] < -0.4]
            began = time.process_time()
            ranked = PathPlacements(enough=4, starts=4).rank(
                candidates, door, ReachingArm(kinematics, arm, home, rng, used)
            )
            seconds.append(time.process_time() - began)
            opened += bool(ranked)
            stands.append(len(ranked))
            if ranked:
                margins.append(ranked[0].arc.margin)
                deviations.append(off_the_arc(kinematics, ranked[0].pose.to_pose(), ranked[0].arc.path, hinge, door))
        figures[name] = {
            "opened": opened,
            **share(opened, count),
            "stands_mean": float(np.mean(stands)),
            "margin_median": float(np.median(margins)) if margins else None,
            "worst_deviation_mm": 1e3 * max(deviations),
            "ms": spread(seconds),
        }
    return figures


def off_the_arc(
    kinematics: DampedLeastSquares, stand: Pose, path: np.ndarray, hinge: Pose, door: list[list[Pose]]
) -> float:
    """How far the tool is from the bar's circle between stations, metres."""
    centre = hinge.inverse()
    radius = float(np.hypot(*centre.apply(door[0][0].position)[:2]))
    worst = 0.0
    for a, b in pairwise(path):
        for part in (0.25, 0.5, 0.75):
            point = centre.apply(stand.apply(kinematics.tool_pose(a + part * (b - a)).position))
            worst = max(worst, abs(float(np.hypot(*point[:2])) - radius), abs(float(point[2])))
    return worst


def share(hits: int, tries: int) -> dict[str, object]:
    return {"share": hits / tries, "interval_95": [round(bound, 4) for bound in wilson_interval(hits, tries)]}


def spread(seconds: list[float]) -> dict[str, float]:
    milliseconds = 1e3 * np.array(seconds)
    return {
        "mean": round(float(milliseconds.mean()), 3),
        "median": round(float(np.median(milliseconds)), 3),
        "p95": round(float(np.percentile(milliseconds, 95)), 3),
        "max": round(float(milliseconds.max()), 3),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--poses", type=int, default=2000)
    parser.add_argument("--doors", type=int, default=40)
    parser.add_argument("--seed", type=int, default=7000)
    arguments = parser.parse_args()
    figures: dict[str, object] = {"seed": arguments.seed}
    for robot in (fixed_panda(), fixed_ur5()):
        figures[robot.name] = {
            "inverse_kinematics": inverse_kinematics(robot, arguments.poses, arguments.seed),
        }
    if arguments.doors:
        figures["doors"] = doors(arguments.doors, arguments.seed)
    print(json.dumps(figures, indent=2))


if __name__ == "__main__":
    main()
