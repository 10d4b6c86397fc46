"""How the time of each part grows: sizes doubled three times, processor time measured, the exponent fitted.

    python -m benchmarks.growth --json                  # all
    python -m benchmarks.growth engine page --json      # some

The exponent is the slope of log(time) over log(size), by least squares, in processor time of this process: 1 is linear,
n·log n shows as at most ``MOST`` over these sizes. A part beyond that fails, but for those in ``HARD``, whose problem
allows no better.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import sys
import tempfile
import time
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

from bestman_bt.engine import NodeRegistry, load_tree, render_ports
from bestman_bt.engine.validation import tree_warnings
from bestman_bt.messages import Pose2D

SEED = 7
MOST = 1.35
REPEATS = 3
"""The quickest of so many counts."""
HARD = {
    "grounding": "every ground action is one: objects² moves",
    "builder": "the tree asks before each step for all that the rest of the plan needs: steps × facts",
}
Work = Callable[[], object]

MAIN = '<root BTCPP_format="4" main_tree_to_execute="Main"><BehaviorTree ID="Main"><Sequence>'
END = "</Sequence></BehaviorTree></root>"


def engine(size: int) -> Work:
    """One tick of a sequence of so many leaves."""
    tree = load_tree(MAIN + "<AlwaysSuccess/>" * size + END, NodeRegistry())
    return tree.tick_exactly_once


def loading(size: int) -> Work:
    """A tree of so many nodes is read and checked."""
    text = MAIN + "".join(f'<Script code="a{i} := {i}"/>' for i in range(size)) + END
    return lambda: load_tree(text, NodeRegistry())


def validate(size: int) -> Work:
    """Number of entries that are read but never written."""
    tree = load_tree(MAIN + "".join(f'<Script code="w{i} := r{i}x"/>' for i in range(size)) + END, NodeRegistry())
    return lambda: tree_warnings(tree)


def ports(size: int) -> Work:
    """``show --ports`` of so many nodes."""
    tree = load_tree(MAIN + "".join(f'<Script code="w{i} := r{i}x"/>' for i in range(size)) + END, NodeRegistry())
    return lambda: render_ports(tree)


def _costmap(cells: int, obstacles: int) -> Any:
    from bestman_bt.messages import OccupancyGrid
    from bestman_bt.navigation.global_planning.costmap import Costmap
    from bestman_bt.navigation.global_planning.footprint import Footprint
    from bestman_bt.robot_model.compose import load_robot_model
    from bestman_bt.robot_model.model import BaseModel

    rng = np.random.default_rng(SEED)
    data = np.zeros((cells, cells), dtype=np.int8)
    for row, column in rng.integers(2, cells - 12, size=(obstacles, 2)):
        data[row : row + 6, column : column + 6] = 100
    data[:20, :20] = data[-20:, -20:] = 0
    (base,) = load_robot_model("diff_panda").of(BaseModel).values()
    grid = OccupancyGrid(data, 0.05, np.zeros(2))
    return lambda: Costmap.from_grid(grid, Footprint.of(base))


def costmap(size: int) -> Work:
    """A map of so many cells becomes a costmap."""
    make: Work = _costmap(round(size**0.5), size // 4000)
    return make


def planner(size: int) -> Work:
    """The shortest way over a costmap of so many cells, from corner to corner."""
    from bestman_bt.navigation.global_planning.polyline_planner import GridAStar

    side = round(size**0.5)
    known, far = _costmap(side, size // 4000)(), (side - 10) * 0.05
    return lambda: GridAStar().plan(Pose2D(0.5, 0.5, 0.0), Pose2D(far, far, 0.0), known)


def _logistics(packages: int) -> Any:
    from bestman_bt.task_planning.symbolic.pddl_reading import read_pddl

    domain = """(define (domain carry) (:requirements :strips :typing) (:types thing place)
      (:predicates (at ?t - thing ?p - place) (free) (held ?t - thing))
      (:action take :parameters (?t - thing ?p - place) :precondition (and (at ?t ?p) (free))
        :effect (and (held ?t) (not (at ?t ?p)) (not (free))))
      (:action put :parameters (?t - thing ?p - place) :precondition (held ?t)
        :effect (and (at ?t ?p) (free) (not (held ?t)))))"""
    things, places = range(packages), range(max(2, packages // 4))
    problem = f"""(define (problem p) (:domain carry)
      (:objects {" ".join(f"t{i}" for i in things)} - thing {" ".join(f"p{i}" for i in places)} - place)
      (:init (free) {" ".join(f"(at t{i} p{i % len(places)})" for i in things)})
      (:goal (and {" ".join(f"(at t{i} p{(i + 1) % len(places)})" for i in things)})))"""
    with tempfile.TemporaryDirectory() as folder:
        files = Path(folder, "domain.pddl"), Path(folder, "problem.pddl")
        for file, text in zip(files, (domain, problem), strict=True):
            file.write_text(text)
        return read_pddl(*files)


def grounding(size: int) -> Work:
    """So many things and a quarter as many places."""
    from bestman_bt.task_planning.symbolic.grounding import ground

    problem = _logistics(size)
    return lambda: ground(problem)


def builder(size: int) -> Work:
    """The default tree of a plan of so many steps."""
    from bestman_bt.task_planning.builders.reactive import ReactiveBuilder
    from bestman_bt.task_planning.symbolic.grounding import ground
    from bestman_bt.task_planning.symbolic.problem import TaskPlan

    problem = _logistics(size // 2)
    by_words = {(action.name, *action.arguments): action for action in ground(problem).actions}
    actions = []
    for literal in problem.goal:
        thing, place = literal.fact.arguments
        start = next(fact.arguments[1] for fact in problem.state if fact.arguments[:1] == (thing,))
        actions += [by_words["take", thing, start], by_words["put", thing, place]]
    plan, goal = TaskPlan(tuple(actions)), problem.goal
    return lambda: ReactiveBuilder().build(plan, goal)


def slam(size: int) -> Work:
    """A pose graph of so many poses with a closed loop."""
    from bestman_bt.navigation.slam.pose_graph import Constraint, PoseGraph

    def solve() -> None:
        rng, graph = np.random.default_rng(SEED), PoseGraph()
        graph.add_pose(Pose2D())
        information = np.diag([1e4, 1e4, 1e4])
        for index in range(size - 1):
            turn = 2.0 * np.pi / size
            moved = Pose2D(0.3, 0.0, turn) @ Pose2D(*(0.01 * rng.standard_normal(3)).tolist())
            node = graph.add_pose(graph.pose(index) @ moved)
            graph.add_constraint(Constraint(index, node, moved, information))
        graph.add_constraint(Constraint(size - 1, 0, Pose2D(0.3, 0.0, 2.0 * np.pi / size), information, doubtful=True))
        graph.optimize()

    return solve


def _history(nodes: int, changes: int) -> Any:
    from bestman_bt.records.described_tree import describe_tree
    from bestman_bt.records.events import StatesEvent
    from bestman_bt.records.history import RunHistory

    tree = load_tree(MAIN + "<AlwaysSuccess/>" * (nodes - 1) + END, NodeRegistry())
    history = RunHistory()
    history.take(describe_tree(tree))
    for tick in range(changes // nodes):
        history.take(StatesEvent(tick * 0.05, tick, [(uid, 2 + tick % 2) for uid in range(1, nodes + 1)], {}))
    return history


def events(size: int) -> Work:
    """So many changes of state become a run's history."""
    return lambda: _history(100, size)


def page(size: int) -> Work:
    """What a page is told after a tick in which so many nodes have changed."""
    from bestman_bt.monitor.viewer import Updates
    from bestman_bt.records.events import StatesEvent

    history = _history(size, size * 4)

    run: Any = SimpleNamespace(id="run", is_live=True, history=history)
    updates, ticks = Updates(run), iter(range(10**9))
    updates.messages(0.0)

    def tick() -> None:
        now = next(ticks)
        history.take(StatesEvent(10.0 + now * 0.05, now, [(uid, 2 + now % 2) for uid in range(1, size + 1)], {}))
        json.dumps(updates.messages(10.0 + now))

    return tick


def report(size: int) -> Work:
    """A run folder with so many changes of state is read."""
    from bestman_bt.records.events import RunEvent, StatesEvent
    from bestman_bt.records.reader import read
    from bestman_bt.records.writer import RunLogWriter

    folder = Path(tempfile.mkdtemp(prefix="growth-"))
    tree = load_tree(MAIN + "<AlwaysSuccess/>" * 99 + END, NodeRegistry())
    run = RunEvent("growth", "t", "", "", 0, str(folder), 1, 1.7e9, 20.0, "simulated")
    log = RunLogWriter(folder, tree, run)
    log.write(run)
    for tick in range(size // 100):
        log.write(StatesEvent(tick * 0.05, tick, [(uid, 2 + tick % 2) for uid in range(1, 101)], {}))
    log.close()
    return lambda: read(folder)


def sessions(size: int) -> Work:
    """So many sessions, one after the other; what Python keeps of each is in ``kept``."""
    from bestman_bt.runtime.robot_session import session

    def run() -> None:
        for _ in range(size):
            with session(scene="kitchen", seed=SEED) as opened:
                opened.robot.clock.sleep(0.05)

    return run


PARTS: dict[str, tuple[Callable[[int], Work], int]] = {
    "engine": (engine, 4_000),
    "loading": (loading, 1_000),
    "validate": (validate, 500),
    "ports": (ports, 4_000),
    "planner": (planner, 10_000),
    "builder": (builder, 8),
    "grounding": (grounding, 16),
    "costmap": (costmap, 20_000),
    "slam": (slam, 100),
    "events": (events, 25_000),
    "page": (page, 1_250),
    "report": (report, 50_000),
    "sessions": (sessions, 1),
}
"""What grows, and its smallest size."""


def measured(make: Callable[[int], Work], smallest: int) -> dict[str, Any]:
    """Seconds of processor time by size, and the exponent."""
    sizes = [smallest * 2**power for power in range(4)]
    seconds = []
    for size in sizes:
        work, least = make(size), float("inf")
        for _ in range(REPEATS):
            began = time.process_time()
            work()
            least = min(least, time.process_time() - began)
        seconds.append(least)
    exponent = float(np.polyfit(np.log(sizes), np.log(np.maximum(seconds, 1e-6)), 1)[0])
    return {"sizes": sizes, "seconds": [round(value, 5) for value in seconds], "exponent": round(exponent, 2)}


def kept_per_session(count: int = 5) -> float:
    """Megabytes of this process that are not given back, per session, after the first two."""
    run = sessions(1)
    run()
    run()
    page_size = os.sysconf("SC_PAGE_SIZE")

    def resident() -> int:
        return int(Path("/proc/self/statm").read_text().split()[1]) * page_size

    before = resident()
    for _ in range(count):
        run()
    return (resident() - before) / count / 1e6


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("parts", nargs="*", metavar="PART", help=f"of {', '.join(PARTS)}; all by default")
    parser.add_argument("--json", action="store_true")
    asked = parser.parse_args()
    if unknown := set(asked.parts) - set(PARTS):
        parser.error(f"there is no part {', '.join(sorted(unknown))}; there are {', '.join(PARTS)}")
    table: dict[str, Any] = {}
    for name in asked.parts or PARTS:
        table[name] = measured(*PARTS[name])
        if name == "sessions":
            table[name]["kept_mb"] = round(kept_per_session(), 2)
        if not asked.json:
            print(f"{name:10} {table[name]['exponent']:5.2f}  {table[name]['seconds']}", flush=True)
    beyond = [name for name, row in table.items() if row["exponent"] > MOST and name not in HARD]
    document = {
        "parts": table,
        "beyond": beyond,
        "most": MOST,
        "hard": HARD,
        "seed": SEED,
        "machine": {"processors": os.cpu_count(), "kind": platform.machine(), "python": platform.python_version()},
        "versions": {name: version(name) for name in ("bestman-bt", "numpy", "py-trees", "pybullet")},
    }
    print(json.dumps(document, indent=1) if asked.json else f"beyond {MOST}: {', '.join(beyond) or 'none'}")
    sys.exit(bool(beyond))


if __name__ == "__main__":
    main()
