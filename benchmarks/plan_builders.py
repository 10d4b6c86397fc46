"""Trees of plans in disturbed symbolic worlds: sequence, reactive and back-chained, with and without planning anew.

    python benchmarks/plan_builders.py --problems 200 --seed 7000 > plan_builders.json

Each problem: things in drawers and on tables are to go elsewhere, and some drawers to be shut at the end. The robot
believes what it has seen. With each action, one of these happens with the given chance, behind its back: what is held
slips and lies on a table; an object is put elsewhere; a drawer is pushed shut. With half that chance the action fails
for no reason. It learns of all this where an action is about it. A problem counts as reached where the goal is true at
the end, whatever is believed.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Annotated, Any

import numpy as np
import typer

from bestman_bt.engine import RUNNING, SUCCESS, NodeRegistry
from bestman_bt.evaluation.interval import wilson_interval
from bestman_bt.registry import BUILDERS
from bestman_bt.task_planning.domain import Domain
from bestman_bt.task_planning.simulation import SymbolicWorld, load_simulated
from bestman_bt.task_planning.state import SUPERTYPES
from bestman_bt.task_planning.symbolic.problem import Action, Fact, Literal, PlanningError, PlanningProblem
from bestman_bt.task_planning.symbolic.search import SymbolicPlanner

REPLANS = 6
MAX_TICKS = 4000
KNOWLEDGE = frozenset({"located", "unseen"})
"""Predicates of what the robot knows, not of what is so."""


@dataclass
class DisturbedWorld(SymbolicWorld):
    """``state`` is what the robot believes, ``truth`` what is so; ``chance``: of a disturbance with each action."""

    truth: frozenset[Fact] = frozenset()
    rng: np.random.Generator = field(default_factory=np.random.default_rng)
    chance: float = 0.0
    disturbances: int = 0

    def finish(self, action: Action) -> str:
        """Does it work out? The robot sees what it works on, so it believes afterwards what is true of that."""
        if self.rng.random() < self.chance:
            self._disturb()
        why = self._obstacle(action)
        if not why:
            self.truth = frozenset(fact for fact in action.applied_to(self.truth) if fact.predicate not in KNOWLEDGE)
            self.state = action.applied_to(self.state)
            self.done.append(action)
        self._notice(action)
        return why

    def _obstacle(self, action: Action) -> str:
        """Why an action fails, or nothing. A search changes nothing: it finds what is there."""
        if action.name == "Search" and Fact("on", action.arguments) not in self.truth:
            return "it is not there"
        needs = sorted(need for need in action.pre if need.fact.predicate not in KNOWLEDGE)
        broken = [str(need) for need in needs if not need.holds_in(self.truth)]
        if broken:
            return f"it needs {' and '.join(broken)}"
        return "it failed" if self.rng.random() < self.chance / 2 else ""

    @property
    def reached(self) -> bool:
        """Whether the goal is true, whatever is believed."""
        return not self.problem.unmet_in(self.truth)

    def _disturb(self) -> None:
        """One of the disturbances that are possible now."""
        held = [fact for fact in self.truth if fact.predicate == "holding"]
        lying = sorted(fact for fact in self.truth if fact.predicate == "on")
        ajar = sorted(fact for fact in self.truth if fact.predicate == "open")
        kinds: list[Callable[[], None]] = []
        if held:
            kinds.append(lambda: self._put(held[0], self._free_place()))
        if lying:
            kinds.append(lambda: self._put(lying[int(self.rng.integers(len(lying)))], self._free_place()))
        if ajar:
            kinds.append(lambda: self._shut(ajar[int(self.rng.integers(len(ajar)))]))
        if kinds:
            self.disturbances += 1
            kinds[int(self.rng.integers(len(kinds)))]()

    def _put(self, fact: Fact, place: str) -> None:
        """An object lies on a place, wherever it was."""
        name = fact.arguments[0]
        if fact.predicate == "holding":
            self.truth = self.truth | {Fact("hand_empty")}
        self.truth = (self.truth - {fact}) | {Fact("on", (name, place))}

    def _shut(self, fact: Fact) -> None:
        self.truth = (self.truth - {fact}) | {Fact("closed", fact.arguments)}

    def _free_place(self) -> str:
        tables = [name for name in self.problem.of_type("place") if name.startswith("table")]
        return tables[int(self.rng.integers(len(tables)))]

    def _notice(self, action: Action) -> None:
        """The hand is felt; doors and objects that the action is about are seen; a lost object may be anywhere."""
        about = set(action.arguments)
        before = self.truth | self.state
        doors = about | {
            fact.arguments[1] for fact in before if fact.predicate == "behind" and fact.arguments[0] in about
        }
        seen = {fact for fact in before if fact.predicate in {"holding", "hand_empty", "near", "tucked"}}
        seen |= {fact for fact in before if fact.predicate in {"open", "closed"} and fact.arguments[0] in doors}
        seen |= {
            fact for fact in before if fact.predicate == "on" and fact.arguments[1] in about and self._reveals(fact)
        }
        lost = self.state
        self.state = (self.state - seen) | (seen & self.truth)
        self._lose(action, lost)

    def _reveals(self, fact: Fact) -> bool:
        """Whether what is on a place can be seen: all drawers before it are open."""
        behind = [
            other.arguments[1]
            for other in self.truth
            if other.predicate == "behind" and other.arguments[0] == fact.arguments[1]
        ]
        return all(Fact("open", (name,)) in self.truth for name in behind)

    def _lose(self, action: Action, before: frozenset[Fact]) -> None:
        """Of what is not where it was believed, nothing is known but where it is not."""
        for name in self.problem.of_type("object"):
            known = any(fact.predicate in {"on", "holding"} and fact.arguments[0] == name for fact in self.state)
            unseen = frozenset(Fact("unseen", (name, place)) for place in self.problem.of_type("place"))
            here = frozenset(fact for fact in unseen if fact.arguments[1] in action.arguments and self._reveals(fact))
            located = frozenset({Fact("located", (name,))})
            if known:
                self.state = (self.state - unseen) | located
            else:
                self.state = ((self.state | unseen if located <= before else self.state) - located) - here


@dataclass(frozen=True)
class Outcome:
    """``reached``: whether the goal is true at the end. ``actions``, ``plans``: how many there were."""

    reached: bool
    actions: int
    plans: int
    disturbances: int


def episode(
    problem: PlanningProblem, truth: frozenset[Fact], builder: str, anew: bool, chance: float, seed: int
) -> Outcome:
    """Plan, act, and plan anew where that is allowed and the tree fails."""
    world = DisturbedWorld(problem, truth=truth, rng=np.random.default_rng([seed, 3]), chance=chance)
    maker, planner, plans = BUILDERS.resolve(builder)(), SymbolicPlanner(), 0
    while True:
        believed = replace(problem, state=world.state)
        try:
            plan = planner.plan(believed)
            plans += 1
            tree = load_simulated(maker.build(plan, problem.goal).document().to_xml(), world, NodeRegistry())
        except PlanningError:
            break
        status = tree.tick_while_running(max_ticks=MAX_TICKS)
        if status == RUNNING:
            tree.halt()
        if status == SUCCESS or not anew or plans > REPLANS:
            break
    return Outcome(world.reached, len(world.done), plans, world.disturbances)


def generated(domain: Domain, unknown: float, seed: int) -> tuple[PlanningProblem, frozenset[Fact]]:
    """A problem as it is believed, and what is true; ``unknown``: the share of things that are to be found first."""
    rng = np.random.default_rng([seed, 1])
    tables = [f"table_{i}" for i in range(int(rng.integers(2, 4)))]
    drawers = [f"drawer_{i}" for i in range(int(rng.integers(1, 4)))]
    things = [f"thing_{i}" for i in range(int(rng.integers(1, 5)))]
    places = tables + drawers
    objects = dict.fromkeys(things, "object") | dict.fromkeys(tables, "place") | dict.fromkeys(drawers, "drawer")
    known = {Fact("hand_empty"), Fact("tucked")}
    for drawer in drawers:
        known |= {Fact("behind", (drawer, drawer)), Fact("closed", (drawer,))}
    truth, believed, goal = set(known), set(known), []
    for name in things:
        start, end = rng.choice(places, 2, replace=False)
        truth.add(Fact("on", (name, str(start))))
        if rng.random() >= unknown:
            believed |= {Fact("on", (name, str(start))), Fact("located", (name,))}
        else:
            believed |= {Fact("unseen", (name, place)) for place in places}
        goal.append(Literal(Fact("on", (name, str(end)))))
    goal += [Literal(Fact("closed", (drawer,))) for drawer in drawers if rng.random() < 0.5]
    problem = PlanningProblem(objects, frozenset(believed), tuple(goal), domain.operators, SUPERTYPES)
    return problem, frozenset(truth)


def summary(outcomes: list[Outcome]) -> dict[str, Any]:
    """Success with its 95 % interval, and means."""
    reached = sum(outcome.reached for outcome in outcomes)
    low, high = wilson_interval(reached, len(outcomes))
    return {
        "reached": reached,
        "problems": len(outcomes),
        "interval": [round(low, 3), round(high, 3)],
        "actions": round(float(np.mean([outcome.actions for outcome in outcomes])), 2),
        "plans": round(float(np.mean([outcome.plans for outcome in outcomes])), 2),
        "disturbances": round(float(np.mean([outcome.disturbances for outcome in outcomes])), 2),
    }


def main(
    problems: Annotated[int, typer.Option(min=1)] = 200,
    seed: int = 0,
    unknown: Annotated[float, typer.Option(help="Share of things that are to be found first.")] = 0.0,
    chances: Annotated[str, typer.Option(help="Chances of a disturbance with each action.")] = "0,0.1,0.2",
) -> None:
    """Print one JSON document."""
    domain = Domain.of(NodeRegistry())
    table: dict[str, Any] = {"problems": problems, "seed": seed, "unknown": unknown, "replans": REPLANS, "results": []}
    made = [generated(domain, unknown, number) for number in range(seed, seed + problems)]
    for chance in map(float, chances.split(",")):
        for builder in ("sequence", "reactive", "backchain"):
            for anew in (False, True):
                outcomes = [
                    episode(problem, truth, builder, anew, chance, number)
                    for number, (problem, truth) in enumerate(made, seed)
                ]
                row = {"chance": chance, "builder": builder, "planning_anew": anew, **summary(outcomes)}
                table["results"].append(row)
    print(json.dumps(table, indent=1))


if __name__ == "__main__":
    typer.run(main)
