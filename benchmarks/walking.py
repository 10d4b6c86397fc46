"""The walking base over seeds: 3 m straight ahead and a quarter turn, by its own odometry, judged by the truth.

``python benchmarks/walking.py --seeds 7000:7010``; each seed draws the feet's friction, the start and
the noise of the inertial unit. ``--film FILE.png`` draws one row of pictures of the first seed's walk.
"""

from __future__ import annotations

import argparse
import dataclasses
import math
import os
import sys
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).parents[1]))

import numpy as np
from PIL import Image

from bestman_bt.messages import Pose2D, wrap_angle
from bestman_bt.robot_model.compose import load_robot_model
from bestman_bt.scene.scene import World
from hal.api import MobileBase, MotionStatus
from hal.pybullet.robot import PyBulletRobot
from hal.simulation.bodies import Viewpoint
from hal.simulation.camera import ScenePhotographer
from hal.simulation.ground_truth import GroundTruth

DISTANCE, TURN = 3.0, math.pi / 2
FRICTION = (0.5, 1.0)
FALLEN = 0.12
"""Metres by which the trunk is lower than when it stands."""


@dataclasses.dataclass(frozen=True)
class Walk:
    """Errors against the truth: metres, degrees. ``odometry``: its share of the way that it was off at the end."""

    seed: int
    friction: float
    length: float
    sideways: float
    heading: float
    turn: float
    odometry: float
    seconds: float
    upright: bool
    clean: bool

    @property
    def good(self) -> bool:
        """Arrived upright, within 5 % of the way, 5 % sideways and 5 degrees of both headings."""
        near = abs(self.length - DISTANCE) <= 0.05 * DISTANCE and abs(self.sideways) <= 0.05 * DISTANCE
        return self.upright and self.clean and near and abs(self.heading) <= 5.0 and abs(self.turn) <= 5.0


def walk(seed: int, film: Path | None = None) -> Walk:
    rng = np.random.default_rng([seed, 5])
    friction = float(rng.uniform(*FRICTION))
    model = load_robot_model("a1", {"parts.base.set": {"foot_friction": friction}})
    start = Pose2D(*rng.uniform(-0.5, 0.5, 2), rng.uniform(-math.pi, math.pi))
    pictures: list[np.ndarray] = []
    with PyBulletRobot(model, World("floor", seed, (), (), (), start, {}), seed=seed) as robot:
        truth, base = GroundTruth(robot), robot.part("base", MobileBase)
        camera = ScenePhotographer(robot) if film else None
        robot.clock.sleep(1.0)
        begin, lowest, began = truth.base_pose(), 0.0, robot.clock.now()
        for command, argument in ((base.move_forward, DISTANCE), (base.rotate, TURN)):
            motion = command(argument)
            while not motion.done:
                robot.clock.sleep(0.05)
                lowest = min(lowest, float(truth.base_pose().position[2] - begin.position[2]))
                if camera is not None and robot.clock.now() - began > 1.1 * len(pictures):
                    at = truth.base_pose().apply(np.array([[0.0, 0.0, 0.15]]))[0]
                    beside = at + begin.rotation @ np.array([0.4, -1.0, 0.25])  # of the way that it set out on
                    view = Viewpoint(tuple(beside.tolist()), tuple(at.tolist()), 45.0)
                    pictures.append(camera.picture(view, 240, 200))
            robot.clock.sleep(0.5)
            if command == base.move_forward:
                straight, said = begin.inverse() @ truth.base_pose(), base.odometry()
                took = robot.clock.now() - began
            arrived = motion.status is MotionStatus.SUCCEEDED
            if not arrived:
                break
        end = begin.inverse() @ truth.base_pose()
        record = robot.audit_record()
    if film is not None:
        Image.fromarray(np.hstack(pictures)).save(film)
    x, y, _ = straight.position
    return Walk(
        seed=seed,
        friction=friction,
        length=float(x),
        sideways=float(y),
        heading=math.degrees(straight.yaw),
        turn=math.degrees(wrap_angle(end.yaw - straight.yaw - TURN)),
        odometry=math.dist((x, y), (said.x, said.y)) / DISTANCE,
        seconds=took,
        upright=arrived and lowest > -FALLEN,
        clean=not (record.resets or record.tampering or record.jumps or record.joint_limits or record.velocity_limits),
    )


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", default="7000:7010", help="first:last+1")
    parser.add_argument("--film", type=Path)
    options = parser.parse_args()
    first, last = (int(number) for number in options.seeds.split(":"))
    walks = []
    print("| seed | friction | 3 m became | sideways, mm | heading, ° | turn off by, ° | odometry off by | s | ok |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- | --- |")
    for seed in range(first, last):
        done = walk(seed, options.film if seed == first else None)
        walks.append(done)
        print(
            f"| {done.seed} | {done.friction:.2f} | {done.length:.3f} m | {1e3 * done.sideways:+.0f} | "
            f"{done.heading:+.1f} | {done.turn:+.1f} | {done.odometry:.1%} | {done.seconds:.1f} | "
            f"{'yes' if done.good else 'no'} |",
            flush=True,
        )
    print(f"{sum(done.good for done in walks)} of {len(walks)} good")
    return 0 if all(done.good for done in walks) else 1


if __name__ == "__main__":
    sys.exit(main())
