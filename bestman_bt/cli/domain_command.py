"""Examples: bestman-bt domain; bestman-bt domain --pddl --task fetch_from_drawer --goal "on(cup, table)" -o folder."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from bestman_bt.cli.options import Json, PlanningOptions, grouped_options, json_output
from bestman_bt.configuration.errors import ConfigurationError
from bestman_bt.configuration.errors import Problem as Fault
from bestman_bt.facts.predicate import Beliefs
from bestman_bt.runtime.plugins import node_registry
from bestman_bt.task_planning.domain import Domain
from bestman_bt.task_planning.state import PredicateError
from bestman_bt.task_planning.symbolic.facts import goal_as_facts
from bestman_bt.task_planning.symbolic.pddl_writing import PddlText
from bestman_bt.task_planning.symbolic.problem import Operator, PlanningProblem


@grouped_options
def command(
    pddl: Annotated[bool, typer.Option("--pddl", help="Print PDDL 2.1: the domain, then the problem.")] = False,
    goal: Annotated[
        str | None, typer.Option(metavar="FACTS", help="For the problem: facts joined by and, or FILE.pddl.")
    ] = None,
    output: Annotated[
        Path | None, typer.Option("-o", metavar="FOLDER", help="Write domain.pddl and problem.pddl there instead.")
    ] = None,
    where: PlanningOptions = PlanningOptions(),
    as_json: Json = False,
) -> None:
    """Show the actions of task planners, the predicates for goals, and the initial beliefs of the robot in a scene."""
    if output is not None and not pddl:
        raise ConfigurationError([Fault("-o", None, "", "is for --pddl")])
    if not (pddl or as_json or goal) and where == PlanningOptions(plugins=where.plugins):
        _show_domain(Domain.of(node_registry([str(plugin) for plugin in where.plugins or ()])))
        print("\nObjects and beliefs are those of a scene: name a --scene, --task or --world")
        return
    from bestman_bt.runtime.planning import planning_state

    goal = None if goal is None else goal_as_facts(goal)
    setup, beliefs = planning_state(where.request, where.world)
    asked = None if setup.config.task is None else setup.config.task.asked("facts")
    if goal is None and asked is not None:
        goal = str(asked["goal"])
    domain = Domain.of(setup.registry)
    try:
        problem = domain.problem(Beliefs(beliefs), goal)
    except PredicateError as error:
        print(f"bestman-bt: {error}", file=sys.stderr)
        sys.exit(1)
    with json_output(as_json) as print_json:
        if pddl:
            _write(problem, output)
            if goal is None:
                forms = 'facts come from --goal, as "on(cup, table)", or from a task of that kind of goal'
                print(f"the goal is empty: {forms}", file=sys.stderr)
        elif not as_json:
            _show_domain(domain)
            _show_problem(problem)
        print_json(_document(domain, problem))


def _write(problem: PlanningProblem, folder: Path | None) -> None:
    text = PddlText(problem)
    if folder is None:
        sys.stdout.write(text.domain() + "\n" + text.problem())
        return
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "domain.pddl").write_text(text.domain(), encoding="utf-8")
    (folder / "problem.pddl").write_text(text.problem(), encoding="utf-8")


def _show_domain(domain: Domain) -> None:
    print("Abilities")
    for ability in domain.abilities:
        operator = ability.operator
        parameters = ", ".join(f"{name}: {kind}" for name, kind in operator.parameters.items())
        print(f"  {ability.name}({parameters}): {ability.description}")
        for title, text in _declared(operator).items():
            print(f"      {title}: {text}")
    print("\nPredicates")
    for name, types in sorted(domain.signatures.items()):
        known = domain.predicates.get(name)
        print(f"  {name}({', '.join(types)}): {known.words if known else 'set by the effects of abilities'}")


def _show_problem(problem: PlanningProblem) -> None:
    print("\nThings")
    for kind in sorted(set(problem.objects.values())):
        print(f"  {kind}: {', '.join(name for name, own in problem.objects.items() if own == kind)}")
    print("\nBelieved")
    for fact in sorted(problem.state):
        print(f"  {fact}")


def _declared(operator: Operator) -> dict[str, str]:
    conditions = {"needs": operator.pre, "all the way": operator.hold, "brings about": operator.effects}
    texts = {title: "; ".join(map(str, these)) for title, these in conditions.items() if these}
    return {**texts, "cost": f"{operator.cost:g}", "keeps busy": ", ".join(operator.parts)}


def _document(domain: Domain, problem: PlanningProblem) -> dict[str, object]:
    return {
        "abilities": [
            {
                "name": ability.name,
                "parameters": dict(ability.operator.parameters),
                "pre": [str(one) for one in ability.operator.pre],
                "hold": [str(one) for one in ability.operator.hold],
                "effects": [str(one) for one in ability.operator.effects],
                "cost": ability.operator.cost,
                "parts": list(ability.operator.parts),
                "description": ability.description,
            }
            for ability in domain.abilities
        ],
        "predicates": {name: list(types) for name, types in domain.signatures.items()},
        "objects": dict(problem.objects),
        "state": [str(fact) for fact in sorted(problem.state)],
        "goal": [str(literal) for literal in problem.goal],
    }
