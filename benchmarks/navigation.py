"""Drives to random goals in the kitchen and measures planning, following and localisation.

Run it with ``python benchmarks/navigation.py [--goals N] [--seed S] [--json]``; keys and units are those of
docs/navigation.md. All poses that count as truth come from the simulator, and only this program sees them.
"""

from __future__ import annotations

import argparse
import json
import math
import time
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from bestman_bt.control import ControlStatus
from bestman_bt.control.wheeled import BaseController
from bestman_bt.manipulation.kinematics import ForwardKinematics
from bestman_bt.messages import Path2D, Pose2D, Twist2D, wrap_angle
from bestman_bt.navigation.global_planning import Costmap, Footprint, GridAStar
from bestman_bt.navigation.local_planning import FollowerCommand, PurePursuit
from bestman_bt.navigation.localization import ScanToMap
from bestman_bt.robot_model import load_robot_model
from bestman_bt.scene import draw_world, load_scene, semantic_map
from bestman_bt.sensing.lidar import LidarSensor
from bestman_bt.world_model import BasePose, WorldModel
from hal.api import Lidar, MobileBase
from hal.pybullet import GroundTruth, PyBulletRobot

GOALS_PER_WORLD = 5


class TimedPurePursuit(PurePursuit):
    """Pure pursuit that notes how long every step takes, seconds."""

    def __init__(self) -> None:
        super().__init__()
        self.times: list[float] = []

    def compute(self, pose: Pose2D, velocity: Twist2D, dt: float) -> FollowerCommand:
        begin = time.perf_counter()
        command = super().compute(pose, velocity, dt)
        self.times.append(time.perf_counter() - begin)
        return command


@dataclass
class Measurements:
    goals: int = 0
    reached: int = 0
    contacts: int = 0
    position_errors: list[float] = field(default_factory=list)
    heading_errors: list[float] = field(default_factory=list)
    localisation_errors: list[float] = field(default_factory=list)
    plan_times: list[float] = field(default_factory=list)
    tick_times: list[float] = field(default_factory=list)
    simulated: float = 0.0
    wall: float = 0.0

    def summary(self, seed: int) -> dict[str, Any]:
        return {
            "seed": seed,
            "goals": self.goals,
            "reached_rate": self.reached / self.goals,
            "contacts": self.contacts,
            "final_error_mm_median": 1e3 * float(np.median(self.position_errors)),
            "final_error_mm_max": 1e3 * float(np.max(self.position_errors)),
            "final_yaw_deg_median": math.degrees(float(np.median(self.heading_errors))),
            "localisation_error_mm_mean": 1e3 * float(np.mean(self.localisation_errors)),
            "localisation_error_mm_p95": 1e3 * float(np.percentile(self.localisation_errors, 95)),
            "plan_ms_median": 1e3 * float(np.median(self.plan_times)),
            "local_tick_ms_p95": 1e3 * float(np.percentile(self.tick_times, 95)),
            "real_time_factor": self.simulated / self.wall,
        }


def random_goal(costmap: Costmap, rng: np.random.Generator) -> Pose2D:
    """A pose where the base can turn."""
    x_min, y_min = costmap.origin
    rows, columns = costmap.distance.shape
    size = np.array([columns, rows]) * costmap.resolution
    while True:
        x, y = costmap.origin + rng.random(2) * size
        inside = x_min + 1.0 < x < x_min + size[0] - 1.0 and y_min + 1.0 < y < y_min + size[1] - 1.0
        if inside and costmap.distance_at([x, y]) > costmap.footprint.circumscribed_radius + 0.05:
            return Pose2D(float(x), float(y), float(rng.uniform(-math.pi, math.pi)))


def stand_pose(belief: WorldModel, name: str, rng: np.random.Generator) -> Pose2D:
    """6 cm before a piece of furniture, somewhere along its front."""
    piece = belief.map.furniture[name]
    along = rng.uniform(-0.3, 0.3)
    return piece.pose @ Pose2D(-piece.footprint[0] / 2 - 0.28 - 0.06, along, 0.0)


def drive_one_world(seed: int, goals: int, measured: Measurements) -> None:
    model = load_robot_model("diff_panda")
    world = draw_world(load_scene("kitchen"), seed)
    rng = np.random.default_rng(seed)
    with PyBulletRobot(model, world, seed=seed) as robot:
        truth = GroundTruth(robot)
        error = rng.uniform(-1.0, 1.0, 3) * [0.03, 0.03, 0.021]
        start = world.robot_start
        believed = Pose2D(start.x + error[0], start.y + error[1], start.theta + error[2])
        belief = WorldModel(semantic_map(world), base=BasePose(believed, 0.02, 0.012, 0.0))
        follower = TimedPurePursuit()
        lidar = LidarSensor(robot.part("lidar", Lidar), ForwardKinematics(model))
        base_part = robot.part("base", MobileBase)
        base = BaseController(base_part, robot.clock, lidar, ScanToMap(belief.map), follower, belief)
        costmap = Costmap.from_map(belief.map, Footprint(np.array(base.description.footprint)))
        base.start()
        robot.clock.sleep(0.5)
        begin_wall, begin_simulated = time.perf_counter(), robot.clock.now()
        for number in range(goals):
            choice = ("table", None, "counter", None)[number % 4]
            goal = random_goal(costmap, rng) if choice is None else stand_pose(belief, choice, rng)
            measured.goals += 1
            begin = time.perf_counter()
            path = GridAStar().plan(belief.base.pose, goal, costmap)
            measured.plan_times.append(time.perf_counter() - begin)
            if not isinstance(path, Path2D):
                continue
            handle = base.follow(path)
            while not handle.done:
                robot.clock.sleep(0.1)
                true_pose = truth.base_pose().to_pose2d()
                measured.localisation_errors.append(belief.base.pose.distance_to(true_pose))
            true_pose = truth.base_pose().to_pose2d()
            measured.reached += handle.status is ControlStatus.SUCCEEDED
            measured.position_errors.append(true_pose.distance_to(goal))
            measured.heading_errors.append(abs(wrap_angle(true_pose.theta - goal.theta)))
        measured.wall += time.perf_counter() - begin_wall
        measured.simulated += robot.clock.now() - begin_simulated
        measured.contacts += len(robot.honesty_record().contacts)
        measured.tick_times += follower.times


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--goals", type=int, default=20)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--json", action="store_true", help="one JSON document instead of lines")
    arguments = parser.parse_args()
    measured = Measurements()
    seed = arguments.seed
    while measured.goals < arguments.goals:
        drive_one_world(seed, min(GOALS_PER_WORLD, arguments.goals - measured.goals), measured)
        seed += 1
    summary = measured.summary(arguments.seed)
    if arguments.json:
        print(json.dumps(summary))
    else:
        for key, value in summary.items():
            print(f"{key:28} {value:.3f}" if isinstance(value, float) else f"{key:28} {value}")


if __name__ == "__main__":
    main()
