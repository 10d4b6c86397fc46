"""Manipulation figures on this machine, PyBullet beside them: prints one JSON document.

IK: poses reached by random configurations of a Panda, from one fixed start. Checks and plans: the ten
table-and-shelf problems of the tests; ``strict`` counts timed motions (here without the re-check that
``TimedMotionPlanner`` adds) in which PyBullet sees no contact deeper than 0.1 mm. Times are CPU time of this one
thread, so that a loaded machine gives nearly the figures of an idle one.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import sys
import time
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).parents[1]))

import numpy as np

from bestman_bt.manipulation.collision.base import CollisionWorld
from bestman_bt.manipulation.collision.coal_world import CoalCollisionModel
from bestman_bt.manipulation.kinematics.damped_least_squares import DampedLeastSquares
from bestman_bt.manipulation.motion_planning.base import MotionPlanningError
from bestman_bt.manipulation.motion_planning.rrt_connect import RRTConnect
from bestman_bt.manipulation.trajectory.base import dense_samples
from bestman_bt.manipulation.trajectory.toppra import Toppra
from bestman_bt.robot_model.model import ArmModel
from hal.pybullet.package import pybullet
from tests.manipulation.pybullet_referee import Referee
from tests.manipulation.table_and_shelf import fixed_panda, problems, table_and_shelf

READY = np.array([0.0, -0.5, 0.0, -2.2, 0.0, 1.8, 0.785])


class PyBulletWorld(CollisionWorld):
    """The same scene asked of PyBullet: a peer, not a part of bestman-bt."""

    def __init__(self, referee: Referee, joint_names: tuple[str, ...]) -> None:
        self._referee = referee
        self._joint_names = joint_names
        links = list(referee.links.values())
        checked = {frozenset(pair) for pair in referee.self_pairs}
        for i, a in enumerate(links):
            for b in links[i + 1 :]:
                collide = frozenset((a, b)) in checked
                pybullet.setCollisionFilterPair(
                    referee.panda, referee.panda, a, b, int(collide), physicsClientId=referee.client
                )
        for box in referee.boxes:
            pybullet.setCollisionFilterPair(referee.panda, box, -1, -1, 0, physicsClientId=referee.client)

    @property
    def joint_names(self) -> tuple[str, ...]:
        return self._joint_names

    def is_free(self, positions) -> bool:
        client = self._referee.client
        self._referee.place(positions)
        pybullet.performCollisionDetection(physicsClientId=client)
        contacts = pybullet.getContactPoints(self._referee.panda, physicsClientId=client)
        return not any(contact[8] < 0.0 for contact in contacts)

    def colliding_pairs(self, positions) -> tuple[tuple[str, str], ...]:
        return () if self.is_free(positions) else (("panda", "scene"),)

    def distance(self, positions) -> float:
        return -self._referee.depth(positions)


def spread(seconds: list[float]) -> dict[str, float]:
    milliseconds = np.array(seconds) * 1e3
    return {
        "mean": round(float(milliseconds.mean()), 3),
        "median": round(float(np.median(milliseconds)), 3),
        "p90": round(float(np.percentile(milliseconds, 90)), 3),
    }


def timed(function: Callable[[], object]) -> tuple[object, float]:
    start = time.process_time()
    result = function()
    return result, time.process_time() - start


def inverse_kinematics(count: int, seed: int, referee: Referee) -> dict[str, object]:
    robot = fixed_panda()
    arm, ours = robot.of(ArmModel)["arm"], DampedLeastSquares(robot)
    rng = np.random.default_rng(seed)
    solved, peer_solved, seconds, peer_seconds = 0, 0, [], []
    for q in rng.uniform(arm.lower + 0.03, arm.upper - 0.03, (count, 7)):
        target = ours.tool_pose(q)

        def good(found: np.ndarray, target=target) -> bool:
            reached = ours.tool_pose(found)
            turn = 2 * np.arccos(min(1.0, abs(float(reached.quaternion @ target.quaternion))))
            inside = np.all((found >= arm.lower) & (found <= arm.upper))
            near = np.linalg.norm(reached.position - target.position) < 1e-3
            return bool(inside and near and turn < np.radians(0.5))

        result, spent = timed(lambda target=target: ours.solve(target, READY, rng))
        seconds.append(spent)
        solved += bool(result.found and good(result.best))
        found, spent = timed(lambda target=target, good=good: pybullet_ik(referee, target, arm, rng, good))
        peer_seconds.append(spent)
        peer_solved += found
    return {
        "poses": count,
        "bestman_bt": {"success": solved / count, "ms": spread(seconds)},
        "pybullet_20_restarts": {"success": peer_solved / count, "ms": spread(peer_seconds)},
    }


def pybullet_ik(referee: Referee, target, arm, rng, good) -> bool:
    for attempt in range(20):
        referee.place(READY if attempt == 0 else rng.uniform(arm.lower, arm.upper))
        solution = pybullet.calculateInverseKinematics(
            referee.panda,
            referee.links["panda_grasptarget"],
            target.position,
            target.quaternion,
            maxNumIterations=100,
            residualThreshold=1e-5,
            physicsClientId=referee.client,
        )
        if good(np.array(solution[:7])):
            return True
    return False


def collision_checks(count: int, seed: int, worlds: dict[str, CollisionWorld]) -> dict[str, object]:
    arm = fixed_panda().of(ArmModel)["arm"]
    configurations = np.random.default_rng(seed).uniform(arm.lower, arm.upper, (count, 7))
    figures: dict[str, object] = {"configurations": count}
    for name, world in worlds.items():
        free, seconds = timed(lambda world=world: sum(world.is_free(q) for q in configurations))
        figures[name] = {"us_per_check": round(seconds / count * 1e6, 1), "free": free}
    return figures


def plans(seeds: list[int], worlds: dict[str, CollisionWorld]) -> dict[str, object]:
    arm, planner, timing = fixed_panda().of(ArmModel)["arm"], RRTConnect(), Toppra()
    figures: dict[str, object] = {"problems": 10, "seeds": seeds}
    for name, world in worlds.items():
        solved, strict, seconds, timing_seconds, lengths, checks = 0, 0, [], [], [], []
        for start, goal in problems():
            for seed in seeds:
                rng = np.random.default_rng(seed)
                begin = time.process_time()
                try:
                    plan = planner.plan(start, [goal], world, arm, rng)
                except MotionPlanningError:
                    seconds.append(time.process_time() - begin)
                    continue
                seconds.append(time.process_time() - begin)
                trajectory, spent = timed(lambda plan=plan: timing.parametrize(plan.path, arm))
                timing_seconds.append(spent)
                lengths.append(plan.length)
                checks.append(plan.checks)
                solved += 1
                strict += is_strictly_free(trajectory, JUDGE)
        figures[name] = {
            "solved": solved,
            "strict": strict,
            "plan_and_shortcut_ms": spread(seconds),
            "timing_ms": spread(timing_seconds),
            "median_length_rad": round(float(np.median(lengths)), 3),
            "median_checks": int(np.median(checks)),
        }
    return figures


def is_strictly_free(trajectory, judge: Referee) -> bool:
    return all(judge.depth(q) < 1e-4 for _, q in dense_samples(trajectory, 0.02, 0.02))


JUDGE = Referee()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--poses", type=int, default=500)
    parser.add_argument("--checks", type=int, default=5000)
    parser.add_argument("--seeds", type=int, default=2, help="plans per problem")
    arguments = parser.parse_args()
    robot = fixed_panda()
    peer = Referee()
    worlds: dict[str, CollisionWorld] = {
        "bestman_bt": CoalCollisionModel(robot).world(table_and_shelf()),
        "pybullet_contacts": PyBulletWorld(peer, robot.of(ArmModel)["arm"].joint_names),
    }
    document = {
        "machine": {"platform": platform.platform(), "cpus": os.cpu_count(), "load": round(os.getloadavg()[0], 2)},
        "versions": {
            "python": platform.python_version(),
            **{name: version(name) for name in ("numpy", "pin", "ompl", "toppra", "pybullet")},
        },
        "inverse_kinematics": inverse_kinematics(arguments.poses, 1, JUDGE),
        "collision_checks": collision_checks(arguments.checks, 2, worlds),
        "plans": plans(list(range(arguments.seeds)), worlds),
    }
    json.dump(document, sys.stdout, indent=2)
    sys.stdout.write("\n")


if __name__ == "__main__":
    main()
