"""Drives to random goals in apartments or in the kitchen, one after the other, and measures how they went.

Run it with ``python benchmarks/navigation.py [--goals N] [--worlds M] [--walkers] [--set key=value] [--json]``; keys
and units are those of docs/navigation.md. All poses that count as truth come from the simulator, and only this program
sees them: the robot drives by the tree ``navigate``.
"""

from __future__ import annotations

import argparse
import json
import math
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from bestman_bt.configuration import load_run
from bestman_bt.configuration.task import DriveConfig
from bestman_bt.evaluation.audit import audit
from bestman_bt.evaluation.driven_path import DrivenPath
from bestman_bt.evaluation.interval import wilson_interval
from bestman_bt.messages import Pose2D, wrap_angle
from bestman_bt.navigation.global_planning import GridAStar, shortest_length
from bestman_bt.runtime import Session, open_session, prepare
from bestman_bt.runtime.algorithms import make_local_planner
from bestman_bt.runtime.drive_goals import drive_goal, true_costmap
from hal.api import Robot
from hal.pybullet import GroundTruth, PyBulletRobot

POSITION_TOLERANCE, YAW_TOLERANCE = 0.05, math.radians(3.0)
REST = 0.5
"""Seconds between two drives."""


@dataclass
class Measurements:
    """``reached``: of each drive, whether it ended at its goal without having touched anything."""

    reached: list[bool] = field(default_factory=list)
    why: list[str] = field(default_factory=list)
    contacts: int = 0
    contacts_by_walkers: int = 0
    honest: bool = True
    position_errors: list[float] = field(default_factory=list)
    heading_errors: list[float] = field(default_factory=list)
    path_ratios: list[float] = field(default_factory=list)
    localisation_errors: list[float] = field(default_factory=list)
    plan_times: list[float] = field(default_factory=list)
    tick_times: list[float] = field(default_factory=list)
    simulated: float = 0.0
    wall: float = 0.0

    def summary(self, seed: int) -> dict[str, Any]:
        """The JSON document."""
        succeeded = sum(self.reached)
        return {
            "seed": seed,
            "goals": len(self.reached),
            "reached_rate": succeeded / len(self.reached),
            "interval": [round(bound, 4) for bound in wilson_interval(succeeded, len(self.reached))],
            "contacts": self.contacts,
            "contacts_by_walkers": self.contacts_by_walkers,
            "honest": self.honest,
            "final_error_mm_median": 1e3 * _median(self.position_errors),
            "final_error_mm_max": 1e3 * max(self.position_errors, default=math.nan),
            "final_yaw_deg_median": math.degrees(_median(self.heading_errors)),
            "path_ratio_median": _median(self.path_ratios),
            "localisation_error_mm_mean": 1e3 * float(np.mean(self.localisation_errors)),
            "plan_ms_median": 1e3 * _median(self.plan_times),
            "local_tick_ms_median": 1e3 * _median(self.tick_times),
            "local_tick_ms_p95": 1e3 * float(np.percentile(self.tick_times, 95)),
            "real_time_factor": self.simulated / self.wall,
            "failures": self.why,
        }


def _median(values: list[float]) -> float:
    return float(np.median(values)) if values else math.nan


@contextmanager
def timed(owner: type, method: str, times: list[float]) -> Iterator[None]:
    """Note how long every call of a method takes, seconds."""
    plain = getattr(owner, method)

    def measured(*arguments: Any, **keywords: Any) -> Any:
        begin = time.perf_counter()
        result = plain(*arguments, **keywords)
        times.append(time.perf_counter() - begin)
        return result

    setattr(owner, method, measured)
    try:
        yield
    finally:
        setattr(owner, method, plain)


def drive_in_one_world(task: str, seed: int, goals: int, settings: list[str], measured: Measurements) -> None:
    """``goals`` drives in the world of a seed, each from where the last one ended."""
    own = [f"scene.generator.apartment.seed={seed}"] if "apartment" in task else []
    setup = prepare(load_run(task, seed=seed, settings=[*own, *settings]))
    held: list[GroundTruth] = []

    def hold_truth(robot: Robot) -> None:
        assert isinstance(robot, PyBulletRobot)
        held.append(GroundTruth(robot))

    follower = type(make_local_planner(setup.config))
    with (
        open_session(setup, hold_truth) as session,
        timed(GridAStar, "plan", measured.plan_times),
        timed(follower, "compute", measured.tick_times),
    ):
        truth, robot = held[0], session.robot
        assert isinstance(robot, PyBulletRobot)
        begin_wall, begin_simulated = time.perf_counter(), robot.clock.now()
        touched = 0
        for number in range(goals):
            start = truth.base_pose().to_pose2d()
            world = replace(setup.world, robot_start=start)
            goal = drive_goal(DriveConfig(), world, setup.world_model.map, setup.robot_model, 1000 * seed + number)
            driven, why = _drive(session, truth, goal, measured)
            robot.clock.sleep(REST)
            pose = truth.base_pose().to_pose2d()
            off, turn = pose.distance_to(goal), abs(wrap_angle(pose.theta - goal.theta))
            collisions = audit(robot.honesty_record()).collisions
            if not why and (off > POSITION_TOLERANCE or turn > YAW_TOLERANCE):
                why = f"believed to be at the goal, {1e3 * off:.0f} mm and {math.degrees(turn):.1f}° off"
            elif not why and len(collisions) > touched:
                why = f"touched {collisions[-1].second}"
            if not why:
                costmap = true_costmap(setup.world, setup.robot_model)
                shortest = shortest_length(start.xy, goal.xy, costmap, costmap.footprint.inscribed_radius)
                measured.path_ratios.append(driven / shortest)
                measured.position_errors.append(off)
                measured.heading_errors.append(turn)
            measured.reached.append(not why)
            measured.why += [f"seed {seed}, goal {number}: {why}"] if why else []
            touched = len(collisions)
        measured.wall += time.perf_counter() - begin_wall
        measured.simulated += robot.clock.now() - begin_simulated
        judged = audit(robot.honesty_record())
        measured.contacts += len(judged.collisions)
        measured.contacts_by_walkers += len(judged.contacts_by_walkers)
        measured.honest = measured.honest and judged.honest


def _drive(session: Session, truth: GroundTruth, goal: Pose2D, measured: Measurements) -> tuple[float, str]:
    """Metres driven, and why the tree failed, empty where it did not."""
    tree = session.load()
    tree.blackboard.set("goal", goal)
    path = DrivenPath(truth)

    def after_tick() -> None:
        path.after_tick()
        true_pose = truth.base_pose().to_pose2d()
        measured.localisation_errors.append(session.skills.world.base.pose.distance_to(true_pose))

    execution = session.executor(tree, after_tick).run()
    if execution.succeeded:
        return path.length, ""
    told = [failure.why for failure in session.skills.failures[-1:]]
    return path.length, told[0] if told else f"{execution.ending}: {execution.why}"


def measure(task: str, seed: int, goals: int, worlds: int, settings: list[str]) -> Measurements:
    """All drives, spread over so many worlds."""
    measured = Measurements()
    for index in range(worlds):
        share = goals // worlds + (index < goals % worlds)
        if share:
            drive_in_one_world(task, seed + index, share, settings, measured)
    return measured


def main() -> None:
    """Parse the command line, drive, print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--goals", type=int, default=20)
    parser.add_argument(
        "--worlds", type=int, default=5, help="apartments, or kitchens whose furniture is off otherwise"
    )
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--kitchen", action="store_true", help="in the kitchen instead of in apartments")
    parser.add_argument("--walkers", action="store_true", help="and once more with people who walk about")
    parser.add_argument("--set", action="append", default=[], metavar="key=value", dest="settings")
    parser.add_argument("--json", action="store_true", help="one JSON document instead of lines")
    arguments = parser.parse_args()
    if arguments.goals < 1 or arguments.worlds < 1:
        parser.error("--goals and --worlds should be at least 1")
    task = "navigate_kitchen" if arguments.kitchen else "navigate_apartment"
    asked = arguments.seed, arguments.goals, arguments.worlds, arguments.settings
    summary = measure(task, *asked).summary(arguments.seed)
    if arguments.walkers:
        moving = measure(f"{task}_walkers", *asked).summary(arguments.seed)
        summary["reached_rate_dynamic"] = moving["reached_rate"]
        summary["dynamic"] = moving
    if arguments.json:
        print(json.dumps(summary))
    else:
        for key, value in summary.items():
            print(f"{key:28} {value:.3f}" if isinstance(value, float) else f"{key:28} {value}")


if __name__ == "__main__":
    main()
