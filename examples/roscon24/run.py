"""Run the problems of the ROSCon 2024 deliberation workshop: its own trees, or trees planned from the goals.

python examples/roscon24/run.py --data roscon24 --problem 4 --seeds 50 --json             # its tree, unchanged
python examples/roscon24/run.py --data roscon24 --problem 4 --seeds 50 --json --planned   # from the goal alone

``--data``: a folder with the workshop's worlds/ and trees/. Needs the extra: pip install 'bestman-bt[pyrobosim]'.
"""

from __future__ import annotations

import argparse
import json
import logging
import statistics
import sys
import time
from pathlib import Path
from typing import Any

from bestman_bt.engine import RUNNING, SUCCESS, Tree, XmlDocument, XmlElement, load_tree
from bestman_bt.task_planning.builders.reactive import ReactiveBuilder
from bestman_bt.task_planning.symbolic.facts import parse_literals
from bestman_bt.task_planning.symbolic.problem import Literal, PlanningError, PlanningProblem
from bestman_bt.task_planning.symbolic.search import SymbolicPlanner

try:
    from leaves import ENOUGH, operators, registry
    from workshop_world import WorkshopWorld
except ModuleNotFoundError as error:
    if error.name != "pyrobosim":
        raise
    sys.exit("pyrobosim is missing: pip install 'bestman-bt[pyrobosim]'")

WASTE = "on(waste0, dumpster_disposal); on(waste1, dumpster_disposal); not open(dumpster)"
MEAL = "on(bread0, table_tabletop); on(butter0, table_tabletop); not open(fridge); not open(pantry)"
GOALS = {1: "on(snacks0, table_tabletop)", 2: WASTE, 3: MEAL, 4: f"{WASTE}; {MEAL}"}
"""The workshop's own conditions (delib_ws_worlds/is_at_goal.py)."""
PERIOD = 0.01
"""Seconds between ticks, as the workshop's executor."""
MOST_PLANS = 20
"""Plans for one episode, the first included."""


def execute(tree: Tree, world: WorkshopWorld) -> int:
    """Tick the tree to its end; the battery level is on the root blackboard, as the workshop's executor writes it."""
    status = RUNNING
    while status == RUNNING:
        tree.blackboard.set("battery_level", world.battery)
        status = tree.tick_once()
        if status == RUNNING:
            tree.sleep(PERIOD)
    return status


def planned(world: WorkshopWorld, goal: tuple[Literal, ...]) -> tuple[int, int]:
    """Plan, run the plan's tree, and plan again as long as it fails; the last status and the number of plans."""
    nodes, abilities, status, plans = registry(), operators(world), RUNNING, 0
    while status != SUCCESS and plans < MOST_PLANS:
        problem = PlanningProblem(world.objects(), world.facts(ENOUGH), goal, abilities, {"charger": ("location",)})
        try:
            plan = SymbolicPlanner().plan(problem)
        except PlanningError:
            break
        plans += 1
        root = ReactiveBuilder().build(plan, goal, [operator.name for operator in abilities]).element
        tree = XmlElement("BehaviorTree", {"ID": "Planned"}, [root])
        document = XmlDocument([XmlElement("root", {"BTCPP_format": "4"}, [tree])])
        status = execute(load_tree(document.to_xml(), nodes, context=world), world)
    return status, plans


def episode(data: Path, problem: int, seed: int, from_goal: bool, speed: float) -> dict[str, Any]:
    """Run one seed and judge it by the workshop's conditions."""
    world = WorkshopWorld(data / "worlds" / f"world{problem}.yaml", seed, speed)
    goal = parse_literals(GOALS[problem])
    started, plans = time.process_time(), 0
    if from_goal:
        status, plans = planned(world, goal)
    else:
        tree = load_tree(data / "trees" / f"problem{problem}.xml", registry(), context=world, main_tree="MainTree")
        status = execute(tree, world)
    state = world.facts(ENOUGH)
    unmet = [str(literal) for literal in goal if not literal.holds_in(state)]
    return {
        "seed": seed,
        "succeeded": not unmet and not world.empty,
        "tree": "success" if status == SUCCESS else "failure",
        "unmet": unmet,
        "battery_empty": world.empty,
        "actions": world.actions,
        "battery": round(world.battery, 1),
        **({"plans": plans} if from_goal else {}),
        "processor_s": round(time.process_time() - started, 3),
    }


def main() -> None:
    """Parse the command line, run the episodes, print the result."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, required=True, metavar="DIR", help="the workshop's worlds/ and trees/")
    parser.add_argument("--problem", type=int, required=True, choices=GOALS)
    parser.add_argument("--seeds", type=int, default=1, metavar="N", help="seeds 0 to N - 1")
    parser.add_argument("--first-seed", type=int, default=0, metavar="N")
    parser.add_argument(
        "--planned", action="store_true", help="plan a tree from the goal; default: the workshop's tree"
    )
    parser.add_argument("--speed", type=float, default=-1.0, help="times real time; default: as fast as possible")
    parser.add_argument("--json", action="store_true", help="print one JSON document")
    asked = parser.parse_args()
    needed = [asked.data / "worlds" / f"world{asked.problem}.yaml"]
    needed += [] if asked.planned else [asked.data / "trees" / f"problem{asked.problem}.xml"]
    for file in needed:
        if not file.is_file():
            parser.error(f"--data: there is no {file}")
    if asked.seeds < 1 or asked.speed == 0.0:
        parser.error("--seeds should be at least 1, --speed not 0")
    logging.disable(logging.WARNING)  # PyRoboSim logs every action
    episodes = []
    for seed in range(asked.first_seed, asked.first_seed + asked.seeds):
        episodes.append(episode(asked.data, asked.problem, seed, asked.planned, asked.speed))
        if not asked.json:
            print(episodes[-1], flush=True)
    document = {
        "problem": asked.problem,
        "tree": "planned" if asked.planned else "the workshop's",
        "goal": GOALS[asked.problem],
        "succeeded": sum(one["succeeded"] for one in episodes),
        "of": len(episodes),
        "actions_median": statistics.median(one["actions"] for one in episodes),
        "battery_median": statistics.median(one["battery"] for one in episodes),
        "episodes": episodes,
    }
    if asked.json:
        print(json.dumps(document, indent=2))
    else:
        print(f"{document['succeeded']} of {document['of']} succeeded")


if __name__ == "__main__":
    main()
