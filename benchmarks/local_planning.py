"""Drives among boxes that the map does not know, with each local planner: reached, contacts, errors, tick times.

Run it with ``python benchmarks/local_planning.py [--planners dwa mppi] [--robot diff_panda] [--drives N] [--json]``.
Each drive has a kitchen of its own. The boxes stand where the planned path leads; nobody plans again around them.
"""

from __future__ import annotations

import argparse
import itertools
import math
import sys
import time
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.navigation_measures.processor_times import timed_ticks
from benchmarks.navigation_measures.report import median, percentile, print_report, scaled
from bestman_bt.control.inertial import FusedOdometry
from bestman_bt.control.lidar import LidarSensor
from bestman_bt.control.wheeled.base_controller import BaseController
from bestman_bt.control.wheeled.collision_monitor import CollisionMonitor
from bestman_bt.control.wheeled.localisation_cycle import LocalisationCycle
from bestman_bt.facts.goals.at_goal import base_footprint
from bestman_bt.manipulation.kinematics.link_hulls import ForwardKinematics
from bestman_bt.messages import Box, Path2D, PlacedShape, Pose, Pose2D, wrap_angle
from bestman_bt.navigation.global_planning.costmap import Costmap
from bestman_bt.navigation.global_planning.polyline_planner import GridAStar
from bestman_bt.navigation.local_planning.base import PathFollower
from bestman_bt.navigation.local_planning.dwa import DWA
from bestman_bt.navigation.local_planning.mppi import MPPI
from bestman_bt.navigation.local_planning.pure_pursuit import PurePursuit
from bestman_bt.navigation.localization.ekf import WheelOdometry
from bestman_bt.navigation.localization.scan_to_map import ScanToMap
from bestman_bt.robot_model.compose import load_robot_model
from bestman_bt.robot_model.model import RobotModel
from bestman_bt.scene.draw import draw_world
from bestman_bt.scene.load import load_scene
from bestman_bt.scene.map_of_world import semantic_map
from bestman_bt.scene.scene import FurnitureModel, PlacedFurniture, World
from bestman_bt.world_model.world_model import BasePose, Obstacle, WorldModel
from hal.api import Lidar, MobileBase, MotionStatus
from hal.pybullet.robot import PyBulletRobot
from hal.simulation.ground_truth import GroundTruth

PLANNERS: dict[str, type[PathFollower]] = {"pure_pursuit": PurePursuit, "dwa": DWA, "mppi": MPPI}
TIME_LIMIT = 90.0


@dataclass
class Measurements:
    drives: int = 0
    reached: int = 0
    contacts: int = 0
    failures: list[str] = field(default_factory=list)
    position_errors: list[float] = field(default_factory=list)
    heading_errors: list[float] = field(default_factory=list)
    believed_errors: list[float] = field(default_factory=list)
    path_ratios: list[float] = field(default_factory=list)
    times: list[float] = field(default_factory=list)
    ticks: list[float] = field(default_factory=list)
    wall: float = 0.0
    processor: float = 0.0

    def summary(self) -> dict[str, Any]:
        return {
            "drives": self.drives,
            "reached_rate": self.reached / self.drives,
            "contacts": self.contacts,
            "final_error_mm_median": scaled(median(self.position_errors), 1e3),
            "final_error_mm_max": scaled(max(self.position_errors, default=None), 1e3),
            "final_error_believed_mm_median": scaled(median(self.believed_errors), 1e3),
            "final_yaw_deg_median": scaled(median(self.heading_errors), math.degrees(1.0)),
            "path_ratio_median": median(self.path_ratios),
            "sim_s_median": median(self.times),
            "local_tick_ms_median": scaled(median(self.ticks), 1e3),
            "local_tick_ms_p95": scaled(percentile(self.ticks, 95.0), 1e3),
            "real_time_factor": sum(self.times) / self.wall,
            "real_time_factor_of_processor": sum(self.times) / self.processor,
            "failures": self.failures,
        }


def problem(model: RobotModel, seed: int, boxes: int) -> tuple[World, WorldModel, Costmap, Pose2D]:
    """A kitchen with boxes on the way to a goal, and 8 cm on each side of the base beside them."""
    rng = np.random.default_rng([seed, 77])
    world = draw_world(load_scene("kitchen"), seed)
    start, error = world.robot_start, rng.uniform(-1.0, 1.0, 3) * [0.03, 0.03, 0.021]
    believed = Pose2D(start.x + error[0], start.y + error[1], start.theta + error[2])
    belief = WorldModel(semantic_map(world), base=BasePose(believed, 0.02, 0.012, 0.0))
    footprint = base_footprint(model)
    costmap = Costmap.from_map(belief.map, footprint)
    while True:
        goal = random_goal(costmap, rng)
        path = GridAStar().plan(start, goal, costmap)
        if not isinstance(path, Path2D) or path.length < 2.5:
            continue
        placed = [box_on(path, rng) for _ in range(boxes)]
        obstacles = [Obstacle(name=f"box{i}", shapes=(in_map(box),), stamp=0.0) for i, box in enumerate(placed)]
        with_boxes = Costmap.from_map(belief.map, footprint, obstacles)
        ends_free = min(with_boxes.clearance_at(start), with_boxes.clearance_at(goal)) > 0.15
        around = GridAStar().plan(start, goal, with_boxes)
        if ends_free and isinstance(around, Path2D) and room(around, with_boxes) > footprint.inscribed_radius + 0.08:
            return replace(world, furniture=(*world.furniture, *placed)), belief, costmap, goal


def room(path: Path2D, costmap: Costmap) -> float:
    """How far the middle of the base is from everything on a path."""
    pieces = [a + np.linspace(0.0, 1.0, 20)[:, None] * (b - a) for a, b in itertools.pairwise(path.points)]
    return float(costmap.distance_at(np.vstack(pieces)).min())


def random_goal(costmap: Costmap, rng: np.random.Generator) -> Pose2D:
    """A pose where the base can turn."""
    rows, columns = costmap.distance.shape
    while True:
        x, y = costmap.origin + rng.random(2) * np.array([columns, rows]) * costmap.resolution
        if costmap.distance_at([x, y]) > costmap.footprint.circumscribed_radius + 0.05:
            return Pose2D(float(x), float(y), float(rng.uniform(-math.pi, math.pi)))


def box_on(path: Path2D, rng: np.random.Generator) -> PlacedFurniture:
    """A box of 20 to 35 cm in the middle of a path, up to 15 cm beside it."""
    lengths = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(path.points, axis=0), axis=1)))
    at = rng.uniform(0.3, 0.75) * lengths[-1]
    x, y = (float(np.interp(at, lengths, path.points[:, axis])) + rng.uniform(-0.15, 0.15) for axis in (0, 1))
    side, deep = rng.uniform(0.2, 0.35, 2)
    part = PlacedShape(Box((float(side), float(deep), 0.5)), Pose(np.array([0.0, 0.0, 0.25])))
    name = f"box_{rng.integers(1 << 30)}"
    pose = Pose2D(x, y, float(rng.uniform(-math.pi, math.pi)))
    model = FurnitureModel(name, (float(side), float(deep)), (part,), ((0.7, 0.5, 0.3, 1.0),), ())
    return PlacedFurniture(name, model, pose, pose)


def in_map(box: PlacedFurniture) -> PlacedShape:
    part = box.model.parts[0]
    return PlacedShape(part.shape, box.actual.to_pose() @ part.pose)


def drive(model: RobotModel, planner: str, seed: int, boxes: int, monitored: bool, measured: Measurements) -> None:
    world, belief, costmap, goal = problem(model, seed, boxes)
    begin = time.perf_counter()
    begin_processor = time.process_time()
    with PyBulletRobot(model, world, seed=seed) as robot, timed_ticks(PLANNERS[planner], measured.ticks):
        truth = GroundTruth(robot)
        follower = PLANNERS[planner]()
        base_part = robot.part("base", MobileBase)
        lidar = LidarSensor(robot.part("lidar", Lidar), ForwardKinematics(model))
        monitor = CollisionMonitor(base_part.model, enabled=monitored)
        localizer = ScanToMap(belief.map)
        odometer = FusedOdometry(base_part, robot.clock, WheelOdometry())
        localisation = LocalisationCycle(robot.clock, lidar, localizer, odometer, belief)
        base = BaseController(base_part, localisation, follower, monitor=monitor)
        base.start()
        robot.clock.sleep(0.5)
        path = GridAStar().plan(belief.base.pose, goal, costmap)
        assert isinstance(path, Path2D)
        handle, started = base.follow(path, costmap), robot.clock.now()
        places = [truth.base_pose().to_pose2d()]
        while not handle.done and robot.clock.now() < started + TIME_LIMIT:
            robot.clock.sleep(0.1)
            places.append(truth.base_pose().to_pose2d())
        contacts = robot.audit_record().contacts
        measured.drives += 1
        measured.contacts += len(contacts)
        measured.times.append(robot.clock.now() - started)
        if handle.status is MotionStatus.SUCCEEDED:
            measured.reached += 1
            measured.position_errors.append(places[-1].distance_to(goal))
            measured.believed_errors.append(belief.base.pose.distance_to(goal))
            measured.heading_errors.append(abs(wrap_angle(places[-1].theta - goal.theta)))
            measured.path_ratios.append(sum(a.distance_to(b) for a, b in itertools.pairwise(places)) / path.length)
        else:
            measured.failures.append(f"seed {seed}: {handle.failure.text if handle.failure else 'out of time'}")
        measured.failures += [f"seed {seed}: {c.first} touched {c.second}, {c.peak_force:.0f} N" for c in contacts]
    measured.wall += time.perf_counter() - begin
    measured.processor += time.process_time() - begin_processor


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--planners", nargs="+", choices=list(PLANNERS), default=["dwa", "mppi"])
    parser.add_argument("--robot", default="diff_panda")
    parser.add_argument("--drives", type=int, default=20)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--boxes", type=int, default=2)
    parser.add_argument("--no-monitor", action="store_true", help="let every command through")
    parser.add_argument("--json", action="store_true", help="one JSON document instead of lines")
    arguments = parser.parse_args()
    model = load_robot_model(arguments.robot)
    found: dict[str, Any] = {"seed": arguments.seed, "robot": arguments.robot}
    for planner in arguments.planners:
        measured = Measurements()
        for seed in range(arguments.seed, arguments.seed + arguments.drives):
            drive(model, planner, seed, arguments.boxes, not arguments.no_monitor, measured)
            print(planner, seed, measured.summary(), file=sys.stderr, flush=True)
        found[planner] = measured.summary()
    print_report(found, arguments.json)


if __name__ == "__main__":
    main()
