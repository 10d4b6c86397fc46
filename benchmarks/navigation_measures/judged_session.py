"""A session with the truth beside it: poses from the simulator, which only the benchmark sees."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from bestman_bt.messages import Pose2D
from bestman_bt.runtime.resolved_config import ResolvedConfig
from bestman_bt.runtime.robot_session import RobotSession, open_session
from hal.api import Robot
from hal.pybullet.robot import PyBulletRobot
from hal.simulation.ground_truth import GroundTruth


@dataclass
class JudgedSession:
    """``simulated``, ``wall``, ``processor``: seconds that it has taken, once it is over."""

    session: RobotSession
    robot: PyBulletRobot
    truth: GroundTruth
    simulated: float = 0.0
    wall: float = 0.0
    processor: float = 0.0

    @property
    def true_pose(self) -> Pose2D:
        """Of the base, in the map frame."""
        return self.truth.base_pose().to_pose2d()


@contextmanager
def judged_session(
    setup: ResolvedConfig, before: Callable[[Robot], None] = lambda robot: None
) -> Iterator[JudgedSession]:
    """Open a session; ``before`` is shown the robot before anything is started."""
    held: list[tuple[PyBulletRobot, GroundTruth]] = []

    def hold(robot: Robot) -> None:
        assert isinstance(robot, PyBulletRobot)
        held.append((robot, GroundTruth(robot)))
        before(robot)

    with open_session(setup, hold) as session:
        judged = JudgedSession(session, *held[0])
        begin, wall, processor = judged.robot.clock.now(), time.perf_counter(), time.process_time()
        yield judged
        judged.simulated = judged.robot.clock.now() - begin
        judged.wall = time.perf_counter() - wall
        judged.processor = time.process_time() - processor
