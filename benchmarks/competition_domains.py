"""Domains of the planning competitions at sizes that double: `symbolic` beside Fast Downward and pyperplan.

`--eai FILE.whl`: the problems of the Embodied Agent Interface instead, as its wheel `eai-eval` brings them (338 of
VirtualHome, 100 of BEHAVIOR). Each planner gets the same files in a process of its own, limited in processor time and
memory, and finds its first plan: `symbolic` without handing large problems over, Fast Downward as `lama-first`,
pyperplan with a greedy search and h_FF. unified-planning's validator judges the plans of the files that it reads.

Fast Downward: extra `planning`. pyperplan (GPL): `pip install pyperplan`; without it its column is empty.

Example: python benchmarks/competition_domains.py --first-seed 500 --seeds 5 --json
"""

from __future__ import annotations

import argparse
import importlib.util
import json
import logging
import os
import platform
import resource
import signal
import subprocess
import sys
import tempfile
import zipfile
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np

from bestman_bt.evaluation.versions import versions
from bestman_bt.task_planning.symbolic.fast_downward import unified_planning
from bestman_bt.task_planning.symbolic.pddl_reading import PddlError, read_pddl
from bestman_bt.task_planning.symbolic.problem import PlanningError
from bestman_bt.task_planning.symbolic.search import SymbolicPlanner

DOMAINS = Path(__file__).with_suffix("")
MEMORY = 4 << 30
"""Bytes of address space of a planner."""
NOT_READ = 3
"""Exit code of a planner that does not support a file."""
LIMIT, FAST_DOWNWARD_LIMITS = 4, range(20, 25)
"""Exit code of a planner that ran out of time or memory; Fast Downward's own for that."""


def _problem(domain: str, objects: dict[str, Iterable[str]], state: Iterable[str], goal: Iterable[str]) -> str:
    declared = " ".join(f"{' '.join(names)} - {kind}" for kind, names in objects.items())
    return (
        f"(define (problem generated) (:domain {domain})\n  (:objects {declared})\n"
        f"  (:init {' '.join(f'({fact})' for fact in state)})\n"
        f"  (:goal (and {' '.join(f'({fact})' for fact in goal)})))\n"
    )


def blocksworld(size: int, rng: np.random.Generator) -> str:
    """``size`` blocks in random towers, to be stacked into other random towers."""
    blocks = [f"b{number}" for number in range(size)]

    def towers() -> list[list[str]]:
        order = [str(block) for block in rng.permutation(blocks)]
        cuts = sorted(int(cut) for cut in rng.choice(range(1, size), size=size // 4, replace=False))
        return [order[start:end] for start, end in pairwise([0, *cuts, size])]

    state = ["arm-empty"]
    for tower in towers():
        state += [f"on-table {tower[0]}", f"clear {tower[-1]}"]
        state += [f"on {above} {below}" for below, above in pairwise(tower)]
    goal = [f"on {above} {below}" for tower in towers() for below, above in pairwise(tower)]
    return _problem("blocksworld", {"block": blocks}, state, goal)


def gripper(size: int, rng: np.random.Generator) -> str:
    """``size`` balls from one room to the other; the same for each seed."""
    balls = [f"ball{number}" for number in range(size)]
    objects = {"room": ["start", "end"], "ball": balls, "gripper": ["left", "right"]}
    state = ["robot-in start", "free left", "free right", *(f"ball-in {ball} start" for ball in balls)]
    return _problem("gripper", objects, state, [f"ball-in {ball} end" for ball in balls])


def logistics(size: int, rng: np.random.Generator) -> str:
    """``size`` packages between half as many cities of three places, one truck in each, a quarter as many airplanes."""
    cities = [f"city{number}" for number in range(max(2, size // 2))]
    airports = [f"{city}-airport" for city in cities]
    places = [f"{city}-place{number}" for city in cities for number in range(2)]
    trucks = [f"{city}-truck" for city in cities]
    airplanes = [f"airplane{number}" for number in range(max(1, size // 4))]
    packages = [f"package{number}" for number in range(size)]
    everywhere = [*airports, *places]
    objects = {"city": cities, "airport": airports, "place": places}
    objects |= {"truck": trucks, "airplane": airplanes, "package": packages}
    state = [f"in-city {place} {place.partition('-')[0]}" for place in everywhere]
    state += [
        f"at {city}-truck {rng.choice([place for place in everywhere if place.startswith(f'{city}-')])}"
        for city in cities
    ]
    state += [f"at {airplane} {rng.choice(airports)}" for airplane in airplanes]
    goal = []
    for package in packages:
        start, end = rng.choice(everywhere, size=2, replace=False)
        state.append(f"at {package} {start}")
        goal.append(f"at {package} {end}")
    return _problem("logistics", objects, state, goal)


def rovers(size: int, rng: np.random.Generator) -> str:
    """``size`` rovers on a connected graph of 4 + 2 ``size`` waypoints; each kind of data once for each rover."""
    names = [f"rover{number}" for number in range(size)]
    waypoints = [f"w{number}" for number in range(4 + 2 * size)]
    objectives = [f"objective{number}" for number in range(size + 1)]
    modes = ["colour", "high-resolution", "low-resolution"]
    links = [(waypoints[int(rng.integers(number))], waypoints[number]) for number in range(1, len(waypoints))]
    links += [tuple(map(str, rng.choice(waypoints, size=2, replace=False))) for _ in waypoints]
    both = sorted({pair for first, second in links for pair in ((first, second), (second, first))})
    state = [f"visible {first} {second}" for first, second in both]
    state += [f"lander-at base {rng.choice(waypoints)}"]
    for name in names:
        state += [f"at {name} {rng.choice(waypoints)}", f"store-of {name}-store {name}", f"empty {name}-store"]
        state += [f"equipped-for-{what} {name}" for what in ("soil", "rock", "imaging")]
        state += [f"can-traverse {name} {first} {second}" for first, second in both]
        state += [f"camera-of {name}-camera {name}", f"calibration-target {name}-camera {rng.choice(objectives)}"]
        state += [f"supports {name}-camera {mode}" for mode in modes]
    for objective in objectives:
        seen = rng.choice(waypoints, size=2, replace=False)
        state += [f"visible-from {objective} {waypoint}" for waypoint in seen]
    soil, rock = (rng.choice(waypoints, size=size, replace=False) for _ in range(2))
    state += [f"soil-at {waypoint}" for waypoint in soil] + [f"rock-at {waypoint}" for waypoint in rock]
    goal = [f"sent-soil {waypoint}" for waypoint in soil] + [f"sent-rock {waypoint}" for waypoint in rock]
    images = rng.choice(len(objectives) * len(modes), size=size, replace=False)
    goal += [f"sent-image {objectives[int(image) // 3]} {modes[int(image) % 3]}" for image in images]
    objects = {"rover": names, "waypoint": waypoints, "objective": objectives, "mode": modes, "lander": ["base"]}
    objects |= {"store": [f"{name}-store" for name in names], "camera": [f"{name}-camera" for name in names]}
    return _problem("rovers", objects, state, goal)


GENERATORS: dict[str, tuple[Callable[[int, np.random.Generator], str], tuple[int, ...]]] = {
    "blocksworld": (blocksworld, (4, 8, 16, 32)),
    "gripper": (gripper, (4, 8, 16, 32)),
    "logistics": (logistics, (2, 4, 8, 16)),
    "rovers": (rovers, (1, 2, 4, 8)),
}
"""Domain → its generator and the sizes."""


@dataclass(frozen=True)
class Stated:
    """A problem: its group in the table, its files."""

    group: str
    domain: Path
    problem: Path


def generated(folder: Path, seeds: Sequence[int]) -> list[Stated]:
    """Write the problems of all domains into ``folder``."""
    found = []
    for name, (generate, sizes) in GENERATORS.items():
        for size in sizes:
            for seed in seeds[:1] if name == "gripper" else seeds:
                file = folder / f"{name}_{size}_{seed}.pddl"
                file.write_text(generate(size, np.random.default_rng([seed, size])))
                found.append(Stated(f"{name} {size}", DOMAINS / f"{name}.pddl", file))
    return found


def of_embodied_agent_interface(wheel: Path, folder: Path) -> list[Stated]:
    """Unpack the domains and problems of the wheel ``eai-eval`` into ``folder``."""
    inside = "virtualhome_eval/resources/"
    with zipfile.ZipFile(wheel) as archive:
        names = [name for name in archive.namelist() if name.startswith(inside) and name.endswith(".pddl")]
        archive.extractall(folder, names)
    found = []
    for group in ("virtualhome", "behavior"):
        domain = folder / inside / group / f"{group}.pddl"
        found += [Stated(group, domain, file) for file in sorted((domain.parent / "problem_pddl").rglob("*.pddl"))]
    return found


def symbolic(domain: str, problem: str) -> list[str] | None:
    """Our planner; without handing large problems over to Fast Downward."""
    try:
        stated = read_pddl(domain, problem)
    except PddlError as error:
        print(error, file=sys.stderr)
        sys.exit(NOT_READ)
    try:
        plan = SymbolicPlanner(hand_over=0).plan(stated)
    except PlanningError as error:
        print(error, file=sys.stderr)
        return None
    return [f"({' '.join((action.name, *action.arguments))})" for action in plan.actions]


def fast_downward(domain: str, problem: str) -> list[str] | None:
    """Fast Downward's first plan of LAMA (Richter and Westphal, 2010)."""
    spec = importlib.util.find_spec("up_fast_downward")  # its import, which takes longer than a plan, is not needed
    driver = Path(str(spec and spec.origin)).parent / "downward" / "fast-downward.py"
    with tempfile.TemporaryDirectory() as folder:
        command = [
            sys.executable,
            str(driver),
            "--alias",
            "lama-first",
            str(Path(domain).resolve()),
            str(Path(problem).resolve()),
        ]
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
        plan = Path(folder) / "sas_plan"
        if done.returncode < 0 or done.returncode in FAST_DOWNWARD_LIMITS:
            sys.exit(LIMIT)
        if not plan.exists():
            print((done.stderr or done.stdout).strip().splitlines()[-1:], file=sys.stderr)
            return None
        return [line for line in plan.read_text().splitlines() if not line.startswith(";")]


def pyperplan(domain: str, problem: str) -> list[str] | None:
    """pyperplan's greedy best-first search with h_FF."""
    from pyperplan.grounding import ground
    from pyperplan.heuristics.relaxation import hFFHeuristic
    from pyperplan.pddl.parser import Parser
    from pyperplan.search import greedy_best_first_search

    logging.disable(logging.CRITICAL)
    parser = Parser(domain, problem)
    try:
        stated = parser.parse_problem(parser.parse_domain())
    except (Exception, SystemExit) as error:  # noqa: BLE001 - it raises whatever its parser stumbles over
        print(f"{type(error).__name__}: {error}", file=sys.stderr)
        sys.exit(NOT_READ)
    task = ground(stated)
    plan = greedy_best_first_search(task, hFFHeuristic(task), use_relaxed_plan=True)
    return None if plan is None else [operator.name for operator in plan]


PLANNERS = {"symbolic": symbolic, "fast_downward": fast_downward, "pyperplan": pyperplan}
MODULES = {"symbolic": "bestman_bt", "fast_downward": "up_fast_downward", "pyperplan": "pyperplan"}


def measured(planner: str, stated: Stated, limit: int) -> dict[str, Any]:
    """Run a planner in a process of its own.

    ``result``: solved, unsolved, not read, limit (of time or memory), or error. The limit of time holds for each of its
    processes, and for the sum of a plan that counts.
    """

    def restrict() -> None:
        resource.setrlimit(resource.RLIMIT_CPU, (limit, limit))
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))

    command = [sys.executable, __file__, "--one", planner, str(stated.domain), str(stated.problem)]
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    with subprocess.Popen(
        command,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        preexec_fn=restrict,
    ) as process:
        try:
            out, err = process.communicate(timeout=20 * limit)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            return {"result": "limit"}
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    seconds = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    why = (err.strip().splitlines() or [""])[-1]
    if process.returncode == NOT_READ:
        return {"result": "not read", "why": why}
    if process.returncode == LIMIT or process.returncode < 0 or "MemoryError" in why or seconds > limit:
        return {"result": "limit", "seconds": seconds}
    if process.returncode != 0:
        return {"result": "error", "why": why}
    plan = json.loads(out)
    if plan is None:
        return {"result": "unsolved", "seconds": seconds, "why": why}
    return {"result": "solved", "seconds": seconds, "length": len(plan), "valid": _valid(stated, plan)}


def _valid(stated: Stated, plan: Sequence[str]) -> bool | None:
    """Return what unified-planning's validator says of a plan; None: it does not read the files."""
    planning = unified_planning()
    reader = planning.io.PDDLReader()
    try:
        problem = reader.parse_problem(str(stated.domain), str(stated.problem))
    except Exception:  # noqa: BLE001 - it raises whatever its parser stumbles over
        return None
    steps = reader.parse_plan_string(problem, "\n".join(plan))
    with planning.shortcuts.PlanValidator(problem_kind=problem.kind) as validator:
        return bool(validator.validate(problem, steps))


def table(rows: Sequence[dict[str, Any]], planners: Sequence[str]) -> list[dict[str, Any]]:
    """One row per group: problems and, per planner, solved, valid plans, median length and processor time.

    Lengths are medians over the problems that all planners with any plan in the group have solved.
    """
    found = []
    for group in dict.fromkeys(row["group"] for row in rows):
        own = [row for row in rows if row["group"] == group]
        able = [name for name in planners if any(row[name]["result"] == "solved" for row in own)]
        shared = [row for row in own if able and all(row[name]["result"] == "solved" for name in able)]
        entry: dict[str, Any] = {"group": group, "problems": len(own), "solved_by_all": len(shared)}
        for name in planners:
            solved = [row[name] for row in own if row[name]["result"] == "solved"]
            entry[name] = {
                "results": dict(Counter(row[name]["result"] for row in own)),
                "solved": len(solved),
                "valid": sum(one["valid"] is True for one in solved),
                "not_judged": sum(one["valid"] is None for one in solved),
                "length": median(row[name]["length"] for row in shared) if shared and solved else None,
                "seconds": {
                    "median": round(median(one["seconds"] for one in solved), 2),
                    "largest": round(max(one["seconds"] for one in solved), 2),
                }
                if solved
                else None,
            }
        found.append(entry)
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--first-seed", type=int, default=500)
    parser.add_argument("--seeds", type=int, default=5, help="problems of each domain and size")
    parser.add_argument("--limit", type=int, default=30, help="seconds of processor time for each plan")
    parser.add_argument(
        "--eai", type=Path, metavar="FILE.whl", help="the wheel eai-eval: pip download --no-deps eai-eval"
    )
    parser.add_argument("--every", type=int, default=1, help="take each N-th problem only")
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--one", nargs=3, metavar=("PLANNER", "DOMAIN", "PROBLEM"), help=argparse.SUPPRESS)
    asked = parser.parse_args()
    if asked.one:
        planner, domain, problem = asked.one
        print(json.dumps(PLANNERS[planner](domain, problem)))
        return
    planners = [name for name in PLANNERS if importlib.util.find_spec(MODULES[name]) is not None]
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        if asked.eai:
            problems = of_embodied_agent_interface(asked.eai, Path(folder))
        else:
            problems = generated(Path(folder), range(asked.first_seed, asked.first_seed + asked.seeds))
        problems = problems[:: asked.every]
        for number, stated in enumerate(problems, 1):
            row: dict[str, Any] = {"group": stated.group, "problem": stated.problem.stem}
            row |= {name: measured(name, stated, asked.limit) for name in planners}
            rows.append(row)
            told = ", ".join(f"{name} {row[name]['result']}" for name in planners)
            print(f"{number} of {len(problems)} {stated.problem.stem}: {told}", file=sys.stderr, flush=True)
    document = {
        "table": table(rows, planners),
        "limit": {"seconds": asked.limit, "bytes": MEMORY},
        "first_seed": asked.first_seed,
        "seeds": asked.seeds,
        "machine": {"platform": platform.platform(), "cores": os.cpu_count(), "load": round(os.getloadavg()[0], 2)},
        "versions": versions(),
        "problems": rows,
    }
    if asked.json:
        print(json.dumps(document))
        return
    for entry in document["table"]:
        print(entry["group"], f"({entry['problems']})")
        for name in planners:
            print(f"  {name:14} {entry[name]}")


if __name__ == "__main__":
    main()
