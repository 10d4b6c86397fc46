"""Apartments mapped by exploration in physics, with wheels that slip; SLAM once more on the same readings."""

from __future__ import annotations

import sys
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from behaviours.navigation.explore import ExploreAndMap
from benchmarks.navigation_measures.judged_session import judged_session
from benchmarks.navigation_measures.slipping_wheels import let_slip
from benchmarks.navigation_measures.true_surfaces import TrueSurfaces
from bestman_bt.configuration.run import load_run
from bestman_bt.facts.goals.at_goal import true_costmap
from bestman_bt.manipulation.kinematics.link_hulls import ForwardKinematics
from bestman_bt.messages import LaserScan, Path2D, Pose2D
from bestman_bt.navigation.global_planning.base import GlobalPlanner, PlanningFailure
from bestman_bt.navigation.global_planning.costmap import Costmap
from bestman_bt.navigation.global_planning.grid_search import areas_of_disc
from bestman_bt.navigation.slam.base import SlamEstimate
from bestman_bt.navigation.slam.pose_graph_slam import PoseGraphSlam
from bestman_bt.runtime.executor import Executor
from bestman_bt.runtime.resolved_config import ResolvedConfig, prepare
from hal.api import Lidar

TIME_LIMIT = 900.0
"""Simulated seconds."""
PROGRESS = 20.0
"""Simulated seconds after which it is told how far it is."""


@dataclass(frozen=True)
class Reading:
    """What SLAM was given, with the truth at that moment."""

    odometry: Pose2D
    scan: LaserScan
    base_from_lidar: Pose2D
    true_pose: Pose2D


class RecordedSlam(PoseGraphSlam):
    """Notes what it is given; somebody tells it the truth to note beside that."""

    def __init__(self) -> None:
        super().__init__()
        self.readings: list[Reading] = []
        self.true_pose = Pose2D

    def add(self, odometry: Pose2D, scan: LaserScan, base_from_lidar: Pose2D) -> SlamEstimate:
        """See ``Slam.add``."""
        self.readings.append(Reading(odometry, scan, base_from_lidar, self.true_pose()))
        return super().add(odometry, scan, base_from_lidar)


class RecordedPlanner(GlobalPlanner):
    """Notes the paths of a planner, each with the costmap that it was found on."""

    def __init__(self, planner: GlobalPlanner) -> None:
        self._planner = planner
        self.plans: list[tuple[Costmap, Path2D]] = []

    def plan(self, start: Pose2D, goal: Pose2D, costmap: Costmap) -> Path2D | PlanningFailure:
        """See ``GlobalPlanner.plan``."""
        found = self._planner.plan(start, goal, costmap)
        if isinstance(found, Path2D):
            self.plans.append((costmap, found))
        return found


@dataclass
class Exploration:
    """``told``: the pose that the robot was told at the start. ``floor``: (N, 2) what it can truly get to."""

    seed: int
    succeeded: bool
    why: str
    sim_s: float
    wall_s: float
    processor_s: float
    contacts: list[str]
    readings: list[Reading]
    told: Pose2D
    slam: RecordedSlam
    surfaces: TrueSurfaces
    floor: NDArray[np.float64]
    plans: list[tuple[Costmap, Path2D]]


def apartment(seed: int, area: float, settings: list[str]) -> ResolvedConfig:
    """An apartment of ``area`` square metres, within 5 %, another for each seed."""
    about = f"scene.generator.apartment.area=[{0.95 * area:.1f} m², {1.05 * area:.1f} m²]"
    own = f"scene.generator.apartment.seed={seed}"
    return prepare(load_run("navigate_apartment", seed=seed, settings=[own, about, *settings]))


def explore(setup: ResolvedConfig, mean_slip: float) -> Exploration:
    """Drive until the robot says that nothing is left to see."""
    seed, slam = setup.config.seed, RecordedSlam()
    with judged_session(setup, lambda robot: let_slip(robot, mean_slip, seed)) as judged:
        slam.true_pose = lambda: judged.true_pose
        skills, robot = judged.session.skills, judged.robot
        planner = RecordedPlanner(skills.global_planning)
        skills.slam, skills.global_planning = slam, planner
        told = skills.world.base.pose
        tree = judged.session.load(ExploreAndMap(max_time=TIME_LIMIT))
        told_at = begin = robot.clock.now()

        def after_tick() -> None:
            nonlocal told_at
            if robot.clock.now() >= told_at + PROGRESS:
                told_at = robot.clock.now()
                text = f"seed {seed}: {told_at - begin:.0f} s, {len(slam.trajectory.stamps)} keyframes"
                print(text, file=sys.stderr, flush=True)

        limit = TIME_LIMIT + 60.0
        execution = Executor(tree, robot.clock, period=0.05, time_limit=limit, after_tick=after_tick).run()
        lidar = robot.part("lidar", Lidar)
        height = float(ForwardKinematics(setup.robot_model).pose(lidar.frame, {}).position[2])
        told_by_skills = [f"{failure.error_code}: {failure.why}" for failure in skills.failures]
        contacts = [str(contact) for contact in robot.audit_record().contacts]
    return Exploration(
        seed=seed,
        succeeded=execution.succeeded,
        why="" if execution.succeeded else f"{execution.ending}: {execution.why}; {'; '.join(told_by_skills)}",
        sim_s=judged.simulated,
        wall_s=judged.wall,
        processor_s=judged.processor,
        contacts=contacts,
        readings=slam.readings,
        told=told,
        slam=slam,
        surfaces=TrueSurfaces(setup.world, height),
        floor=reachable_floor(setup),
        plans=planner.plans,
    )


def reachable_floor(setup: ResolvedConfig) -> NDArray[np.float64]:
    """(N, 2) centres of the cells that the middle of the base can truly get to, turning as it likes."""
    costmap = true_costmap(setup.world, setup.robot_model)
    areas = areas_of_disc(costmap, costmap.footprint.circumscribed_radius)
    start = np.argwhere(areas > 0)
    nearest = np.linalg.norm(costmap.grid_points(start) - setup.world.robot_start.xy, axis=1).argmin()
    return costmap.grid_points(np.argwhere(areas == areas[tuple(start[nearest])]))


def again(run: Exploration, loop_closure: bool) -> PoseGraphSlam:
    """SLAM on the same readings once more."""
    slam = PoseGraphSlam(loop_closure=loop_closure)
    slam.reset(run.told, run.readings[0].odometry)
    for reading in run.readings:
        slam.add(reading.odometry, reading.scan, reading.base_from_lidar)
    return slam
