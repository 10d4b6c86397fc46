"""Train a shipped policy: demonstrations, behaviour cloning, an .onnx and a .json file.

    python scripts/train_policy.py reach|pick [--out FILE.onnx] [--episodes N] [--steps N] [--seed N]

Some minutes on one core. Measure the results with benchmarks/reaching_policy.py and benchmarks/picking_policy.py.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bestman_bt.configuration import data_root, find_data
from bestman_bt.manipulation.kinematics import DampedLeastSquares
from bestman_bt.manipulation.policy import (
    PICKING_FEATURES,
    REACHING_FEATURES,
    BehaviourCloningParameters,
    PickedObject,
    PickingExpert,
    PickingParameters,
    ReachingExpert,
    clone,
)
from bestman_bt.messages import Pose
from bestman_bt.perception.grasp_pose import GraspTarget, ModelBased, ModelBasedParameters
from bestman_bt.robot_model import RobotModel, load_robot_model
from bestman_bt.scene.object_file import read_object

PICKED = "cup"


@dataclass(frozen=True)
class Recipe:
    """How one policy is trained."""

    features: tuple[str, ...]
    episodes: int
    steps: int
    hidden: tuple[int, ...]


RECIPES = {
    "reach": Recipe(REACHING_FEATURES, 2000, 12000, (192, 192)),
    "pick": Recipe(PICKING_FEATURES, 3000, 24000, (256, 256)),
}


def picked_object(robot: RobotModel, name: str = PICKED) -> PickedObject:
    """The best grasp from above that our grasp planner finds; the middle of the object stands at 0.8 m."""
    model = read_object(find_data("object", name))
    target = GraspTarget.of_model(model, Pose.from_xyz_rpy((0.6, 0.0, 0.8)))
    support = 0.8 + float(model.bounds()[0, 2])
    candidates = ModelBased(ModelBasedParameters()).plan(target, robot.grippers["gripper"], support)
    best = next(candidate for candidate in candidates if candidate.approach == "top")
    return PickedObject(name, float(best.grasp.position[2]) - 0.8, best.width, best.opening)


def make_expert(which: str, robot: RobotModel) -> ReachingExpert | PickingExpert:
    """Who makes the demonstrations."""
    arm = robot.arms["arm"]
    kinematics, home = DampedLeastSquares(robot), robot.posture("home", arm.joint_names)
    if which == "reach":
        return ReachingExpert(kinematics, arm, home)
    return PickingExpert(kinematics, arm, home, picked_object(robot), PickingParameters())


def main() -> None:
    """Read the arguments, train, write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("which", choices=list(RECIPES))
    parser.add_argument("--robot", default="diff_panda")
    parser.add_argument("--out", type=Path, default=None)
    parser.add_argument("--episodes", type=int, default=None)
    parser.add_argument("--steps", type=int, default=None)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    recipe, robot = RECIPES[options.which], load_robot_model(options.robot)
    expert, rng = make_expert(options.which, robot), np.random.default_rng(options.seed)
    episodes = options.episodes or recipe.episodes
    started = time.perf_counter()
    demonstrations = [expert.demonstrate(rng) for _ in range(episodes)]
    chunks = sum(len(demonstration.chunks) for demonstration in demonstrations)
    print(f"{episodes} demonstrations, {chunks} chunks in {time.perf_counter() - started:.0f} s")
    started = time.perf_counter()
    parameters = BehaviourCloningParameters(
        hidden=recipe.hidden, steps=options.steps or recipe.steps, seed=options.seed
    )
    policy = clone(demonstrations, expert.specification(robot.name), parameters, recipe.features)
    name = f"{options.which}_{robot.name}" if options.which == "reach" else f"pick_{PICKED}_{robot.name}"
    out = options.out or data_root() / "assets/policies" / f"{name}.onnx"
    policy.save(out)
    print(f"trained in {time.perf_counter() - started:.0f} s, loss {policy.loss:.5f}: {out}")


if __name__ == "__main__":
    main()
