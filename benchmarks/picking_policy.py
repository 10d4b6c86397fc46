"""How often the shipped policy picks the cup, in physics, with who taught it and four controls.

    python benchmarks/picking_policy.py [--first 7000] [--count 20] [--case NAME] [--json]

Each episode is a run of the task policy_pick, judged as any other: perception finds the cup, RunPolicy acts, the judge
asks the simulator whether the cup is in the hand. Cases: ``policy``, the learned one; ``expert``, who demonstrated.
Controls that shall pick nothing: ``null``, a policy that does nothing; ``wrong_goal``, told that the cup stands 10 cm
beside; ``slippery``, fingers without friction; ``no_gripper``, the learned one with a hand that stays open.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))  # the controls' policies are those of the suite

from bestman_bt.configuration.run import load_run
from bestman_bt.engine import Tree
from bestman_bt.evaluation.episode import run_episode
from bestman_bt.evaluation.interval import wilson_interval
from bestman_bt.evaluation.result import RunResult
from bestman_bt.manipulation.policy.base import ActionChunk, Observation, Policy
from bestman_bt.manipulation.policy.training.picking import ExpertPolicy
from bestman_bt.runtime.policy_experts import picking_expert
from bestman_bt.runtime.robot_session import RobotSession
from configs.evaluations.controls.altered_policy import Altered, Null, WrongGoal

TASK, OBJECT = "policy_pick", "cup"
SLIPPERY = "scene.finger_friction=0.001"


class NoGripper(Altered):
    """Its hand stays open."""

    def act(self, observation: Observation) -> ActionChunk:
        return replace(super().act(observation), gripper_widths=None)


def expert(session: RobotSession, policy: Policy) -> Policy:
    robot = session.setup.robot_model
    return ExpertPolicy(picking_expert(robot, OBJECT), robot.name)


CASES: dict[str, tuple[Callable[[RobotSession, Policy], Policy], tuple[str, ...]]] = {
    "policy": (lambda session, policy: policy, ()),
    "expert": (expert, ()),
    "null": (lambda session, policy: Null(policy), ()),
    "wrong_goal": (lambda session, policy: WrongGoal(policy), ()),
    "slippery": (lambda session, policy: policy, (SLIPPERY,)),
    "no_gripper": (lambda session, policy: NoGripper(policy), ()),
}


def run(case: str, seed: int) -> tuple[RunResult, int]:
    """One judged episode, and how many attempts the tree made."""
    changed, settings = CASES[case]
    attempts = 0

    def watch(session: RobotSession, tree: Tree) -> Callable[[], None]:
        find = session.skills.policies

        def policies(name: str, folders: tuple[Path, ...]) -> Policy:
            nonlocal attempts
            attempts += 1
            return changed(session, find(name, folders))

        session.skills.policies = policies
        return lambda: None

    result = run_episode(load_run(TASK, seed=seed, settings=settings), watch=watch)
    return result, attempts


def measure(case: str, first: int, count: int) -> dict[str, Any]:
    results = [run(case, seed) for seed in range(first, first + count)]
    picked = sum(result.success for result, _ in results)
    at_once = sum(result.success and attempts == 1 for result, attempts in results)
    failures = {r.seed: f"{r.failure.error_code}: {r.failure.why}" for r, _ in results if r.failure is not None}
    return {
        "picked": picked,
        "of": count,
        "interval": [round(bound, 3) for bound in wilson_interval(picked, count)],
        "at_the_first_attempt": at_once,
        "judge_denied_success": sum(r.tree_status == "SUCCESS" and r.predicate is False for r, _ in results),
        "lifted_though_failed": sum(r.predicate is True and not r.success for r, _ in results),
        "median_time_s": round(float(np.median([result.sim_time_s for result, _ in results])), 2),
        "codes": dict(Counter(r.failure.error_code for r, _ in results if r.failure is not None)),
        "failures": failures,
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--first", type=int, default=7000)
    parser.add_argument("--count", type=int, default=20)
    parser.add_argument("--case", choices=list(CASES), action="append")
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    found = {}
    for case in options.case or CASES:
        found[case] = measure(case, options.first, options.count)
        if not options.json:
            print(f"{case:10} {found[case]['picked']} of {found[case]['of']} {found[case]}", flush=True)
    if options.json:
        print(json.dumps(found))


if __name__ == "__main__":
    main()
