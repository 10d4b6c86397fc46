"""Self-test of a robot: compose it, load it, check that it stands still, and move its arms."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import cast

import numpy as np
from numpy.typing import NDArray

from bestman_bt.extras import DEFAULT_SIMULATOR
from bestman_bt.manipulation.collision.base import CollisionWorld
from bestman_bt.manipulation.collision.coal_world import CoalCollisionModel
from bestman_bt.manipulation.collision.planning_scene import PlanningScene
from bestman_bt.messages import Pose2D
from bestman_bt.registry import DRIVERS
from bestman_bt.robot_model.model import ArmModel, GripperModel, RobotModel
from bestman_bt.robot_model.payload import payload
from bestman_bt.scene.scene import Wall, World
from hal.api import Arm, MotionStatus
from hal.simulation.ground_truth import GroundTruth
from hal.simulation.robot import SimulatedRobot

Array = NDArray[np.float64]


@dataclass(frozen=True)
class TrialProcedure:
    """Tests a robot: it has to stand still, and to move its arms to some postures.

    ``standing``: seconds. ``postures``: number of postures. ``swing``: largest joint motion from home, radians;
    ``step``: between checked configurations, radians. ``draws``: random postures to try. ``speed``: scale of the joint
    speed.
    """

    standing: float = 5.0
    postures: int = 3
    swing: float = 1.2
    step: float = 0.05
    draws: int = 300
    speed: float = 0.6

    def run(self, compose: Callable[[], RobotModel], seed: int) -> SelfTest:
        """Test the robot that ``compose`` returns, alone on a floor; postures are random, from ``seed``.

        ``compose`` is called once to import modules, then the shortest of five calls counts (as ``timeit`` advises).
        """
        model = compose()
        seconds = []
        for _ in range(5):
            began = time.process_time()
            compose()
            seconds.append(time.process_time() - began)
        composed = min(seconds)
        simulated: type[SimulatedRobot] = DRIVERS.resolve(DEFAULT_SIMULATOR)
        robot = simulated(model, _floor(), seed=seed)
        began = time.process_time()
        robot.connect()
        loaded = time.process_time() - began
        try:
            truth = GroundTruth(robot)
            start = truth.base_pose()
            robot.clock.sleep(self.standing)
            drift = math.dist(truth.base_pose().position, start.position)
            reached = 0
            touching: set[tuple[str, str]] = set()
            for name, arm in model.of(ArmModel).items():
                hands = _hands(model)
                world = CoalCollisionModel(model).world(
                    PlanningScene(positions=hands, self_padding=0.0, other_arm_padding=0.0), name
                )
                part, rng = cast(Arm, robot.parts[name]), np.random.default_rng(seed)
                for target in _postures(arm, world, part.positions(), self, rng):
                    motion = part.move_to(target, self.speed)
                    while not motion.done:
                        robot.clock.sleep(0.05)
                        touching.update(world.colliding_pairs(np.clip(part.positions(), arm.lower, arm.upper)))
                    reached += motion.status is MotionStatus.SUCCEEDED
            after = math.dist(truth.base_pose().position, start.position)
        finally:
            robot.disconnect()
        asked = self.postures * len(model.of(ArmModel))
        mass = payload(model, model.base_frame).mass
        return SelfTest(composed, loaded, mass, drift, after, reached, asked, tuple(sorted(touching)))


@dataclass(frozen=True)
class SelfTest:
    """Times are processor seconds. ``drift``: of the standing base, ``after``: after the arm motions, metres.

    ``reached``: number of postures that the arms reached, of ``asked``. ``touching``: links that collided during the
    motions.
    """

    composed: float
    loaded: float
    mass: float
    drift: float
    after: float
    reached: int
    asked: int
    touching: tuple[tuple[str, str], ...]

    @property
    def quick(self) -> bool:
        """Whether the robot was composed within 50 ms and loaded within 1 s; a busy machine may be slower."""
        return self.composed <= 0.05 and self.loaded <= 1.0

    @property
    def sound(self) -> bool:
        """Whether the base drifted by at most 5 mm and the arms reached all postures without collision."""
        return self.drift <= 0.005 and self.reached == self.asked and not self.touching

    @property
    def passed(self) -> bool:
        """Whether the robot is both ``quick`` and ``sound``."""
        return self.quick and self.sound


def _postures(
    arm: ArmModel, world: CollisionWorld, start: Array, procedure: TrialProcedure, rng: np.random.Generator
) -> Iterator[Array]:
    """Yield joint positions (n,) to which a straight line in joint space leads from the previous ones without a
    collision.
    """
    home, here, found = start, start, 0
    for _ in range(procedure.draws):
        if found == procedure.postures:
            return
        target = np.clip(home + rng.uniform(-procedure.swing, procedure.swing, len(home)), arm.lower, arm.upper)
        steps = max(2, math.ceil(float(np.abs(target - here).max()) / procedure.step))
        if all(world.is_free(here + share * (target - here)) for share in np.linspace(0.0, 1.0, steps)):
            yield target
            here, found = target, found + 1


def _hands(model: RobotModel) -> dict[str, float]:
    return {
        joint: position
        for gripper in model.of(GripperModel).values()
        for joint, position in gripper.joint_positions(gripper.max_width).items()
    }


def _floor() -> World:
    corners = ((-3.0, -3.0), (3.0, -3.0), (3.0, 3.0), (-3.0, 3.0))
    walls = tuple(Wall(a, b, 1.2, 0.1) for a, b in zip(corners, corners[1:] + corners[:1], strict=True))
    return World("floor", 0, walls, (), (), Pose2D(0.0, 0.0, 0.0), {})
