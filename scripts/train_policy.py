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

from bestman_bt.configuration.data import data_root
from bestman_bt.manipulation.policy.training.behaviour_cloning import BehaviourCloning
from bestman_bt.manipulation.policy.training.picking import PICKING_FEATURES
from bestman_bt.manipulation.policy.training.reaching import REACHING_FEATURES
from bestman_bt.robot_model.compose import load_robot_model
from bestman_bt.runtime.policy_experts import picking_expert, reaching_expert

PICKED = "cup"


@dataclass(frozen=True)
class Recipe:
    """How one policy is trained; ``precision``: the smaller, the more the last centimetre counts."""

    features: tuple[str, ...]
    episodes: int
    steps: int
    hidden: tuple[int, ...]
    precision: float


RECIPES = {
    "reach": Recipe(REACHING_FEATURES, 3000, 16000, (192, 192), 0.25),
    "pick": Recipe(PICKING_FEATURES, 3000, 24000, (256, 256), 0.05),
}


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
    rng = np.random.default_rng(options.seed)
    expert = reaching_expert(robot) if options.which == "reach" else picking_expert(robot, PICKED)
    episodes = options.episodes or recipe.episodes
    started = time.perf_counter()
    demonstrations = [expert.demonstrate(rng) for _ in range(episodes)]
    chunks = sum(len(demonstration.chunks) for demonstration in demonstrations)
    print(f"{episodes} demonstrations, {chunks} chunks in {time.perf_counter() - started:.0f} s")
    started = time.perf_counter()
    training = BehaviourCloning(
        hidden=recipe.hidden,
        steps=options.steps or recipe.steps,
        precision=recipe.precision,
        seed=options.seed,
    )
    policy = training.train(demonstrations, expert.specification(robot.name), recipe.features)
    name = f"{options.which}_{robot.name}" if options.which == "reach" else f"pick_{PICKED}_{robot.name}"
    out = options.out or data_root() / "assets/policies" / f"{name}.onnx"
    policy.save(out)
    print(f"trained in {time.perf_counter() - started:.0f} s, loss {policy.loss:.5f}: {out}")


if __name__ == "__main__":
    main()
