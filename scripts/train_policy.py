"""Train the shipped reaching policy: demonstrations, behaviour cloning, an .onnx and a .json file.

    python scripts/train_policy.py [--out assets/policies/reach_diff_panda.onnx] [--episodes 2000] [--steps 12000]

About a minute on one core. Measure the result with benchmarks/reaching_policy.py.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import numpy as np

from bestman_bt.configuration import data_root
from bestman_bt.manipulation.kinematics import DampedLeastSquares
from bestman_bt.manipulation.policy import BehaviourCloningParameters, ReachingExpert, clone
from bestman_bt.robot_model import load_robot_model


def main() -> None:
    """Read the arguments, train, write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--robot", default="diff_panda")
    parser.add_argument("--out", type=Path, default=None)
    parser.add_argument("--episodes", type=int, default=2000)
    parser.add_argument("--steps", type=int, default=12000)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    robot = load_robot_model(options.robot)
    arm = robot.arms["arm"]
    expert = ReachingExpert(DampedLeastSquares(robot), arm, robot.posture("home", arm.joint_names))
    rng = np.random.default_rng(options.seed)
    started = time.perf_counter()
    demonstrations = [expert.demonstrate(rng) for _ in range(options.episodes)]
    print(f"{options.episodes} demonstrations in {time.perf_counter() - started:.0f} s")
    started = time.perf_counter()
    parameters = BehaviourCloningParameters(steps=options.steps, seed=options.seed)
    policy = clone(demonstrations, expert.specification(robot.name), parameters)
    out = options.out or data_root() / "assets/policies" / f"reach_{robot.name}.onnx"
    policy.save(out)
    print(f"trained in {time.perf_counter() - started:.0f} s, loss {policy.loss:.5f}: {out}")


if __name__ == "__main__":
    main()
