"""Drives to random goals, one after the other, by the tree ``navigate``."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Any

from benchmarks.navigation_measures.judged_session import JudgedSession, judged_session
from benchmarks.navigation_measures.processor_times import timed_calls, timed_ticks
from benchmarks.navigation_measures.report import mean, median, percentile, scaled
from bestman_bt.configuration.run import load_run
from bestman_bt.evaluation.audit import audit
from bestman_bt.evaluation.episode_measures import DrivenPath
from bestman_bt.evaluation.interval import wilson_interval
from bestman_bt.facts.goals.at_goal import AtGoalFields, drive_goal, true_costmap
from bestman_bt.messages import Pose2D, wrap_angle
from bestman_bt.navigation.global_planning.grid_search import shortest_length
from bestman_bt.runtime.algorithms import Algorithms
from bestman_bt.runtime.resolved_config import prepare

POSITION_TOLERANCE, YAW_TOLERANCE = 0.05, math.radians(3.0)
REST = 0.5
"""Seconds between two drives."""


@dataclass
class Drives:
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
    processor: float = 0.0

    def summary(self, seed: int) -> dict[str, Any]:
        """The figures, for JSON."""
        succeeded = sum(self.reached)
        return {
            "seed": seed,
            "goals": len(self.reached),
            "reached_rate": succeeded / len(self.reached),
            "interval": [round(bound, 4) for bound in wilson_interval(succeeded, len(self.reached))],
            "contacts": self.contacts,
            "contacts_by_walkers": self.contacts_by_walkers,
            "honest": self.honest,
            "final_error_mm_median": scaled(median(self.position_errors), 1e3),
            "final_error_mm_max": 1e3 * max(self.position_errors, default=0.0),
            "final_yaw_deg_median": scaled(median(self.heading_errors), math.degrees(1.0)),
            "path_ratio_median": median(self.path_ratios),
            "localisation_error_mm_mean": scaled(mean(self.localisation_errors), 1e3),
            "plan_ms_median": scaled(median(self.plan_times), 1e3),
            "local_tick_ms_median": scaled(median(self.tick_times), 1e3),
            "local_tick_ms_p95": scaled(percentile(self.tick_times, 95.0), 1e3),
            "real_time_factor": self.simulated / self.wall,
            "real_time_factor_of_processor": self.simulated / self.processor,
            "failures": self.why,
        }


def measure(task: str, seed: int, goals: int, worlds: int, settings: list[str]) -> Drives:
    """All drives, spread over so many worlds from ``seed`` on."""
    drives = Drives()
    for index in range(worlds):
        share = goals // worlds + (index < goals % worlds)
        if share:
            drive_in_one_world(task, seed + index, share, settings, drives)
    return drives


def drive_in_one_world(task: str, seed: int, goals: int, settings: list[str], drives: Drives) -> None:
    """``goals`` drives in the world of a seed, each from where the last one ended."""
    own = [f"scene.generator.apartment.seed={seed}"] if "apartment" in task else []
    setup = prepare(load_run(task, seed=seed, settings=[*own, *settings]))
    algorithms = Algorithms(setup.config, setup.robot_model)
    follower, planner = type(algorithms.local_planning), type(algorithms.global_planning)
    with (
        judged_session(setup) as judged,
        timed_calls(planner, "plan", drives.plan_times.append),
        timed_ticks(follower, drives.tick_times),
    ):
        touched = 0
        for number in range(goals):
            start = judged.true_pose
            world = replace(setup.world, robot_start=start)
            goal = drive_goal(AtGoalFields(), world, setup.world_model.map, setup.robot_model, 1000 * seed + number)
            driven, why = _drive(judged, goal, drives)
            judged.robot.clock.sleep(REST)
            pose = judged.true_pose
            off, turn = pose.distance_to(goal), abs(wrap_angle(pose.theta - goal.theta))
            collisions = audit(judged.robot.audit_record()).collisions
            if not why and (off > POSITION_TOLERANCE or turn > YAW_TOLERANCE):
                why = f"believed to be at the goal, {1e3 * off:.0f} mm and {math.degrees(turn):.1f}° off"
            elif not why and len(collisions) > touched:
                why = f"touched {collisions[-1].second}"
            if not why:
                costmap = true_costmap(setup.world, setup.robot_model)
                shortest = shortest_length(start.xy, goal.xy, costmap, costmap.footprint.inscribed_radius)
                drives.path_ratios.append(driven / shortest)
                drives.position_errors.append(off)
                drives.heading_errors.append(turn)
            drives.reached.append(not why)
            drives.why += [f"seed {seed}, goal {number}: {why}"] if why else []
            touched = len(collisions)
        verdict = audit(judged.robot.audit_record())
        drives.contacts += len(verdict.collisions)
        drives.contacts_by_walkers += len(verdict.contacts_by_walkers)
        drives.honest = drives.honest and verdict.honest
    drives.simulated += judged.simulated
    drives.wall += judged.wall
    drives.processor += judged.processor


def _drive(judged: JudgedSession, goal: Pose2D, drives: Drives) -> tuple[float, str]:
    """Metres driven, and why the tree failed, empty where it did not."""
    session = judged.session
    tree = session.load()
    tree.blackboard.set("goal", goal)
    path = DrivenPath(judged.truth)

    def after_tick() -> None:
        path.after_tick()
        drives.localisation_errors.append(session.skills.world.base.pose.distance_to(judged.true_pose))

    execution = session.executor(tree, after_tick).run()
    if execution.succeeded:
        return path.length, ""
    told = [failure.why for failure in session.skills.failures[-1:]]
    return path.length, told[0] if told else f"{execution.ending}: {execution.why}"
