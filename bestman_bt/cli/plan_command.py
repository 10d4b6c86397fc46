"""Examples: bestman-bt plan --goal "on(mug, table) and closed(drawer_chest/drawer_3)" --builder reactive -o tree.xml;
bestman-bt plan "bring the mug from the drawer to the table" --planner language --run. Exit code 1: there is no plan."""

from __future__ import annotations

import dataclasses
import sys
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from bestman_bt.cli.json_output import json_output
from bestman_bt.cli.log_output import shown_log
from bestman_bt.cli.options import Json, Plugins, Robot, Scene, Seed, Settings
from bestman_bt.cli.planning_config import planning_config
from bestman_bt.configuration import ConfigurationError, Problem, RunConfig
from bestman_bt.engine import render_svg
from bestman_bt.registry import BUILDERS, PLANNERS
from bestman_bt.task_planning.builders import PlanTree, TreeBuilder
from bestman_bt.task_planning.builders.replanning import with_replanning
from bestman_bt.task_planning.domain import Domain
from bestman_bt.task_planning.limits import PlanLimits, plan_within
from bestman_bt.task_planning.predicates import Beliefs
from bestman_bt.task_planning.simulation import folded
from bestman_bt.task_planning.symbolic import GoalError, PlanningError, TaskPlan
from bestman_bt.task_planning.symbolic import Problem as PlanningProblem
from bestman_bt.task_planning.symbolic.facts import parse_literals
from bestman_bt.task_planning.verification import verify

if TYPE_CHECKING:
    from bestman_bt.runtime import Setup


def command(
    text: Annotated[str | None, typer.Argument(metavar="[TEXT]", help="What is wanted, in words.")] = None,
    goal: Annotated[str | None, typer.Option(metavar="FACTS", help="What is wanted, as facts joined by and.")] = None,
    planner: Annotated[str, typer.Option(help="symbolic, fast_downward, language, or one of your own.")] = "symbolic",
    builder: Annotated[str, typer.Option(help="reactive, sequence or backchain.")] = "reactive",
    output: Annotated[Path | None, typer.Option("-o", metavar="FILE.xml", help="Where the tree is written.")] = None,
    svg: Annotated[
        Path | None, typer.Option(metavar="FILE.svg", help="Draw the tree, each ability as one box.")
    ] = None,
    run: Annotated[bool, typer.Option("--run", help="Run it at once, and plan anew where it fails.")] = False,
    task: Annotated[str | None, typer.Option(help="The task in whose scene, with whose robot, and judge.")] = None,
    scene: Scene = None,
    robot: Robot = None,
    seed: Seed = 0,
    world: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Facts that are believed beside the map: a line each.")
    ] = None,
    record: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Write what was said to and by the language model.")
    ] = None,
    replay: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Take the language model's answers from such a file.")
    ] = None,
    limits: Annotated[
        str,
        typer.Option(metavar="LIMITS", help="For a plan: 'steps=20; only=PickUp, PutDown; without=fridge'."),
    ] = "",
    settings: Settings = None,
    plugins: Plugins = None,
    runs: Annotated[Path, typer.Option(help="Where run folders are made.")] = Path("runs"),
    as_json: Json = False,
) -> None:
    """Plan for a goal, make a tree of the plan, and check it."""
    if (text is None) == (goal is None):
        raise ConfigurationError([Problem("bestman-bt plan", None, "", "give a text or --goal, one of them")])
    if run and world is not None:
        raise ConfigurationError([Problem(f"--world {world}", None, "", "is for planning; --run has its own beliefs")])
    allowed = _limits(limits)
    from bestman_bt.runtime import prepare

    with json_output(as_json) as tell:
        PLANNERS.resolve(planner)
        made_by: TreeBuilder = BUILDERS.resolve(builder)()
        config = planning_config(task, scene, robot, seed, settings, plugins)
        setup = prepare(config)
        asked = _Question(setup, made_by, world, allowed)
        try:
            problem, plan = asked.answer(text, goal, planner, record, replay)
            made = asked.tree(problem, plan)
        except GoalError:
            raise
        except PlanningError as error:
            tell({"plan": None, "why": str(error)})
            print(f"no plan: {error}", file=sys.stderr)
            sys.exit(1)
        faults = asked.faults(problem, made)
        refused = [fault for fault in faults if fault.severity != "warning"]
        for fault in faults:
            print(fault, file=sys.stderr)
        document = _document(problem, plan, planner, builder, [str(fault) for fault in faults])
        if not as_json:
            _show(plan)
        if refused:
            tell(document)
            sys.exit(1)
        if output is not None:
            output.write_text(made.xml(setup.registry), encoding="utf-8")
        if svg is not None:
            svg.write_text(render_svg(folded(made, problem)), encoding="utf-8")
        if run:
            document["run"], code = _run(setup, config, made, problem, planner, builder, allowed, runs)
            tell(document)
            sys.exit(code)
        tell(document)


class _Question:
    """A goal in a state, and who is to reach it."""

    def __init__(self, setup: Setup, builder: TreeBuilder, world: Path | None, limits: PlanLimits) -> None:
        self.setup = setup
        self.builder = builder
        self.world = world
        self.limits = limits
        self.domain = Domain.of(setup.registry)
        self.beliefs = setup.world_model.as_at_the_start()

    def answer(
        self, text: str | None, goal: str | None, planner: str, record: Path | None, replay: Path | None
    ) -> tuple[PlanningProblem, TaskPlan]:
        """The problem as it is understood, and a plan. Raises PlanningError."""
        problem = self.domain.problem(Beliefs(self.beliefs), goal or "")
        if self.world is not None:
            problem = _with_facts(problem, self.world)
        if text is None and planner != "language":
            return problem, plan_within(PLANNERS.resolve(planner)(), problem, self.limits)
        return self._with_language(text or "", problem, planner, record, replay)

    def _with_language(
        self, text: str, problem: PlanningProblem, planner: str, record: Path | None, replay: Path | None
    ) -> tuple[PlanningProblem, TaskPlan]:
        """The same where a model is asked; what it costs and how it understood the text is told on standard error."""
        from bestman_bt.task_planning import language

        parameters = language.LanguagePlannerParameters(limits=self.limits)
        try:
            with shown_log(language.__name__):
                found = language.plan_from_text(
                    text, problem, planner, parameters, record=record, replay=replay, further=self._refusals
                )
        except (language.EndpointNotSetError, language.TranscriptError) as error:
            raise ConfigurationError([Problem("bestman-bt plan", None, "", str(error))]) from error
        print(f"understood as: {' and '.join(map(str, found.problem.goal))}", file=sys.stderr)
        return found.problem, found.plan

    def tree(self, problem: PlanningProblem, plan: TaskPlan) -> PlanTree:
        """The tree of a plan."""
        leaves = [ability.name for ability in self.domain.abilities if not ability.is_subtree]
        return self.builder.build(plan, problem.goal, leaves)

    def faults(self, problem: PlanningProblem, made: PlanTree) -> list[Any]:
        """What verification says."""
        return verify(made.document().to_xml(), problem, self.setup.registry, self.setup.robot_model, self.beliefs)

    def _refusals(self, problem: PlanningProblem, plan: TaskPlan) -> list[str]:
        faults = self.faults(problem, self.tree(problem, plan))
        return [str(fault) for fault in faults if fault.severity != "warning"]


def _limits(text: str) -> PlanLimits:
    try:
        return PlanLimits.from_string(text)
    except ValueError as error:
        raise ConfigurationError([Problem("--limits", None, "", str(error))]) from error


def _with_facts(problem: PlanningProblem, file: Path) -> PlanningProblem:
    """The problem with the facts of a file: a line each, ``not`` for what does not hold, ``#`` for comments."""
    try:
        lines = file.read_text(encoding="utf-8").splitlines()
    except OSError as error:
        raise ConfigurationError([Problem(str(file), None, "", f"cannot be read: {error.strerror}")]) from error
    state = set(problem.state)
    for number, line in enumerate(lines, 1):
        try:
            literals = parse_literals(line.partition("#")[0])
        except GoalError as error:
            raise ConfigurationError([Problem(str(file), number, "", str(error))]) from error
        for literal in literals:
            (state.discard if literal.negated else state.add)(literal.fact)
    return dataclasses.replace(problem, state=frozenset(state))


def _show(plan: TaskPlan) -> None:
    if not plan.actions:
        print("the goal is believed already: nothing to do")
    for number, action in enumerate(plan.actions, 1):
        print(f"{number:3d}. {action}")


def _document(
    problem: PlanningProblem, plan: TaskPlan, planner: str, builder: str, faults: list[str]
) -> dict[str, Any]:
    return {
        "goal": [str(literal) for literal in problem.goal],
        "planner": planner,
        "builder": builder,
        "plan": [{"ability": action.name, **action.ports} for action in plan.actions],
        "cost": plan.cost,
        "problems": faults,
    }


def _run(
    setup: Setup,
    config: RunConfig,
    made: PlanTree,
    problem: PlanningProblem,
    planner: str,
    builder: str,
    limits: PlanLimits,
    runs: Path,
) -> tuple[dict[str, Any], int]:
    """Run the tree in the scene that was planned for; where the task has a predicate, that decides, too."""
    from bestman_bt.cli.run_command import execute, exit_code
    from bestman_bt.evaluation.episode import prepare_episode

    anew = "symbolic" if planner == "language" else planner
    xml = (
        with_replanning(made, problem.goal, anew, builder, setup.registry, limits)
        if problem.goal
        else made.xml(setup.registry)
    )
    runs.mkdir(parents=True, exist_ok=True)
    file = runs / f"{datetime.now().strftime('%Y%m%d-%H%M%S')}-plan.xml"
    file.write_text(xml, encoding="utf-8")
    task = dataclasses.replace(config.task, tree=str(file))
    result = execute(prepare_episode(dataclasses.replace(config, name="plan", task=task)), runs, False)
    return result.to_document(), exit_code(result)
