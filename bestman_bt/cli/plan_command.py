"""Examples: bestman-bt plan --goal "on(mug, table) and closed(drawer)" --builder reactive -o tree.xml;
bestman-bt plan "bring the mug from the drawer to the table" --planner language --run. Exit codes: 0 there is a plan
(with --run: it succeeded), 1 there is none or the run failed, 2 the input was invalid, 130 it was not to be run.
"""

from __future__ import annotations

import json
import logging
import shlex
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any

import typer

from bestman_bt.cli.json_output import json_output
from bestman_bt.cli.option_values import wrong_input
from bestman_bt.cli.options import (
    Json,
    Plugins,
    Robot,
    SavedWorld,
    Scene,
    Seed,
    Settings,
    refuse_unwritable_folder,
    writable_file,
)
from bestman_bt.configuration import ConfigurationError, ProblemCollector, RunConfig
from bestman_bt.configuration.secret import shown_setting
from bestman_bt.engine import render_svg
from bestman_bt.errors import InputError
from bestman_bt.registry import BUILDERS
from bestman_bt.runtime.planning import PlanQuestion, Transcript, assumed, planning_state, refusals
from bestman_bt.task_planning.language.errors import quoted
from bestman_bt.task_planning.limits import PlanLimits
from bestman_bt.task_planning.planners import planner_class
from bestman_bt.task_planning.simulation import folded
from bestman_bt.task_planning.symbolic import PlanningError, Problem, TaskPlan, goal_as_facts

# The log of one package on standard error, while something is done with it.


@contextmanager
def shown_log(package: str) -> Iterator[None]:
    """Print what the loggers of ``package`` say from INFO on, and of nobody else."""
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


def command(
    text: Annotated[str | None, typer.Argument(metavar="[TEXT]", help="What is wanted, in words.")] = None,
    goal: Annotated[
        str | None, typer.Option(metavar="FACTS", help="What is wanted: facts joined by and, or FILE.pddl.")
    ] = None,
    planner: Annotated[str, typer.Option(help="symbolic, fast_downward, language, or one of your own.")] = "symbolic",
    builder: Annotated[str, typer.Option(help="reactive, sequence or backchain.")] = "reactive",
    output: Annotated[
        Path | None, typer.Option("-o", metavar="FILE.xml", help="Where the tree is written.", callback=writable_file)
    ] = None,
    svg: Annotated[
        Path | None,
        typer.Option(metavar="FILE.svg", help="Draw the tree, each ability as one box.", callback=writable_file),
    ] = None,
    run: Annotated[bool, typer.Option("--run", help="Run it at once, and plan anew where it fails.")] = False,
    yes: Annotated[bool, typer.Option("--yes", help="Run what a model made of a text without asking you.")] = False,
    task: Annotated[
        str | None, typer.Option(help="The task in whose scene, with whose robot; for its goal, if none is given.")
    ] = None,
    scene: Scene = None,
    robot: Robot = None,
    seed: Seed = 0,
    world: SavedWorld = None,
    given: Annotated[
        list[str] | None,
        typer.Option("--given", metavar="FACTS", help="Where things are that were not seen: 'on(cup, table)'."),
    ] = None,
    record: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Write what was said to and by the language model.", callback=writable_file),
    ] = None,
    replay: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Take the language model's answers from such a file.")
    ] = None,
    limits: Annotated[
        str,
        typer.Option("--limits", metavar="LIMITS", help="For a plan: 'steps=20; only=PickUp, PutAt; without=fridge'."),
    ] = "",
    settings: Settings = None,
    plugins: Plugins = None,
    runs: Annotated[Path, typer.Option(help="Where run folders are made.")] = Path("runs"),
    as_json: Json = False,
) -> None:
    """Plan for a goal, make a tree of the plan, and check it."""
    if text is not None and goal is not None:
        raise wrong_input("bestman-bt plan", "give a text or --goal, one of them")
    if text is not None and not text.strip():
        raise wrong_input("bestman-bt plan", "the text is empty; say what is wanted")
    if run and world is not None:
        raise wrong_input(f"--world {world}", "is for planning; --run has its own beliefs")
    if run and text is not None and not yes and not sys.stdin.isatty():
        raise wrong_input(
            "--run", "a model's reading of a text is run when you agree, and nobody can be asked here; give --yes"
        )
    if ":" in planner:
        raise wrong_input("--planner", "one of your own is brought by --plugin FILE.py and named by its decorator")
    if run:
        refuse_unwritable_folder(runs, "--runs")
    with json_output(as_json) as tell, shown_log("bestman_bt.task_planning"):
        wrong, state, allowed = ProblemCollector(), None, PlanLimits()
        with _noted(wrong, "--goal"):
            goal = None if goal is None else goal_as_facts(goal)
        sound = not wrong.problems
        with _noted(wrong, "--limits"):
            allowed = _limits(limits)
        with _noted(wrong, "bestman-bt plan"):
            state = planning_state(task, scene, robot, seed, settings, plugins, world)
        if state is not None or not plugins:  # plug-ins may bring them
            with _noted(wrong, "--planner"):
                planner_class(planner)
            with _noted(wrong, "--builder"):
                BUILDERS.resolve(builder)
        if state is not None:
            asked = PlanQuestion(*state, builder, allowed)
            with _noted(wrong, "--given"):
                asked.give(given or ())
            with _noted(wrong, "--goal"):
                if goal is not None and sound:
                    asked.understood(goal)
        wrong.raise_if_any()
        assert state is not None
        setup, _ = state
        if text is None and goal is None:
            facts = setup.config.task.asked("facts")
            if facts is None:
                raise wrong_input("bestman-bt plan", "give a text, --goal, or a --task with the goal facts")
            goal = str(facts["goal"])
        try:
            problem, plan = asked.answer(text, goal, planner, Transcript(record, replay))
            made = asked.tree(problem, plan)
        except InputError:  # a goal that makes no sense, a planner that is not installed: nothing could be tried
            raise
        except PlanningError as error:
            tell({"plan": None, "why": str(error)})
            print(f"no plan: {error}", file=sys.stderr)
            sys.exit(1)
        if text is not None:
            print(f"understood as: {' and '.join(quoted(str(literal)) for literal in problem.goal)}", file=sys.stderr)
        faults = asked.faults(problem, made)
        for fault in faults:
            print(fault, file=sys.stderr)
        document = _document(problem, plan, planner, builder, [str(fault) for fault in faults])
        _show(plan)
        if refusals(faults):
            tell(document)
            sys.exit(1)
        if output is not None:
            output.write_text(_said_where(setup.config, asked.xml(made, problem, plan, planner)), encoding="utf-8")
            where = {"--task": task, "--scene": scene, "--robot": robot}
            wanted = {"goal": " and ".join(map(str, problem.goal)), "told": asked.told(problem)}
            needed = [
                *(settings or ()),
                *([f"goals={json.dumps([{'facts': wanted}])}", "predicate=facts"] if given else ()),
            ]
            print(f"run it: {_to_run(output, where, setup.config, needed)}", file=sys.stderr)
            if assumed(plan):
                print(f"{output} plans anew (ReachGoal) where the plan fails", file=sys.stderr)
        if svg is not None:
            svg.write_text(render_svg(folded(made, problem)), encoding="utf-8")
        if not run:
            tell(document)
            return
        if text is not None and not yes and not typer.confirm("Run it?", err=True):
            tell(document)
            sys.exit(130)
        from bestman_bt.cli.plan_run import run_plan
        from bestman_bt.cli.run_command import exit_code

        told = asked.told(problem)
        result = run_plan(setup, problem, made, planner, builder, allowed, told, runs)
        tell({**document, "run": result.to_document()})
        sys.exit(exit_code(result))


@contextmanager
def _noted(wrong: ProblemCollector, option: str) -> Iterator[None]:
    """Note what is wrong with an option, to be told with all else that is."""
    with wrong.step():
        try:
            yield
        except ConfigurationError:
            raise
        except (InputError, PlanningError) as error:
            raise wrong_input(option, str(error)) from error


def _limits(text: str) -> PlanLimits:
    try:
        return PlanLimits.from_string(text)
    except ValueError as error:
        raise wrong_input("--limits", str(error)) from error


def _said_where(config: RunConfig, xml: str) -> str:
    """The tree with a comment that names its scene and robot; an XML comment may not contain two hyphens in a row."""
    where = f"Planned for the scene {config.task.scene}, the robot {config.task.robot} and the seed {config.seed}."
    return f"<!-- {where.replace('--', '- -')} -->\n{xml}"


def _to_run(tree: Path, where: dict[str, str | None], config: RunConfig, settings: Sequence[str]) -> str:
    """The command that runs the saved tree as it was planned for."""
    if where["--task"] is None:
        where = {"--scene": config.task.scene, "--robot": config.task.robot}
        of_world = {f"scene.{key}": value for key, value in config.scene_settings.items()}
        planned = {"time_limit": f"{config.task.time_limit:g} s", **of_world}
        given = {setting.partition("=")[0].strip() for setting in settings}
        settings = [*(f"{key}={value}" for key, value in planned.items() if key not in given), *settings]
    words = ["bestman-bt", "run", str(tree)]
    words += [word for option, name in where.items() if name is not None for word in (option, name)]
    words += ["--seed", str(config.seed)] if config.seed else []
    words += [word for setting in settings for word in shown_setting(setting).split(" ", 1)]
    words += [word for plugin in config.task.plugins for word in ("--plugin", plugin)]
    return shlex.join(words)


def _show(plan: TaskPlan) -> None:
    if not plan.actions:
        print("the goal is believed already: nothing to do")
    for number, action in enumerate(plan.actions, 1):
        print(f"{number:3d}. {quoted(str(action))}")
    for action in assumed(plan):
        print(
            f"{quoted(str(action))} assumes that it is there; if it is not, `plan --run` plans again", file=sys.stderr
        )


def _document(problem: Problem, plan: TaskPlan, planner: str, builder: str, faults: list[str]) -> dict[str, Any]:
    return {
        "goal": [str(literal) for literal in problem.goal],
        "planner": planner,
        "builder": builder,
        "plan": [{"ability": action.name, **action.ports} for action in plan.actions],
        "cost": plan.cost,
        "assumes": [str(action) for action in assumed(plan)],
        "problems": faults,
    }
