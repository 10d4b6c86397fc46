"""Docking before furniture, measured: how far from the asked pose the base really stands.

    python benchmarks/docking.py [--json] [--seed S] [--docks N] [--furniture]

Each dock has a kitchen of its own, in which the furniture is off the map by up to 3 cm and 2°, and a goal 6 cm before a
piece of it. By the map, the error is that of the pose in the map frame. With ``--furniture`` the goals are before the
counter, and the error is that of the distance and the angle to its real front: along it nothing is measured by the
robot. The truth comes from the simulator, and only this program sees it.
"""

from __future__ import annotations

import argparse
import math
import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np

from benchmarks.navigation_measures.judged_session import judged_session
from benchmarks.navigation_measures.report import median, print_report, scaled
from bestman_bt.configuration.run import load_run
from bestman_bt.evaluation.audit import audit
from bestman_bt.evaluation.interval import wilson_interval
from bestman_bt.facts.goals.at_goal import AtGoalFields, drive_goal
from bestman_bt.messages import Pose2D, wrap_angle
from bestman_bt.robot_model.model import BaseModel
from bestman_bt.runtime.resolved_config import prepare
from bestman_bt.scene.scene import World

POSITION, YAW = 0.01, math.radians(1.0)
"""Metres and radians that count as docked."""
BEFORE, REACH = 0.06, 0.4
"""Metres before the counter, and to either side of its middle, where goals before it are."""
REST = 0.5
"""Seconds between the end of the tree and the look at the truth."""
TREE = '<root BTCPP_format="4"><BehaviorTree ID="Dock"><DockAt goal="{{goal}}"{}/></BehaviorTree></root>'


@dataclass
class Docks:
    """What came of each dock."""

    docked: list[bool] = field(default_factory=list)
    position_errors: list[float] = field(default_factory=list)
    heading_errors: list[float] = field(default_factory=list)
    times: list[float] = field(default_factory=list)
    contacts: int = 0
    honest: bool = True
    why: list[str] = field(default_factory=list)

    def summary(self, seed: int) -> dict[str, Any]:
        """The figures, for JSON."""
        succeeded = sum(self.docked)
        return {
            "seeds": [seed, seed + len(self.docked) - 1],
            "docks": len(self.docked),
            "docked_rate": succeeded / len(self.docked),
            "interval": [round(bound, 4) for bound in wilson_interval(succeeded, len(self.docked))],
            "contacts": self.contacts,
            "honest": self.honest,
            "error_mm_median": scaled(median(self.position_errors), 1e3),
            "error_mm_max": scaled(max(self.position_errors, default=None), 1e3),
            "yaw_deg_median": scaled(median(self.heading_errors), math.degrees(1.0)),
            "yaw_deg_max": scaled(max(self.heading_errors, default=None), math.degrees(1.0)),
            "sim_s_median": median(self.times),
            "failures": self.why,
        }


def dock(seed: int, by_furniture: bool, measured: Docks) -> None:
    """One dock in a kitchen of its own."""
    setup = prepare(load_run("navigate_kitchen", seed=seed))
    if by_furniture:
        piece = setup.world_model.map.furniture["counter"]
        half = max(x for x, _ in next(iter(setup.robot_model.of(BaseModel).values())).footprint)
        aside = float(np.random.default_rng([seed, 9]).uniform(-REACH, REACH))
        goal = piece.pose @ Pose2D(-piece.footprint[0] / 2 - BEFORE - half, aside, 0.0)
    else:
        asked = AtGoalFields(at_furniture=1.0)
        goal = drive_goal(asked, setup.world, setup.world_model.map, setup.robot_model, seed)
    with judged_session(setup) as judged:
        tree = judged.session.load(TREE.format(' furniture="counter"' if by_furniture else ""))
        tree.blackboard.set("goal", goal)
        execution = judged.session.executor(tree).run()
        judged.robot.clock.sleep(REST)
        away, turn = _errors(judged.true_pose, goal, setup.world if by_furniture else None)
        audited = audit(judged.robot.audit_record())
        told = "; ".join([*(failure.why for failure in judged.session.skills.failures[-1:]), execution.why])
    measured.docked.append(execution.succeeded and away <= POSITION and turn <= YAW)
    measured.contacts += len(audited.collisions)
    measured.honest = measured.honest and audited.honest
    measured.times.append(execution.sim_time_s)
    if execution.succeeded:
        measured.position_errors.append(away)
        measured.heading_errors.append(turn)
    if not measured.docked[-1]:
        why = f"{1e3 * away:.1f} mm and {math.degrees(turn):.2f}° off" if execution.succeeded else told
        measured.why.append(f"seed {seed}: {why}")


def _errors(pose: Pose2D, goal: Pose2D, world: World | None) -> tuple[float, float]:
    """Metres and radians off ``goal``, or off its place before the real counter, of which the distance counts."""
    if world is None:
        return pose.distance_to(goal), abs(wrap_angle(pose.theta - goal.theta))
    counter = next(piece for piece in world.furniture if piece.name == "counter")
    wanted = counter.actual @ counter.nominal.inverse() @ goal
    off = wanted.inverse() @ pose
    return abs(off.x), abs(wrap_angle(off.theta))


def main() -> None:
    """Parse the command line, measure, print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=0, help="the first; below 5000 for development")
    parser.add_argument("--docks", type=int, default=30)
    parser.add_argument("--furniture", action="store_true", help="before the counter, by where its front is seen")
    parser.add_argument("--json", action="store_true", help="one JSON document instead of lines")
    asked = parser.parse_args()
    if asked.seed < 0 or asked.docks < 1:
        parser.error("--seed should be 0 or more and --docks at least 1")
    measured = Docks()
    for seed in range(asked.seed, asked.seed + asked.docks):
        dock(seed, asked.furniture, measured)
        last = measured.why[-1] if not measured.docked[-1] else "docked"
        print(f"seed {seed}: {last}", file=sys.stderr, flush=True)
    print_report(measured.summary(asked.seed), asked.json)


if __name__ == "__main__":
    main()
