"""Measures how well the base knows where it is, with slipping wheels and a noisy lidar, and whether it finds itself.

Run it with ``python benchmarks/localisation.py [--episodes N] [--seed S] [--localizer NAME] [--json]``; the keys are
those of docs/localisation.md. Every other episode is in the kitchen, the others each in an apartment of its own. All
poses that count as truth come from the simulator, and only this program sees them.

A kidnapped robot is not moved: it starts with a belief that is wrong, elsewhere on the map, and as sure of it as ever.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from bestman_bt.configuration import load_run
from bestman_bt.evaluation.interval import wilson_interval
from bestman_bt.messages import Pose2D, wrap_angle
from bestman_bt.navigation.global_planning import Costmap, Footprint
from bestman_bt.navigation.localization import DistanceField
from bestman_bt.runtime import open_session
from bestman_bt.runtime.setup import START_HEADING_ERROR, START_POSITION_ERROR, Setup, prepare
from bestman_bt.world_model import BasePose
from hal.api import MobileBase, Robot
from hal.pybullet import GroundTruth, PyBulletRobot

LIDAR_NOISE = 0.02
MEAN_SLIP = 0.10
SLIP_CHANGES = 0.5
"""Seconds after which each wheel slips anew, by up to twice the mean."""
RECOVERED = (0.10, math.radians(6.0))
RECOVERED_WITHIN = 20.0
DRIVE = """
<root BTCPP_format="4" main_tree_to_execute="Drive">
  <BehaviorTree ID="Drive">
    <Fallback>
      <NavigateTo goal="{goal}"/>
      <Sequence>
        <Relocalise/>
        <NavigateTo goal="{goal}"/>
      </Sequence>
    </Fallback>
  </BehaviorTree>
</root>
"""


class SlippingWheels:
    """Odometry of two wheels that each turn further than they drive, by a share that changes all the time."""

    def __init__(self, base: MobileBase, now: Callable[[], float], seed: int) -> None:
        corners = np.array(base.description.footprint)
        self._track = float(np.ptp(corners[:, 1]))
        self._counted, self._now = base.odometry, now
        self._rng = np.random.default_rng([seed, 7])
        self._last, self._pose = self._counted(), Pose2D()
        self._slip, self._until = np.zeros(2), 0.0

    def odometry(self) -> Pose2D:
        if self._now() >= self._until:
            self._slip, self._until = self._rng.uniform(0.0, 2.0 * MEAN_SLIP, 2), self._now() + SLIP_CHANGES
        pose = self._counted()
        moved, self._last = self._last.inverse() @ pose, pose
        turn = moved.theta * self._track / 2.0
        left, right = np.array([moved.x - turn, moved.x + turn]) / (1.0 - self._slip)
        self._pose = self._pose @ Pose2D(float(left + right) / 2.0, moved.y, float(right - left) / self._track)
        return self._pose


@dataclass
class Measurements:
    errors: list[float] = field(default_factory=list)
    heading_errors: list[float] = field(default_factory=list)
    reached: int = 0
    drives: int = 0
    kidnaps: int = 0
    recovered: int = 0
    recovery_times: list[float] = field(default_factory=list)
    contacts: int = 0
    simulated: float = 0.0
    wall: float = 0.0

    def summary(self, seed: int, localizer: str) -> dict[str, Any]:
        low, high = wilson_interval(self.recovered, self.kidnaps)
        return {
            "seed": seed,
            "localizer": localizer,
            "drives": self.drives,
            "reached_rate": self.reached / max(self.drives, 1),
            "localisation_error_mm_mean": 1e3 * float(np.mean(self.errors)),
            "localisation_error_mm_p95": 1e3 * float(np.percentile(self.errors, 95)),
            "localisation_error_deg_mean": math.degrees(float(np.mean(self.heading_errors))),
            "kidnaps": self.kidnaps,
            "kidnap_recovered_rate": self.recovered / max(self.kidnaps, 1),
            "kidnap_recovered_interval": [low, high],
            "kidnap_recovery_s_median": float(np.median(self.recovery_times)) if self.recovery_times else None,
            "contacts": self.contacts,
            "real_time_factor": self.simulated / self.wall,
        }


def somewhere(setup: Setup, rng: np.random.Generator) -> Pose2D:
    """A pose in the building where the base can turn."""
    corners = np.array(next(iter(setup.robot_model.bases.values())).footprint)
    costmap = Costmap.from_map(setup.world_model.map, Footprint(corners))
    floor = DistanceField.of_map(setup.world_model.map)
    while True:
        x, y, theta = floor.draw(1, rng)[0].tolist()
        if costmap.distance_at([x, y]) > costmap.footprint.circumscribed_radius + 0.1:
            return Pose2D(x, y, theta)


def run(setup: Setup, goal: Pose2D, measured: Measurements) -> tuple[bool, list[tuple[float, float, float]]]:
    """Drive to ``goal``; whether it is believed to be reached, and at every tick the time and the errors of belief."""
    truths: list[GroundTruth] = []
    trace: list[tuple[float, float, float]] = []

    def behind(robot: Robot) -> None:
        assert isinstance(robot, PyBulletRobot)
        truths.append(GroundTruth(robot))
        base = robot.part("base", MobileBase)
        base.odometry = SlippingWheels(base, robot.clock.now, setup.config.seed).odometry

    with open_session(setup, behind) as session:
        clock, world = session.robot.clock, session.skills.world
        begin, wall = clock.now(), time.perf_counter()

        def look() -> None:
            truth, believed = truths[0].base_pose().to_pose2d(), world.base.pose
            turned = abs(wrap_angle(believed.theta - truth.theta))
            trace.append((clock.now() - begin, believed.distance_to(truth), turned))

        execution = session.run(DRIVE.replace("{goal}", f"{goal.x};{goal.y};{goal.theta}"), look)
        look()
        measured.contacts += len(session.robot.honesty_record().contacts)
        measured.simulated += clock.now() - begin
        measured.wall += time.perf_counter() - wall
    return execution.tree_status == "SUCCESS", trace


def prepared(seed: int, localizer: str, time_limit: float) -> tuple[Setup, np.random.Generator]:
    """A robot somewhere in a kitchen or an apartment."""
    scene = ("kitchen", "apartment")[seed % 2]
    settings = [f"robot.parts.lidar.set.noise={LIDAR_NOISE} m", f"time_limit={time_limit} s"]
    settings += [f"algorithms.localization.algorithm={localizer}"]
    setup = prepare(load_run("navigate_kitchen", scene=scene, seed=seed, settings=settings))
    rng = np.random.default_rng(seed)
    start = somewhere(setup, rng)
    return replace(setup, world=replace(setup.world, robot_start=start)), rng


def told(setup: Setup, pose: Pose2D) -> Setup:
    """The robot believes to be at ``pose``."""
    believed = BasePose(pose, START_POSITION_ERROR, START_HEADING_ERROR, 0.0)
    return replace(setup, world_model=replace(setup.world_model, base=believed))


def track(seed: int, localizer: str, measured: Measurements) -> None:
    setup, rng = prepared(seed, localizer, 60.0)
    start, error = setup.world.robot_start, rng.uniform(-1.0, 1.0, 3)
    about = Pose2D(
        start.x + START_POSITION_ERROR * error[0],
        start.y + START_POSITION_ERROR * error[1],
        start.theta + START_HEADING_ERROR * error[2],
    )
    reached, trace = run(told(setup, about), somewhere(setup, rng), measured)
    measured.drives += 1
    measured.reached += reached
    measured.errors += [position for _, position, _ in trace]
    measured.heading_errors += [heading for _, _, heading in trace]


def kidnap(seed: int, localizer: str, measured: Measurements) -> None:
    setup, rng = prepared(seed, localizer, RECOVERED_WITHIN + 2.0)
    wrong = somewhere(setup, rng)
    while wrong.distance_to(setup.world.robot_start) < 1.0:
        wrong = somewhere(setup, rng)
    _, trace = run(told(setup, wrong), somewhere(setup, rng), measured)
    astray = [now for now, position, heading in trace if position > RECOVERED[0] or heading > RECOVERED[1]]
    since = astray[-1] if astray else 0.0
    measured.kidnaps += 1
    if since < min(RECOVERED_WITHIN, trace[-1][0]):
        measured.recovered += 1
        measured.recovery_times.append(since)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--episodes", type=int, default=20, help="drives, and as many kidnaps")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--localizer", default="scan_to_map")
    parser.add_argument("--json", action="store_true", help="one JSON document instead of lines")
    arguments = parser.parse_args()
    measured = Measurements()
    for seed in range(arguments.seed, arguments.seed + arguments.episodes):
        track(seed, arguments.localizer, measured)
        kidnap(seed, arguments.localizer, measured)
        so_far = f"{measured.recovered} of {measured.kidnaps} recovered, {1e3 * np.mean(measured.errors):.1f} mm"
        print(f"seed {seed}: {so_far}", file=sys.stderr, flush=True)
    summary = measured.summary(arguments.seed, arguments.localizer)
    if arguments.json:
        print(json.dumps(summary))
    else:
        for key, value in summary.items():
            print(f"{key:28} {value:.3f}" if isinstance(value, float) else f"{key:28} {value}")


if __name__ == "__main__":
    main()
