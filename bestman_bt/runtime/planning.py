"""Planning from a scene and a goal: a plan, and a checked tree that can be run."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

from bestman_bt.configuration.errors import ConfigurationError, ProblemCollector, naming_python_parameters
from bestman_bt.configuration.errors import Problem as WrongInput
from bestman_bt.configuration.run import RunRequest, run_of_options
from bestman_bt.engine import TreeProblem
from bestman_bt.errors import InputError
from bestman_bt.facts.located import UNSEEN
from bestman_bt.facts.predicate import Beliefs
from bestman_bt.registry import BUILDERS
from bestman_bt.runtime.executor import Execution
from bestman_bt.runtime.resolved_config import ResolvedConfig, prepare
from bestman_bt.task_planning.base import TaskPlanner, made_planner, planner_class
from bestman_bt.task_planning.builders.base import made_builder
from bestman_bt.task_planning.builders.plan_tree import PlanTree, with_replanning
from bestman_bt.task_planning.domain import Domain
from bestman_bt.task_planning.limits import PlanLimits, plan_within
from bestman_bt.task_planning.symbolic.facts import goal_as_facts
from bestman_bt.task_planning.symbolic.problem import (
    Action,
    GoalError,
    GoalFaults,
    PlanningError,
    PlanningProblem,
    TaskPlan,
)
from bestman_bt.task_planning.verification import verify
from bestman_bt.world_model.world_model import WorldModel

TIME_LIMIT = "1200 s"
"""For planning without a task: a search of a kitchen takes long."""


def planning_state(asked: RunRequest, world: Path | None = None) -> tuple[ResolvedConfig, WorldModel]:
    """Return the setup and the beliefs: at the start, or as in the file ``world``.

    The scene is that of the task or of ``world``; the default is the furnished kitchen with diff_panda. Raises
    ConfigurationError.
    """
    from bestman_bt.runtime.world_file import read_world

    file = None if world is None else read_world(world)
    if file is not None:
        if asked.task is not None or asked.scene is not None or asked.seed != 0:
            message = f"is of the scene {file.scene} with seed {file.seed}; leave --task, --scene and --seed out"
            raise ConfigurationError([WrongInput(f"--world {world}", None, "", message)])
        plugins = (*file.plugins, *(asked.plugins or ()))
        asked = replace(asked, scene=file.scene, robot=asked.robot or file.robot, seed=file.seed, plugins=plugins)
    if asked.task is None:
        settings = (f"time_limit={TIME_LIMIT}", *(asked.settings or ()))
        scene, robot = asked.scene or "kitchen_furnished", asked.robot or "diff_panda"
        asked = replace(asked, scene=scene, robot=robot, settings=settings)
    config = run_of_options(replace(asked, tree="plan_and_execute"))
    if file is not None:
        config = replace(config, scene_settings={**file.scene_settings, **config.scene_settings})
    setup = prepare(config)
    return setup, setup.world_model.initial_beliefs() if file is None else file.world_model(setup)


@dataclass(frozen=True)
class Transcript:
    """Files of the conversation with a language model: written to ``record``, or read from ``replay``."""

    record: Path | None = None
    replay: Path | None = None


class PlanRequest:
    """A planning request: a goal, the beliefs and the chosen planner, builder and limits.

    ``beliefs``: the knowledge at planning time. ``builder``: its name.
    """

    def __init__(self, setup: ResolvedConfig, beliefs: WorldModel, builder: str, limits: PlanLimits) -> None:
        self.setup = setup
        self.beliefs = beliefs
        self.builder = builder
        self.limits = limits
        self.domain = Domain.of(setup.registry)

    def give(self, facts: Iterable[str]) -> None:
        """Add given places of objects, ``on(cup, table)``. Raises GoalError for other facts."""
        places = self.domain.given_places(self.domain.problem(Beliefs(self.beliefs)), facts)
        wrong = GoalFaults()
        for name in sorted(places.keys() & self.beliefs.objects.keys()):
            seen = self.beliefs.objects[name].surface or "no furniture"
            with wrong.step():
                raise GoalError(f"on({name}, {places[name]}): the robot has seen the {name}, on {seen}")
        wrong.raise_if_any()
        self.beliefs.given_places.update(places)
        self.setup.world_model.given_places.update(places)

    def understood(self, goal: str | None) -> PlanningProblem:
        """Return the problem of reaching a goal from the beliefs.

        Raises GoalError for an invalid goal.
        """
        return self.domain.problem(Beliefs(self.beliefs), goal)

    def answer(
        self, text: str | None, goal: str | None, planner: str | TaskPlanner, transcript: Transcript
    ) -> tuple[PlanningProblem, TaskPlan]:
        """Return the problem as understood, and a plan.

        Raises:
            PlanningError: there is no plan.
            ConfigurationError: the request is invalid.
        """
        problem = self.understood(goal)
        if text is None and planner != "language":
            chosen = made_planner(planner) if isinstance(planner, str) else planner
            return problem, plan_within(chosen, problem, self.limits)
        from bestman_bt.task_planning.language.errors import EndpointNotSetError, TranscriptError
        from bestman_bt.task_planning.language.from_text import plan_from_text

        record, replay = transcript.record, transcript.replay
        try:
            found = plan_from_text(
                text or "",
                problem,
                str(planner),
                limits=self.limits,
                record=record,
                replay=replay,
                further=self._refusals,
            )
        except (EndpointNotSetError, TranscriptError) as error:
            raise ConfigurationError([WrongInput("bestman-bt plan", None, "", str(error))]) from error
        return found.problem, found.plan

    def given_places(self, problem: PlanningProblem) -> dict[str, str]:
        """Return object → its place, for unseen objects that can be in one place only."""
        places: dict[str, list[str]] = {}
        for fact in problem.state:
            if fact.predicate == UNSEEN.name:
                places.setdefault(fact.arguments[0], []).append(fact.arguments[1])
        return {name: found[0] for name, found in sorted(places.items()) if len(found) == 1}

    def tree(self, problem: PlanningProblem, plan: TaskPlan) -> PlanTree:
        """Return the tree of a plan."""
        leaves = [ability.name for ability in self.domain.abilities if not ability.is_subtree]
        return made_builder(self.builder).build(plan, problem.goal_literals, leaves)

    def xml(self, made: PlanTree, problem: PlanningProblem, plan: TaskPlan, planner: str) -> str:
        """Return the tree as a self-contained file; if the plan depends on an assumption, the tree replans when it is
        wrong.
        """
        if not assumed(plan):
            return made.xml(self.setup.registry)
        return self.replanning_xml(made, problem, planner)

    def replanning_xml(self, made: PlanTree, problem: PlanningProblem, planner: str) -> str:
        """Return the tree that replans when the plan fails."""
        again = replanning_planner(planner)
        return with_replanning(made, problem.goal_literals, again, self.builder, self.setup.registry, self.limits)

    def faults(self, problem: PlanningProblem, made: PlanTree) -> list[TreeProblem]:
        """Return the verification faults of the tree."""
        xml = made.document().to_xml()
        found = verify(xml, problem, self.setup.registry, self.setup.robot_model, self.beliefs)
        named = f"tree of the builder {self.builder}"
        return [replace(fault, file=named) if fault.file == "<text>" else fault for fault in found]

    def _refusals(self, problem: PlanningProblem, plan: TaskPlan) -> list[str]:
        return refusals(self.faults(problem, self.tree(problem, plan)))


@dataclass(frozen=True)
class PlanOptions:
    """A goal (None: from a text or the task), given facts, planner, builder and limits."""

    goal: str | None
    given: Iterable[str]
    planner: str | TaskPlanner
    builder: str
    limits: str


def read_plan_request(wanted: PlanOptions, where: RunRequest, world: Path | None) -> tuple[PlanRequest, str | None]:
    """Return the request, and its goal as facts. Raises ConfigurationError listing every fault.

    ``where``, ``world``: as for ``planning_state``.
    """
    wrong, made, allowed, goal = ProblemCollector(), None, PlanLimits(), wanted.goal
    with _noted(wrong, "--goal"):
        goal = None if goal is None else goal_as_facts(goal)
    sound = not wrong.problems
    with _noted(wrong, "--limits"):
        allowed = PlanLimits.from_string(wanted.limits)
    with _noted(wrong, "bestman-bt plan"):
        made = planning_state(where, world)
    if made is not None or not where.plugins:  # plug-ins may bring them
        with _noted(wrong, "--planner"):
            if isinstance(wanted.planner, str):
                planner_class(wanted.planner)
        with _noted(wrong, "--builder"):
            BUILDERS.resolve(wanted.builder)
    if made is None:
        wrong.raise_if_any()
    assert made is not None
    question = PlanRequest(*made, wanted.builder, allowed)
    with _noted(wrong, "--given"):
        question.give(wanted.given)
    with _noted(wrong, "--limits"):
        allowed.resolved(question.understood(None))
    with _noted(wrong, "--goal"):
        if goal is not None and sound:
            question.understood(goal)
    wrong.raise_if_any()
    return question, goal


@contextmanager
def _noted(wrong: ProblemCollector, option: str) -> Iterator[None]:
    """Collect the faults of an option, to be reported with all others."""
    with wrong.step():
        try:
            yield
        except ConfigurationError:
            raise
        except GoalError as error:
            raise ConfigurationError(WrongInput(option, None, "", fault) for fault in error.faults) from error
        except (InputError, PlanningError, ValueError) as error:
            raise ConfigurationError([WrongInput(option, None, "", str(error))]) from error


def assumed(plan: TaskPlan) -> tuple[Action, ...]:
    """Return the actions of a plan that assume that an object is where they search for it."""
    return tuple(
        action for action in plan.actions if any(condition.fact.predicate == UNSEEN.name for condition in action.pre)
    )


def replanning_planner(planner: str) -> str:
    """Return the name of the planner for replanning at run time, which is never a language model."""
    return "symbolic" if planner == "language" else planner


def refusals(faults: Iterable[TreeProblem]) -> list[str]:
    """Return the faults that forbid running the tree."""
    return [str(fault) for fault in faults if fault.severity != "warning"]


@dataclass(frozen=True, repr=False)
class PlannedTree:
    """The result of ``plan``. ``xml``: the verified tree of the plan, with replanning if the plan depends on an
    assumption.
    """

    setup: ResolvedConfig
    problem: PlanningProblem
    plan: TaskPlan
    xml: str

    def __repr__(self) -> str:
        """Return goal, scene and actions in one line."""
        goal, task = " and ".join(map(str, self.problem.goal)), self.setup.config.task
        actions = "; ".join(map(str, self.plan.actions)) or "nothing to do"
        return f"PlannedTree({goal}, in {Path(str(task.scene)).stem} by {Path(str(task.robot)).stem}: {actions})"

    def run(self) -> Execution:
        """Run the tree in the scene of the plan."""
        from bestman_bt.runtime.robot_session import open_session

        with open_session(self.setup) as opened:
            return opened.run(self.xml)


def plan(  # noqa: PLR0913 - the options of bestman-bt plan, each by its name
    goal: str,
    *,
    scene: str | None = None,
    robot: str | None = None,
    seed: int = 0,
    task: str | None = None,
    world: str | Path | None = None,
    given: Iterable[str] = (),
    planner: str | TaskPlanner = "symbolic",
    builder: str = "reactive",
    limits: str = "",
    settings: Iterable[str] = (),
    plugins: Iterable[str] = (),
) -> PlannedTree:
    """Plan for a goal, build a tree of the plan and verify it; the arguments are those of ``bestman-bt plan``.

    ``goal``: facts, ``on(cup, counter) and closed(drawer_3)``, the same in PDDL, or the name of a ``.pddl`` problem
    file. ``planner``: a name or an object; replanning needs a name, so after an object it uses ``symbolic``.

    Raises:
        PlanningError: there is no plan, or its tree was refused.
        ConfigurationError: listing every fault of the arguments.
    """
    file = None if world is None else Path(world)
    asked = RunRequest(task, None, scene, robot, seed, tuple(settings), tuple(plugins))
    wanted = PlanOptions(goal, tuple(given), planner, builder, limits)
    with naming_python_parameters():
        question, facts = read_plan_request(wanted, asked, file)
    problem, found = question.answer(None, facts, planner, Transcript())
    made = question.tree(problem, found)
    refused = refusals(question.faults(problem, made))
    if refused:
        who = planner if isinstance(planner, str) else type(planner).__name__
        raise PlanningError(f"the plan of {who} is refused: {'; '.join(refused)}")
    name = planner if isinstance(planner, str) else "symbolic"
    return PlannedTree(question.setup, problem, found, question.xml(made, problem, found, name))
