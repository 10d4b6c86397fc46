"""How well the base knows where it is, with slipping wheels and a noisy lidar, and whether it finds itself.

A kidnapped robot is not moved: it starts with a belief that is wrong, elsewhere on the map, and as sure of it as ever.
"""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from benchmarks.navigation_measures.judged_session import judged_session
from benchmarks.navigation_measures.report import mean, median, percentile, scaled
from benchmarks.navigation_measures.slipping_wheels import let_slip
from bestman_bt.configuration.run import load_run
from bestman_bt.evaluation.interval import wilson_interval
from bestman_bt.facts.goals.at_goal import base_footprint
from bestman_bt.messages import Pose2D, wrap_angle
from bestman_bt.navigation.global_planning.costmap import Costmap
from bestman_bt.navigation.localization.correlative_search import DistanceField
from bestman_bt.runtime.resolved_config import START_HEADING_ERROR, START_POSITION_ERROR, ResolvedConfig, prepare
from bestman_bt.world_model.world_model import BasePose

LOCALIZER = "scan_to_map"
LIDAR_NOISE = 0.02
MEAN_SLIP = 0.10
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


@dataclass
class KnowingWhere:
    """Of all drives and kidnaps; errors in metres and radians, at every tick of a drive."""

    errors: list[float] = field(default_factory=list)
    heading_errors: list[float] = field(default_factory=list)
    reached: int = 0
    drives: int = 0
    kidnaps: int = 0
    recovered: int = 0
    recovery_times: list[float] = field(default_factory=list)
    failures: list[str] = field(default_factory=list)
    contacts: int = 0
    simulated: float = 0.0
    wall: float = 0.0
    processor: float = 0.0

    def summary(self, seed: int, localizer: str = LOCALIZER) -> dict[str, Any]:
        """The figures, for JSON."""
        low, high = wilson_interval(self.recovered, self.kidnaps)
        return {
            "seed": seed,
            "localizer": localizer,
            "drives": self.drives,
            "reached_rate": self.reached / max(self.drives, 1),
            "localisation_error_mm_mean": scaled(mean(self.errors), 1e3),
            "localisation_error_mm_p95": scaled(percentile(self.errors, 95.0), 1e3),
            "localisation_error_deg_mean": scaled(mean(self.heading_errors), math.degrees(1.0)),
            "kidnaps": self.kidnaps,
            "kidnap_recovered_rate": self.recovered / max(self.kidnaps, 1),
            "kidnap_recovered_interval": [low, high],
            "kidnap_recovery_s_median": median(self.recovery_times),
            "contacts": self.contacts,
            "real_time_factor": self.simulated / self.wall,
            "real_time_factor_of_processor": self.simulated / self.processor,
            "failures": self.failures,
        }


@dataclass(frozen=True)
class Ran:
    """``trace``: at every tick the time, s, and the errors of belief, m and rad. ``told``: by skills that failed."""

    reached: bool
    trace: list[tuple[float, float, float]]
    told: list[str]


def measure(
    seed: int, episodes: int, localizer: str = LOCALIZER, of: tuple[str, ...] = ("track", "kidnap")
) -> KnowingWhere:
    """So many drives and kidnaps from ``seed`` on; every other one is in the kitchen, the others in apartments."""
    found = KnowingWhere()
    for one in range(seed, seed + episodes):
        if "track" in of:
            track(one, localizer, found)
        if "kidnap" in of:
            kidnap(one, localizer, found)
        so_far = (
            f"{found.recovered} of {found.kidnaps} recovered, mean error {1e3 * (mean(found.errors) or 0.0):.1f} mm"
        )
        print(f"seed {one}: {so_far}", file=sys.stderr, flush=True)
    return found


def track(seed: int, localizer: str, found: KnowingWhere) -> None:
    """One drive from a pose that is known as well as at any start."""
    setup, rng = _prepared(seed, localizer, 60.0)
    start, error = setup.world.robot_start, rng.uniform(-1.0, 1.0, 3)
    about = Pose2D(
        start.x + START_POSITION_ERROR * error[0],
        start.y + START_POSITION_ERROR * error[1],
        start.theta + START_HEADING_ERROR * error[2],
    )
    ran = _run(_told(setup, about), somewhere(setup, rng), found)
    found.drives += 1
    found.reached += ran.reached
    found.errors += [position for _, position, _ in ran.trace]
    found.heading_errors += [heading for _, _, heading in ran.trace]
    if not ran.reached:
        found.failures.append(f"seed {seed}, drive: {'; '.join(ran.told)}")


def kidnap(seed: int, localizer: str, found: KnowingWhere) -> None:
    """One drive from a pose that is believed and wrong."""
    setup, rng = _prepared(seed, localizer, RECOVERED_WITHIN + 2.0)
    wrong = somewhere(setup, rng)
    while wrong.distance_to(setup.world.robot_start) < 1.0:
        wrong = somewhere(setup, rng)
    ran = _run(_told(setup, wrong), somewhere(setup, rng), found)
    astray = [now for now, position, heading in ran.trace if position > RECOVERED[0] or heading > RECOVERED[1]]
    since = astray[-1] if astray else 0.0
    found.kidnaps += 1
    if since < min(RECOVERED_WITHIN, ran.trace[-1][0]):
        found.recovered += 1
        found.recovery_times.append(since)
    else:
        found.failures.append(f"seed {seed}, kidnap: {'; '.join(ran.told) or 'nothing was noticed'}")


def somewhere(setup: ResolvedConfig, rng: np.random.Generator) -> Pose2D:
    """A pose in the building where the base can turn."""
    costmap = Costmap.from_map(setup.world_model.map, base_footprint(setup.robot_model))
    floor = DistanceField.of_map(setup.world_model.map)
    while True:
        x, y, theta = floor.draw(1, rng)[0].tolist()
        if costmap.distance_at([x, y]) > costmap.footprint.circumscribed_radius + 0.1:
            return Pose2D(x, y, theta)


def _prepared(seed: int, localizer: str, time_limit: float) -> tuple[ResolvedConfig, np.random.Generator]:
    """A robot somewhere in a kitchen or an apartment."""
    scene = ("kitchen", "apartment")[seed % 2]
    settings = [f"robot.parts.lidar.set.noise={LIDAR_NOISE} m", f"time_limit={time_limit} s"]
    settings += [f"algorithms.localization.algorithm={localizer}"]
    setup = prepare(load_run("navigate_kitchen", scene=scene, seed=seed, settings=settings))
    rng = np.random.default_rng(seed)
    start = somewhere(setup, rng)
    return replace(setup, world=replace(setup.world, robot_start=start)), rng


def _told(setup: ResolvedConfig, pose: Pose2D) -> ResolvedConfig:
    """The robot believes to be at ``pose``."""
    believed = BasePose(pose, START_POSITION_ERROR, START_HEADING_ERROR, 0.0)
    return replace(setup, world_model=replace(setup.world_model, base=believed))


def _run(setup: ResolvedConfig, goal: Pose2D, found: KnowingWhere) -> Ran:
    """Drive to ``goal`` with wheels that slip."""
    trace: list[tuple[float, float, float]] = []
    with judged_session(setup, lambda robot: let_slip(robot, MEAN_SLIP, setup.config.seed)) as judged:
        clock, world = judged.robot.clock, judged.session.skills.world
        begin = clock.now()

        def look() -> None:
            truth, believed = judged.true_pose, world.base.pose
            turned = abs(wrap_angle(believed.theta - truth.theta))
            trace.append((clock.now() - begin, believed.distance_to(truth), turned))

        execution = judged.session.run(DRIVE.replace("{goal}", f"{goal.x};{goal.y};{goal.theta}"), look)
        look()
        found.contacts += len(judged.robot.audit_record().contacts)
        told = [f"{failure.error_code}: {failure.why}" for failure in judged.session.skills.failures]
    found.simulated += judged.simulated
    found.wall += judged.wall
    found.processor += judged.processor
    return Ran(execution.tree_status == "SUCCESS", trace, told)
