"""Every base with every arm and every end effector, and the walker alone: composed, loaded, standing, moving.

It prints a Markdown table.

``python benchmarks/robots.py --markdown docs/combinations.md`` writes the page of the documentation. Times are of the
processor, so that a loaded machine gives nearly the figures of an idle one.
"""

from __future__ import annotations

import argparse
import itertools
import os
import sys
from functools import partial
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).parents[1]))

from bestman_bt.configuration.errors import ConfigurationError
from bestman_bt.robot_model.compose import combine, load_robot_model
from bestman_bt.robot_model.model import RobotModel
from bestman_bt.runtime.self_test import SelfTest, TrialProcedure

BASES = ("differential_base", "omni_base", "husky_base")
ARMS = ("panda_arm", "iiwa_arm", "xarm6_arm", "ur5_arm")
HANDS = ("panda_hand", "wsg50", "xarm_gripper", "pr2_gripper", "suction")

ALONE = ("a1", "-", "-")
"""A robot whose base carries nothing."""

HEAD = """# Combinations of parts

{passed} of {count} pass: composed within 50 ms, loaded within 1 s, a drift of at most 5 mm in {standing:g} s of
standing, and {postures} postures reached without a self-collision (seed {seed}; times of the processor; written by
`python benchmarks/robots.py --markdown docs/combinations.md`). "Moved" is how far the parked base has shifted once
the arm has been through its postures.

| base | arm | end effector | kg | composed, ms | loaded, s | drift, mm | postures | moved, mm |
| --- | --- | --- | --- | --- | --- | --- | --- | --- |
"""


def row(names: tuple[str, ...], trial: SelfTest | str) -> str:
    head = f"| {' | '.join(names)} | "
    if isinstance(trial, str):
        return f"{head}{trial} | | | | | |"
    postures = f"{trial.reached}/{trial.asked}"
    if trial.touching:
        postures += ", " + "; ".join(f"{a} met {b}" for a, b in trial.touching)
    return (
        f"{head}{trial.mass:.0f} | {1e3 * trial.composed:.0f} | {trial.loaded:.2f} | {1e3 * trial.drift:.3f} | "
        f"{postures} | {1e3 * trial.after:.1f} |"
    )


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--bases", nargs="*", default=BASES)
    parser.add_argument("--arms", nargs="*", default=ARMS)
    parser.add_argument("--hands", nargs="*", default=HANDS)
    parser.add_argument("--seed", type=int, default=7000)
    parser.add_argument("--markdown", type=Path, help="write the page here")
    options = parser.parse_args()
    procedure, rows, passed = TrialProcedure(), [], 0
    for names in [*itertools.product(options.bases, options.arms, options.hands), ALONE]:
        compose: partial[RobotModel] = partial(load_robot_model, "a1") if names == ALONE else partial(combine, *names)
        try:
            trial: SelfTest | str = procedure.run(compose, options.seed)
        except ConfigurationError as error:
            trial = str(error)
        passed += isinstance(trial, SelfTest) and trial.passed
        rows.append(row(names, trial))
        print(rows[-1], flush=True)
    head = HEAD.format(
        passed=passed,
        count=len(rows),
        standing=procedure.standing,
        postures=procedure.postures,
        seed=options.seed,
    )
    if options.markdown:
        options.markdown.write_text(head + "\n".join(rows) + "\n", encoding="utf-8")
    print(f"{passed} of {len(rows)} pass")
    return 0 if passed == len(rows) else 1


if __name__ == "__main__":
    sys.exit(main())
