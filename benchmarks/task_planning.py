"""The embedded planner beside Fast Downward on generated problems of the kitchen's domain; every plan validated.

Example: python benchmarks/task_planning.py --first-seed 7000 --problems 200 -o task_planning.json
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np

from bestman_bt.engine import NodeRegistry
from bestman_bt.evaluation.interval import wilson_interval
from bestman_bt.task_planning.domain import Domain
from bestman_bt.task_planning.state import SUPERTYPES
from bestman_bt.task_planning.symbolic.fast_downward import FastDownwardPlanner, is_valid
from bestman_bt.task_planning.symbolic.problem import (
    Fact,
    Literal,
    PlanningError,
    PlanningProblem,
    TaskPlan,
    Unsolvable,
)
from bestman_bt.task_planning.symbolic.search import SymbolicPlanner


def generated_problem(domain: Domain, seed: int) -> PlanningProblem:
    """1 to 8 objects, 3 to 12 places, 1 to 5 containers, 1 to 10 goal facts; doors shut, some things not seen."""
    rng = np.random.default_rng(seed)
    containers = int(rng.integers(1, 6))
    drawers = int(rng.integers(0, min(containers, 3) + 1))
    places = int(rng.integers(max(3, drawers), 13))
    objects = [f"object_{number}" for number in range(int(rng.integers(1, 9)))]
    doors = [f"door_{number}" for number in range(containers - drawers)]
    shut_in = [f"drawer_{number}" for number in range(drawers)]
    open_places = [f"place_{number}" for number in range(places - drawers)]
    everywhere, leaves = [*open_places, *shut_in], [*doors, *shut_in]
    kinds = dict.fromkeys(objects, "object") | dict.fromkeys(open_places, "place")
    kinds |= dict.fromkeys(doors, "container") | dict.fromkeys(shut_in, "drawer")
    state = {Fact("tucked"), *(Fact("behind", (drawer, drawer)) for drawer in shut_in)}
    state |= {Fact("drawer", (drawer,)) for drawer in shut_in}
    for door in doors:
        for place in rng.choice(open_places, size=min(len(open_places), int(rng.integers(1, 4))), replace=False):
            state.add(Fact("behind", (str(place), door)))
    for leaf in leaves:
        state.add(Fact("open" if rng.random() < 0.15 else "closed", (leaf,)))
        if rng.random() < 0.05:
            state.add(Fact("locked", (leaf,)))
    state |= _where_things_are(objects, everywhere, rng)
    goal = _goal(objects, everywhere, leaves, rng)
    predicates = {name: types for name, types in domain.signatures.items() if name != "accessible"}
    return PlanningProblem(kinds, frozenset(state), goal, domain.operators, SUPERTYPES, predicates)


def _where_things_are(objects: list[str], places: list[str], rng: np.random.Generator) -> set[Fact]:
    """Seen somewhere, in the hand, or not seen yet: then it may be at some of the places."""
    state: set[Fact] = set()
    held = str(rng.choice(objects)) if rng.random() < 0.15 else None
    state.add(Fact("hand_empty") if held is None else Fact("holding", (held,)))
    for name in objects:
        if name != held and rng.random() < 0.25:
            may_be = rng.choice(places, size=int(rng.integers(1, len(places) + 1)), replace=False)
            state |= {Fact("unseen", (name, str(place))) for place in may_be}
            continue
        state.add(Fact("located", (name,)))
        if name != held:
            state.add(Fact("on", (name, str(rng.choice(places)))))
    return state


def _goal(objects: list[str], places: list[str], leaves: list[str], rng: np.random.Generator) -> tuple[Literal, ...]:
    wanted = [Fact("on", (name, str(rng.choice(places)))) for name in objects]
    wanted += [Fact("closed" if rng.random() < 0.8 else "open", (leaf,)) for leaf in leaves]
    wanted += [Fact("tucked"), Fact("near", (str(rng.choice(places)),))] if rng.random() < 0.2 else []
    count = int(rng.integers(1, min(10, len(wanted)) + 1))
    chosen = sorted(int(number) for number in rng.choice(len(wanted), size=count, replace=False))
    return tuple(Literal(wanted[number]) for number in chosen)


def _timed(planner: Any, problem: PlanningProblem) -> tuple[TaskPlan | None, str, float, float]:
    """Plan or why there is none, seconds on the wall and of this process."""
    wall, own = time.perf_counter(), time.process_time()
    plan, why = None, ""
    try:
        plan = planner.plan(problem)
    except Unsolvable:
        why = "unsolvable"
    except PlanningError as error:
        why = str(error)
    return plan, why, time.perf_counter() - wall, time.process_time() - own


def _compared(seed: int, problem: PlanningProblem) -> dict[str, Any]:
    ours, why, wall, own = _timed(SymbolicPlanner(), problem)
    theirs, their_why, their_wall, _ = _timed(FastDownwardPlanner(), problem)
    return {
        "seed": seed,
        "objects": len(problem.of_type("object")),
        "places": len(problem.of_type("place")),
        "containers": len(problem.of_type("container")),
        "goal_facts": len(problem.goal),
        "symbolic": None if ours is None else {"length": len(ours), "cost": ours.cost},
        "symbolic_why": why,
        "symbolic_seconds": {"wall": wall, "processor": own},
        "symbolic_valid": None if ours is None else is_valid(problem, ours),
        "fast_downward": None if theirs is None else {"length": len(theirs), "cost": theirs.cost},
        "fast_downward_why": their_why,
        "fast_downward_seconds": {"wall": their_wall},
    }


def summary(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Coverage of what Fast Downward solves, with Wilson interval, times, and lengths against its plans."""
    solvable = [row for row in rows if row["fast_downward"] is not None]
    both = [row for row in solvable if row["symbolic"] is not None]
    nonempty = [row for row in both if row["fast_downward"]["length"]]
    ratios = [row["symbolic"]["length"] / row["fast_downward"]["length"] for row in nonempty]
    costs = [row["symbolic"]["cost"] / row["fast_downward"]["cost"] for row in nonempty]
    return {
        "problems": len(rows),
        "fast_downward_solves": len(solvable),
        "symbolic_solves_of_these": len(both),
        "interval": wilson_interval(len(both), len(solvable)),
        "symbolic_solves_others": sum(row["symbolic"] is not None for row in rows) - len(both),
        "plans_valid": sum(row["symbolic_valid"] is True for row in rows),
        "plans": sum(row["symbolic"] is not None for row in rows),
        "longest_plan": max((row["symbolic"]["length"] for row in both), default=0),
        "length_ratio": {"median": median(ratios), "largest": max(ratios)} if ratios else None,
        "cost_ratio": {"median": median(costs), "largest": max(costs)} if costs else None,
        "symbolic_wall_seconds": _spread([row["symbolic_seconds"]["wall"] for row in rows]),
        "symbolic_processor_seconds": _spread([row["symbolic_seconds"]["processor"] for row in rows]),
        "fast_downward_wall_seconds": _spread([row["fast_downward_seconds"]["wall"] for row in rows]),
    }


def _spread(values: list[float]) -> dict[str, float]:
    return {"median": median(values), "p95": float(np.percentile(values, 95)), "largest": max(values)}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--first-seed", type=int, default=0)
    parser.add_argument("--problems", type=int, default=200)
    parser.add_argument("-o", "--output", type=Path)
    options = parser.parse_args()
    domain = Domain.of(NodeRegistry())
    rows: list[dict[str, Any]] = []
    for seed in range(options.first_seed, options.first_seed + options.problems):
        rows.append(_compared(seed, generated_problem(domain, seed)))
        if options.output is not None:
            options.output.write_text(json.dumps({"summary": summary(rows), "problems": rows}, indent=1) + "\n")
    print(json.dumps(summary(rows), indent=1))


if __name__ == "__main__":
    main()
