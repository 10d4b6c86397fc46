"""How often the shipped reaching policy reaches, from random starts to random goals in its box, with two controls.

    python benchmarks/reaching_policy.py [--first 7000] [--count 40] [--simulator] [--json]

Kinematic: chunks are carried out exactly. ``--simulator``: the skill RunPolicy on the simulated robot in physics, away
from furniture, at the tool's true pose by encoders. Controls: a policy that does nothing, and one that is told another
goal than the judge has; both should reach none.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bestman_bt.configuration.data import data_root
from bestman_bt.evaluation.interval import wilson_interval
from bestman_bt.manipulation.kinematics.damped_least_squares import DampedLeastSquares
from bestman_bt.manipulation.policy.base import ActionChunk, Observation, Policy
from bestman_bt.manipulation.policy.features import pose_error
from bestman_bt.manipulation.policy.policy_file import load_policy
from bestman_bt.manipulation.policy.specification import ActionSpace, PolicySpecification
from bestman_bt.manipulation.policy.training.reaching import ReachingExpert, roll_out
from bestman_bt.messages import Pose
from bestman_bt.robot_model.compose import load_robot_model
from bestman_bt.robot_model.model import ArmModel
from bestman_bt.runtime.robot_session import RobotSession, session

POSITION, ROTATION = 0.01, 0.1
SHIPPED = data_root() / "assets/policies/reach_diff_panda.onnx"
OPEN_FLOOR = ("scene.robot_start.x=[1.0, 1.0]", "scene.robot_start.y=[-1.0, -1.0]", "scene.robot_start.yaw=[0.0, 0.0]")
TREE = """<root BTCPP_format="4"><BehaviorTree ID="Main">
  <RunPolicy policy="{policy}" goal="{goal}" position_tolerance="0.005"/>
</BehaviorTree></root>"""
Task = tuple[NDArray[np.float64], Pose, Pose]


class NullPolicy(Policy):
    """Looks like another policy and does nothing."""

    def __init__(self, specification: PolicySpecification) -> None:
        self._specification = specification

    @property
    def specification(self) -> PolicySpecification:
        return self._specification

    def reset(self) -> None:
        """Nothing to forget."""

    def act(self, observation: Observation) -> ActionChunk:
        spec = self._specification
        return ActionChunk(np.zeros((spec.horizon, len(spec.joint_names))), spec.dt, ActionSpace(spec.space))


def expert() -> ReachingExpert:
    robot = load_robot_model("diff_panda")
    arm = robot.of(ArmModel)["arm"]
    return ReachingExpert(DampedLeastSquares(robot), arm, robot.posture("home", arm.joint_names))


def tasks(expert: ReachingExpert, first: int, count: int) -> list[Task]:
    """Start, goal and a wrong goal (at least 5 cm from the right one) by seed."""
    found = []
    for seed in range(first, first + count):
        rng = np.random.default_rng(seed)
        start, goal = expert.task(rng)
        wrong = expert.task(rng)[1]
        while np.linalg.norm(wrong.position - goal.position) < 0.05:
            wrong = expert.task(rng)[1]
        found.append((start, goal, wrong))
    return found


def kinematic(teacher: ReachingExpert, policy: Policy, wrong: bool) -> Callable[[Task], tuple[bool, float, float]]:
    def run(task: Task) -> tuple[bool, float, float]:
        start, goal, other = task
        rollout = roll_out(policy, teacher.kinematics, teacher.arm, start, other if wrong else goal, goal)
        return rollout.reached(POSITION, ROTATION), *(float(value) for value in rollout.errors[-1])

    return run


def simulated(opened: RobotSession, policy: Policy, wrong: bool) -> Callable[[Task], tuple[bool, float, float]]:
    def run(task: Task) -> tuple[bool, float, float]:
        start, goal, other = task
        skills = opened.skills
        skills.policies = lambda name, folders: policy
        handle = skills.arm.move_to(start)
        while not handle.done:
            skills.clock.sleep(0.05)
        tree = opened.load(TREE)
        tree.blackboard.set("policy", "given")
        tree.blackboard.set("goal", skills.map_from_base @ (other if wrong else goal))
        while tree.tick_once() == 1:
            tree.sleep(0.05)
        tree.halt()
        skills.clock.sleep(0.5)
        error = pose_error(goal, skills.base_from_tool())
        position, rotation = float(np.linalg.norm(error[:3])), float(np.linalg.norm(error[3:]))
        return position <= POSITION and rotation <= ROTATION, position, rotation

    return run


def measure(run: Callable[[Task], tuple[bool, float, float]], given: list[Task]) -> dict[str, Any]:
    results = [run(task) for task in given]
    reached = sum(result[0] for result in results)
    errors = np.array([result[1:] for result in results])
    return {
        "reached": reached,
        "of": len(given),
        "interval": [round(bound, 3) for bound in wilson_interval(reached, len(given))],
        "median_mm": round(float(np.median(errors[:, 0])) * 1000, 2),
        "worst_mm": round(float(errors[:, 0].max()) * 1000, 2),
        "median_rad": round(float(np.median(errors[:, 1])), 4),
        "worst_rad": round(float(errors[:, 1].max()), 4),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--first", type=int, default=7000)
    parser.add_argument("--count", type=int, default=40)
    parser.add_argument("--simulator", action="store_true")
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    teacher, learned = expert(), load_policy(SHIPPED)
    given = tasks(teacher, options.first, options.count)
    null = NullPolicy(learned.specification)
    cases = {"policy": (learned, False), "null policy": (null, False), "wrong goal": (learned, True)}
    if options.simulator:
        with session(seed=1, settings=OPEN_FLOOR) as opened:
            found = {name: measure(simulated(opened, *case), given) for name, case in cases.items()}
    else:
        found = {name: measure(kinematic(teacher, *case), given) for name, case in cases.items()}
    if options.json:
        print(json.dumps(found))
    else:
        for name, result in found.items():
            print(f"{name:12} {result['reached']} of {result['of']} {result}")


if __name__ == "__main__":
    main()
