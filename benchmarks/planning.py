"""Arm planning on a file of problems: writes the paths, prints one JSON document with times, lengths and a verdict.

Problems: a JSON list of ``{start, goal}`` (7 rad each; ``id`` where there is one, else its number) for a Panda on a
fixed base. The scene is ``boxes()`` of the ``world.py`` beside the problems, else the table and shelf of the tests.
Paths: ``{id, path, plan_ms, simplify_ms}`` in the problems' order, ``path`` null where unsolved. Times are CPU time of
this one thread, so that a loaded machine gives nearly the figures of an idle one; ``wall_ms`` is beside them.
``strict``: PyBullet sees no contact deeper than 0.1 mm at steps of 0.01 rad, neither between the robot (its base link
excepted) and a box nor between links. The peer is OMPL's RRTConnect as it comes, simplified by OMPL for 60 ms (CPU
too), on the same collision world, in the same run.
"""

from __future__ import annotations

import argparse
import importlib.util
import json
import os
import platform
import sys
import time
from importlib.metadata import version
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).parents[1]))

import numpy as np

from benchmarks.ompl_simplified import ompl_simplified
from bestman_bt.manipulation.collision.coal_world import CoalCollisionModel
from bestman_bt.manipulation.errors import ManipulationError
from bestman_bt.manipulation.motion_planning.base import MotionPlanningError, PlanningErrorCode
from bestman_bt.manipulation.motion_planning.checked_edges import dense_points
from bestman_bt.manipulation.motion_planning.sampling_planner import SamplingPlanner
from bestman_bt.registry import ALGORITHMS, class_and_preset
from bestman_bt.robot_model.model import ArmModel
from tests.manipulation.pybullet_referee import Referee
from tests.manipulation.table_and_shelf import Body, boxes, fixed_panda, table_and_shelf

PADDINGS = (0.002, 0.001, 0.0003)
"""Metres. The first at which start and goal are free: problems may stand closer to things than one would like."""


class Stopwatch:
    """Sums the CPU time that a method of a class takes."""

    def __init__(self, owner: type, method: str) -> None:
        self.seconds = 0.0
        original = getattr(owner, method)

        def timed(*arguments):
            begin = time.process_time()
            try:
                return original(*arguments)
            finally:
                self.seconds += time.process_time() - begin

        setattr(owner, method, timed)


def read_problems(path: Path) -> list[dict]:
    """The list in the file; ValueError in words where it holds none."""
    try:
        problems = json.loads(path.read_text())
    except (OSError, ValueError) as error:
        raise ValueError(f"{path} cannot be read: {error}") from error
    if not isinstance(problems, list) or not problems:
        raise ValueError(f"{path} should hold a list of problems, got {type(problems).__name__}")
    return [problem if isinstance(problem, dict) else {"start": None, "goal": problem} for problem in problems]


def fault(problem: dict) -> str:
    """What keeps a problem from being one, in words; empty for a good one."""
    for name in ("start", "goal"):
        value = problem.get(name)
        numbers = isinstance(value, list) and all(isinstance(x, (int, float)) for x in value)
        if not numbers or len(value) != 7 or not np.isfinite(value).all():
            return f"{name} should be 7 finite numbers, got {value}"
    return ""


def scene_of(problems: Path) -> list[Body]:
    world = problems.resolve().parent / "world.py"
    if not world.exists():
        return boxes()
    specification = importlib.util.spec_from_file_location("problem_world", world)
    module = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(module)
    return module.boxes()


def solve(problems: list[dict], planner, model: CoalCollisionModel, bodies: list[Body], seed: int) -> list[dict]:
    """The answers, each with its padding, wall time and checks, and the error where there is no path."""
    arm = model.robot.of(ArmModel)["arm"]
    worlds = [model.world(table_and_shelf(padding, bodies)) for padding in PADDINGS]
    shortening = Stopwatch(SamplingPlanner, "shorten")
    answers = []
    for number, problem in enumerate(problems):
        answer = {"id": problem.get("id", number), "path": None, "error": "", "checks": 0}
        answer["error"] = fault(problem)
        if answer["error"]:
            answers.append(answer | {"plan_ms": 0.0, "simplify_ms": 0.0, "wall_ms": 0.0})
            continue
        shortening.seconds = 0.0
        begin, wall = time.process_time(), time.perf_counter()
        for padding, world in zip(PADDINGS, worlds, strict=True):
            rng = np.random.default_rng([seed, number])
            try:
                plan = planner.plan(problem["start"], [problem["goal"]], world, arm, rng)
            except ManipulationError as error:
                answer["error"] = str(error)
                code = error.code if isinstance(error, MotionPlanningError) else None
                if code in (PlanningErrorCode.START_IN_COLLISION, PlanningErrorCode.GOAL_IN_COLLISION):
                    continue
                break
            answer |= {"path": plan.path, "error": "", "checks": plan.checks, "padding": padding}
            break
        total = time.process_time() - begin
        answer["plan_ms"] = 1e3 * (total - shortening.seconds)
        answer["simplify_ms"] = 1e3 * shortening.seconds
        answer["wall_ms"] = 1e3 * (time.perf_counter() - wall)
        answers.append(answer)
    return answers


def length(path: np.ndarray) -> float:
    return float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum())


def spread(values: list[float]) -> dict[str, float] | None:
    if not values:
        return None
    return {
        "median": round(float(np.median(values)), 3),
        "p95": round(float(np.percentile(values, 95)), 3),
        "max": round(float(np.max(values)), 3),
    }


def strict(path: np.ndarray, judge: Referee) -> bool:
    return all(judge.depth(q) <= 1e-4 for q in dense_points(path, 0.01))


def peer_figures(problems: list[dict], answers: list[dict], model: CoalCollisionModel, bodies, seed: int) -> dict:
    world, arm = model.world(table_and_shelf(PADDINGS[0], bodies)), model.robot.of(ArmModel)["arm"]
    ours, theirs, plan_ms = [], [], []
    for number, (problem, answer) in enumerate(zip(problems, answers, strict=True)):
        if fault(problem):
            continue
        found = ompl_simplified(problem["start"], problem["goal"], world, arm, seed + number + 1)
        plan_ms.append(found.plan_ms)
        if found.path is not None and answer["path"] is not None:
            ours.append(length(answer["path"]))
            theirs.append(length(found.path))
    return {
        "name": "OMPL RRTConnect, simplified for 60 ms",
        "solved_by_both": len(ours),
        "plan_ms": spread(plan_ms),
        "length_rad": spread(theirs),
        "length_ratio_of_medians": round(float(np.median(ours) / np.median(theirs)), 3) if ours else None,
        "length_ratio_of_sums": round(sum(ours) / sum(theirs), 3) if ours else None,
        "length_ratio_median_of_pairs": round(float(np.median(np.divide(ours, theirs))), 3) if ours else None,
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--problems", type=Path, required=True)
    parser.add_argument("--out", type=Path, help="where to write the paths")
    parser.add_argument("--json", action="store_true", help="print the figures as JSON (they always are)")
    parser.add_argument("--planner", default="portfolio", help="a name registered under motion_planning/")
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    try:
        problems = read_problems(arguments.problems)
    except ValueError as error:
        parser.error(str(error))
    bodies = scene_of(arguments.problems)
    model = CoalCollisionModel(fixed_panda())
    kind, preset = class_and_preset(ALGORITHMS.resolve(f"motion_planning/{arguments.planner}"))
    planner = kind(**preset)
    ready = np.array([0.0, -0.5, 0.0, -2.2, 0.0, 1.8, 0.785])
    planner.plan(
        ready,
        [ready + 0.01],
        model.world(table_and_shelf(0.0, [])),
        model.robot.of(ArmModel)["arm"],
        np.random.default_rng(0),
    )
    answers = solve(problems, planner, model, bodies, arguments.seed)
    if arguments.out:
        written = [
            {
                "id": a["id"],
                "path": None if a["path"] is None else a["path"].tolist(),
                "plan_ms": round(a["plan_ms"], 3),
                "simplify_ms": round(a["simplify_ms"], 3),
                "wall_ms": round(a["wall_ms"], 3),
            }
            for a in answers
        ]
        arguments.out.write_text(json.dumps(written, indent=1) + "\n")
    solved = [a for a in answers if a["path"] is not None]
    judge = Referee(bodies)
    verdicts = {str(a["id"]): strict(a["path"], judge) for a in solved}
    document = {
        "planner": arguments.planner,
        "seed": arguments.seed,
        "problems": len(problems),
        "solved": len(solved),
        "strictly_free": sum(verdicts.values()),
        "touching": [name for name, free in verdicts.items() if not free],
        "unsolved": {str(a["id"]): a["error"] for a in answers if a["path"] is None},
        "plan_ms": spread([a["plan_ms"] for a in answers]),
        "simplify_ms": spread([a["simplify_ms"] for a in answers]),
        "plan_and_simplify_ms": spread([a["plan_ms"] + a["simplify_ms"] for a in answers]),
        "wall_ms": spread([a["wall_ms"] for a in answers]),
        "checks": spread([a["checks"] for a in solved]),
        "length_rad": spread([length(a["path"]) for a in solved]),
        "peer": peer_figures(problems, answers, model, bodies, arguments.seed),
        "padding_m": sorted({a["padding"] for a in solved}),
        "machine": {"platform": platform.platform(), "cpus": os.cpu_count(), "load": round(os.getloadavg()[0], 2)},
        "versions": {
            "python": platform.python_version(),
            **{name: version(name) for name in ("numpy", "pin", "coal", "ompl", "pybullet")},
        },
    }
    json.dump(document, sys.stdout, indent=2)
    sys.stdout.write("\n")


if __name__ == "__main__":
    main()
