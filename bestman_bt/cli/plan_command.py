"""Examples: bestman-bt plan --goal "on(mug, table) and closed(drawer)" --builder reactive -o tree.xml; bestman-bt plan
"bring the mug from the drawer to the table" --planner language --run. Exit codes: 0 a plan was found (with --run: it
succeeded), 1 no plan was found or the run failed, 2 the input was invalid, 130 the user declined to run it.
"""

from __future__ import annotations

import json
import logging
import shlex
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import typer

from bestman_bt.cli.options import (
    Json,
    PlanningOptions,
    grouped_options,
    json_output,
    refuse_unwritable_folder,
    writable_file,
    wrong_input,
)
from bestman_bt.configuration.run import RunConfig
from bestman_bt.configuration.secret import shown_setting
from bestman_bt.engine import TreeProblem, render_svg
from bestman_bt.errors import InputError
from bestman_bt.runtime.planning import PlanOptions, PlanRequest, Transcript, assumed, read_plan_request, refusals
from bestman_bt.task_planning.language.errors import quoted
from bestman_bt.task_planning.simulation import folded
from bestman_bt.task_planning.symbolic.problem import PlanningError, PlanningProblem, TaskPlan


@contextmanager
def shown_log(package: str) -> Iterator[None]:
    """Print the log of only ``package``, from level INFO."""
    logger = logging.getLogger(package)
    handler = logging.StreamHandler(sys.stderr)
    level, passes = logger.level, logger.propagate
    logger.addHandler(handler)
    logger.setLevel(logging.INFO)
    logger.propagate = False
    try:
        yield
    finally:
        logger.removeHandler(handler)
        logger.setLevel(level)
        logger.propagate = passes


@dataclass(frozen=True)
class GoalOptions:
    """The goal, and the planner, the builder and their limits."""

    text: Annotated[str | None, typer.Argument(metavar="[TEXT]", help="The goal in natural language.")] = None
    goal: Annotated[str | None, typer.Option(metavar="FACTS", help="The goal: facts joined by and, or FILE.pddl.")] = (
        None
    )
    given: Annotated[
        list[str] | None,
        typer.Option("--given", metavar="FACTS", help="Places of objects that were not seen: 'on(cup, table)'."),
    ] = None
    planner: Annotated[str, typer.Option(help="symbolic, fast_downward, language, or one of your own.")] = "symbolic"
    builder: Annotated[str, typer.Option(help="reactive, sequence or backchain.")] = "reactive"
    limits: Annotated[
        str,
        typer.Option("--limits", metavar="LIMITS", help="For a plan: 'steps=20; only=PickUp, PutAt; without=fridge'."),
    ] = ""

    def check(self) -> None:
        """Check the options. Raises ConfigurationError if they contradict each other."""
        if self.text is not None and self.goal is not None:
            raise wrong_input("bestman-bt plan", "give either a text or --goal")
        if self.text is not None and not self.text.strip():
            raise wrong_input("bestman-bt plan", "the text is empty; describe the goal")
        if ":" in self.planner:
            raise wrong_input(
                "--planner", "load your own planner by --plugin FILE.py and give the name in its decorator"
            )


@dataclass(frozen=True)
class TranscriptOptions:
    """The files that receive or replay the dialogue with the language model."""

    record: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="Write the conversation with the language model to this file.", callback=writable_file
        ),
    ] = None
    replay: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Read the language model's answers from such a file.")
    ] = None


@dataclass(frozen=True)
class TreeFiles:
    """The files that receive the tree and its picture."""

    output: Annotated[
        Path | None, typer.Option("-o", metavar="FILE.xml", help="Where the tree is written.", callback=writable_file)
    ] = None
    svg: Annotated[
        Path | None,
        typer.Option(metavar="FILE.svg", help="Draw the tree, each ability as one box.", callback=writable_file),
    ] = None


@dataclass(frozen=True)
class ExecutionOptions:
    """Whether to run the plan, and the parent folder of its run folder."""

    run: Annotated[bool, typer.Option("--run", help="Run it at once, and plan again on failure.")] = False
    yes: Annotated[bool, typer.Option("--yes", help="Run a plan of a language model without confirmation.")] = False
    runs: Annotated[Path, typer.Option(help="Folder in which run folders are created.")] = Path("runs")

    def check(self, text: str | None, world: Path | None) -> None:
        """Raise ConfigurationError if the plan cannot be run; does nothing without ``--run``."""
        if not self.run:
            return
        if world is not None:
            raise wrong_input(f"--world {world}", "is for planning; --run has its own beliefs")
        if text is not None and not self.yes and not sys.stdin.isatty():
            raise wrong_input(
                "--run",
                "a model's reading of a text is run after your confirmation, which is impossible here; give --yes",
            )
        refuse_unwritable_folder(self.runs, "--runs")

    def is_wanted(self, text: str | None) -> bool:
        """Return whether to run the plan. A plan that a language model made from ``text`` needs the user's
        confirmation."""
        return self.run and (text is None or self.yes or typer.confirm("Run it?", err=True))


@grouped_options
def command(
    wanted: GoalOptions = GoalOptions(),
    where: PlanningOptions = PlanningOptions(),
    model: TranscriptOptions = TranscriptOptions(),
    files: TreeFiles = TreeFiles(),
    execution: ExecutionOptions = ExecutionOptions(),
    as_json: Json = False,
) -> None:
    """Plan for a goal, make a tree of the plan, and check it."""
    wanted.check()
    execution.check(wanted.text, where.world)
    with json_output(as_json) as print_json, shown_log("bestman_bt.task_planning"):
        question, goal = _question(wanted, where)
        transcript = Transcript(model.record, model.replay)
        try:
            problem, plan = question.answer(wanted.text, goal, wanted.planner, transcript)
            made = question.tree(problem, plan)
        except InputError:  # a goal that makes no sense, a planner that is not installed: nothing could be tried
            raise
        except PlanningError as error:
            print_json({"plan": None, "why": str(error)})
            print(f"no plan: {error}", file=sys.stderr)
            sys.exit(1)
        if wanted.text is not None:
            print(f"understood as: {' and '.join(quoted(str(literal)) for literal in problem.goal)}", file=sys.stderr)
        faults = question.faults(problem, made)
        document = _document(problem, plan, wanted, [str(fault) for fault in faults])
        _show(plan, faults)
        if refusals(faults):
            print_json(document)
            sys.exit(1)
        if files.output is not None:
            xml = _said_where(question.setup.config, question.xml(made, problem, plan, wanted.planner))
            files.output.write_text(xml, encoding="utf-8")
            own_goal = wanted.text is not None or wanted.goal is not None or bool(wanted.given)
            needed = [*(where.settings or ()), *(_judged_by(question, problem) if own_goal else ())]
            print(f"run it: {to_run(files.output, where, question.setup.config, needed)}", file=sys.stderr)
            if assumed(plan):
                print(f"{files.output} plans again (ReachGoal) if the plan fails", file=sys.stderr)
        if files.svg is not None:
            files.svg.write_text(render_svg(folded(made, problem)), encoding="utf-8")
        if not execution.is_wanted(wanted.text):
            print_json(document)
            sys.exit(130 if execution.run else 0)
        from bestman_bt.cli.plan_run import run_plan
        from bestman_bt.cli.run_command import exit_code

        result = run_plan(question, problem, made, wanted.planner, execution.runs)
        print_json({**document, "run": result.to_document()})
        sys.exit(exit_code(result))


def _question(wanted: GoalOptions, where: PlanningOptions) -> tuple[PlanRequest, str | None]:
    """Return the planning problem, and the goal as facts (None for a text).

    Raises ConfigurationError with all faults.
    """
    asked = PlanOptions(wanted.goal, wanted.given or (), wanted.planner, wanted.builder, wanted.limits)
    question, goal = read_plan_request(asked, where.request, where.world)
    if wanted.text is None and goal is None:
        facts = question.setup.config.task.asked("facts")
        if facts is None:
            raise wrong_input("bestman-bt plan", "give a text, --goal, or a --task with the goal facts")
        goal = str(facts["goal"])
    return question, goal


def _judged_by(question: PlanRequest, problem: PlanningProblem) -> tuple[str, str]:
    """Return the settings by which a run of the tree is judged by the goal and given the objects' places."""
    places = question.given_places(problem)
    facts = {"goal": " and ".join(map(str, problem.goal))} | ({"given_places": places} if places else {})
    return f"goals={json.dumps([{'facts': facts}])}", "predicate=facts"


def _said_where(config: RunConfig, xml: str) -> str:
    """Return the tree with a comment that names its scene and robot; an XML comment may not contain two hyphens in a
    row.
    """
    where = f"Planned for the scene {config.task.scene}, the robot {config.task.robot} and the seed {config.seed}."
    return f"<!-- {where.replace('--', '- -')} -->\n{xml}"


def to_run(tree: Path, planned: PlanningOptions, config: RunConfig, settings: Sequence[str]) -> str:
    """Return the command that runs the saved tree with the planned scene and robot."""
    where = {"--task": planned.task, "--scene": planned.scene, "--robot": planned.robot}
    if planned.task is None:
        where = {"--scene": config.task.scene, "--robot": config.task.robot}
        of_world = {f"scene.{key}": value for key, value in config.scene_settings.items()}
        own = {"time_limit": f"{config.task.time_limit:g} s", **of_world}
        given = {setting.partition("=")[0].strip() for setting in settings}
        settings = [*(f"{key}={value}" for key, value in own.items() if key not in given), *settings]
    words = ["bestman-bt", "run", str(tree)]
    words += [word for option, name in where.items() if name is not None for word in (option, name)]
    words += ["--seed", str(config.seed)] if config.seed else []
    words += [word for setting in settings for word in shown_setting(setting).split(" ", 1)]
    words += [word for plugin in config.task.plugins for word in ("--plugin", plugin)]
    return shlex.join(words)


def _show(plan: TaskPlan, faults: Sequence[TreeProblem]) -> None:
    for fault in faults:
        print(fault, file=sys.stderr)
    if not plan.actions:
        print("the goal is believed already: nothing to do")
    for number, action in enumerate(plan.actions, 1):
        print(f"{number:3d}. {quoted(str(action))}")
    for action in assumed(plan):
        print(
            f"{quoted(str(action))} assumes that it is there; if it is not, `plan --run` plans again", file=sys.stderr
        )


def _document(problem: PlanningProblem, plan: TaskPlan, wanted: GoalOptions, faults: list[str]) -> dict[str, Any]:
    return {
        "goal": [str(literal) for literal in problem.goal],
        "planner": wanted.planner,
        "builder": wanted.builder,
        "plan": [{"ability": action.name, **action.ports} for action in plan.actions],
        "cost": plan.cost,
        "assumes": [str(action) for action in assumed(plan)],
        "problems": faults,
    }
