"""The setup of a run: the resolved configuration, checked completely, with its task, before anything starts."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field, replace
from difflib import get_close_matches
from functools import cached_property
from importlib.util import find_spec
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
from py_trees.behaviour import Behaviour

from behaviours.parameters import SkillParameters
from bestman_bt.configuration.checked import numbered, salvage
from bestman_bt.configuration.data import shipped_trees
from bestman_bt.configuration.document import Document, FieldPath
from bestman_bt.configuration.errors import (
    UNREAD,
    ConfigurationError,
    Problem,
    ProblemCollector,
    UnreadError,
    up_to_unread_field,
)
from bestman_bt.configuration.run import RunConfig, load_run
from bestman_bt.configuration.task import DisturbanceConfig
from bestman_bt.engine import NodeRegistry, Tree, TreeLoadError
from bestman_bt.engine.errors import TreeProblem
from bestman_bt.engine.models.package import Package
from bestman_bt.engine.models.scenario import Scenario, SimulatedLeaves
from bestman_bt.extras import install_command
from bestman_bt.facts.evidence import DrawnTask
from bestman_bt.facts.goals.goal import Goal, entries_of, goals_of, surface_names, unknown
from bestman_bt.facts.goals.placed import Placed, PlaceGoal
from bestman_bt.messages import Pose2D
from bestman_bt.registry import CONNECTIONS, DRIVERS, UnknownNameError
from bestman_bt.robot_model.bringup_file import with_bringup_limits
from bestman_bt.robot_model.compose import load_robot_model
from bestman_bt.robot_model.model import ArmModel, BaseModel, RobotModel
from bestman_bt.robot_model.sensor_parts import CameraPart
from bestman_bt.runtime.algorithms import (
    Algorithms,
    algorithm_problems,
    check_odometry,
    nav2_problems,
    prepare_detection,
)
from bestman_bt.runtime.failure_lines import renamed_codes
from bestman_bt.runtime.plugins import node_registry, read_tree
from bestman_bt.runtime.policies import policy_problems
from bestman_bt.runtime.tree_checks import (
    TASK_ENTRIES,
    arm_problems,
    known_names,
    lacking_parts,
    unfilled_entries,
    unknown_names,
)
from bestman_bt.scene.draw import draw_world
from bestman_bt.scene.load import load_scene
from bestman_bt.scene.map_of_world import semantic_map
from bestman_bt.scene.scene import World
from bestman_bt.scene.scene_config import SceneConfig
from bestman_bt.world_model.world_model import BasePose, WorldModel

START_POSITION_ERROR = 0.03
START_HEADING_ERROR = math.radians(1.2)
"""Bounds of the error of the given initial pose: metres each way, radians."""

NAMES_MODELS_ALONE = ("aruco", "color_shape", "model_registration")
"""Detectors that only name objects of the scene."""

UNKNOWN_START = BasePose(Pose2D(), position_std=1.0, heading_std=math.pi, stamp=0.0)
"""The belief of a robot without a given initial pose: completely uncertain."""


@dataclass(frozen=True)
class ResolvedConfig(DrawnTask):
    """A configuration with everything that it names."""

    registry: NodeRegistry
    slow_arms: str = field(default="", kw_only=True)
    """Why real arms are limited to the slow speed of first motions; empty if they are not."""

    @cached_property
    def skill_parameters(self) -> SkillParameters:
        """The parameters of the skills. Raises ConfigurationError listing the wrong ones."""
        written = self.config.task.skills
        parameters, problems = salvage(Document(dict(written), {(): ("skills", None)}), SkillParameters)
        if problems:
            placed = ((("skills", *problem.field.split(".")), problem.message) for problem in problems)
            raise ConfigurationError([self.config.problem(path, message) for path, message in placed])
        return parameters

    @cached_property
    def asked(self) -> tuple[Goal[Any], ...]:
        """The goals of the task."""
        return goals_of(self)

    @property
    def goals(self) -> tuple[PlaceGoal, ...]:
        """The object placements that the task requires."""
        return tuple(goal.goal for goal in self.asked if isinstance(goal, Placed))

    @property
    def given_places(self) -> dict[str, str]:
        """Object → full name of its surface, for places given by the task."""
        return {name: place for goal in self.asked for name, place in goal.given_places().items()}

    @property
    def subjects(self) -> list[str]:
        """Return the objects, doors and drawers that the task's goals refer to."""
        return list(dict.fromkeys(name for goal in self.asked for name in goal.subjects()))

    @cached_property
    def entries(self) -> dict[str, Any]:
        """Root blackboard entries that the task fills, without handles. Raises SceneError if there is no room for a
        goal.
        """
        return entries_of(self.asked)

    @cached_property
    def names(self) -> dict[str, list[str]]:
        """The names that ports of a tree may use here, by kind; without objects if the detector may know further
        names.
        """
        names: dict[str, list[str]] = {}
        with suppress(UnreadError):
            names |= known_names(self.world_model, self.absent)
            if self.config.task.algorithm("detection")[0] not in NAMES_MODELS_ALONE:
                del names["object"]
        with suppress(UnreadError):
            if self.robot_model.of(ArmModel):  # who asks for a posture needs one
                names["posture"] = list(self.robot_model.postures)
        return names

    @cached_property
    def usable_parts(self) -> frozenset[str]:
        """Names of the robot's available parts: with hardware, those behind a connection."""
        if self.config.driver != "hardware":
            return frozenset(self.robot_model.parts)
        return frozenset(part for connection in self.robot_model.connections.values() for part in connection.parts)

    def missing_in(self, tree: Tree) -> list[TreeProblem]:
        """Return a problem for each part, name, policy and algorithm that a tree uses and the setup lacks.

        The tree's entries are not filled yet.
        """
        found = [
            *up_to_unread_field(lambda: lacking_parts(tree, self.robot_model, self.usable_parts))(),
            *up_to_unread_field(arm_problems)(tree, self.robot_model),
            *unknown_names(tree, self.names),
            *renamed_codes(tree),
            *policy_problems(tree),
            *algorithm_problems(tree, self.config),
        ]
        return sorted(found, key=lambda one: (one.file, one.line))

    def with_task(self, task: str) -> ResolvedConfig:
        """Return the same robot and world with the goal of a task.

        Raises ConfigurationError if the goal does not exist here.
        """
        own = self.config
        config = load_run(task, scene=own.task.scene, robot=own.task.robot, seed=own.seed, driver=own.driver)
        setup = replace(self, config=config)
        problems = list(task_problems(setup))
        if problems:
            raise ConfigurationError(problems)
        return setup


def prepare(  # noqa: C901 - one check after the other
    config: RunConfig,
    all_entries: bool = False,
    known_faults: Iterable[Problem] = (),
    check: Callable[[RunConfig], object] | None = None,
) -> ResolvedConfig:
    """Load and check everything that a run needs, without starting anything.

    ``all_entries``: whether the tree may only read entries that it, or the task, has filled. ``known_faults``: faults
    from loading the configuration, reported with all others. ``check``: called once plug-ins are loaded; finds further
    faults and raises them as ConfigurationError.

    Raises:
        ConfigurationError, TreeLoadError, SceneError: listing every fault.
    """
    faults = ProblemCollector([*known_faults])
    registry: NodeRegistry | None = None
    robot_model: RobotModel | None = None
    scene: SceneConfig | None = None
    slow_arms = ""
    # A plug-in may bring the driver, but one that is there is imported first: it can then guard what plug-ins import.
    if config.driver in DRIVERS.names():
        DRIVERS.resolve(config.driver)
    try:
        registry = node_registry(config.task.plugins)
    except ConfigurationError as error:
        faults.problems += [_at_its_entry(config, problem) for problem in error.problems]
    if check is not None:
        with faults.step():
            check(config)
    if config.task.robot:  # empty where the configuration was loaded without
        with faults.step():
            robot_model = load_robot_model(config.task.robot, config.robot_settings)
    if config.task.scene:
        with faults.step():
            scene = load_scene(config.task.scene, config.scene_settings)
    faults.problems += _driver_problems(config, robot_model)
    if robot_model is not None and config.driver == "hardware":
        faults.problems += _connection_problems(config, robot_model)
        with faults.step():
            robot_model, slow_arms = with_bringup_limits(robot_model)
    world: World | None = None
    if scene is not None:
        with faults.step():
            world = draw_world(scene, config.seed)
    setup = replace(_setup(config, robot_model, scene, world, registry), slow_arms=slow_arms)
    faults.problems += nav2_problems(config)
    _prepare_algorithms(setup, faults)
    faults.problems += task_problems(setup)
    if not faults.problems:
        setup.world_model.given_places.update(setup.given_places)
    if registry is not None and config.task.tree:
        try:
            _check_tree(setup, all_entries, certain=not faults.problems)
        except TreeLoadError as error:
            if not faults.problems:
                raise
            faults.problems += tree_problems(error)
    faults.raise_if_any()
    return setup


def _setup(
    config: RunConfig,
    robot: RobotModel | None,
    scene: SceneConfig | None,
    world: World | None,
    registry: NodeRegistry | None,
) -> ResolvedConfig:
    """Return a setup of the parts that could be read; access to the others raises UnreadError."""
    there, known = robot or UNREAD, UNREAD
    if scene is not None and world is not None:
        start = UNKNOWN_START if robot is None else _told_start(config, world, robot)
        known = WorldModel(map=semantic_map(world), models=dict(scene.models), base=start)
    absent = scene.absent if scene is not None else ()
    # A setup without nodes has no tree to check: kinds of goals that need nodes are left out.
    nodes: Any = registry
    return ResolvedConfig(config, there, world or UNREAD, known, nodes, absent=absent)


def _at_its_entry(config: RunConfig, problem: Problem) -> Problem:
    """Return a plug-in's fault with the source of the plug-in: the line of the task, or the option ``--plugin``."""
    written = config.written.data.get("plugins")
    for index, plugin in enumerate(written if isinstance(written, list) else ()):
        if problem.source == f"--plugin {plugin}":
            return config.problem(("plugins", index), f"{plugin}: {problem.message}")
    return problem


def _check_tree(setup: ResolvedConfig, all_entries: bool, certain: bool) -> None:
    """Check the tree of a setup; ``certain``: the configuration has no fault, so the entries of the task are known."""
    wrong: list[TreeProblem] = []
    tree = load_for(setup, faults=wrong)
    wrong += setup.missing_in(tree)
    if all_entries and certain:
        wrong += _unfilled(tree, setup.entries, bool(setup.entries or setup.config.task.predicates), wrong)
    elif all_entries:
        wrong += _unfilled(tree, TASK_ENTRIES, False, wrong)
    if wrong:
        raise TreeLoadError(sorted(wrong, key=lambda one: (one.file, one.line)))


def _unfilled(tree: Tree, given: Collection[str], has_task: bool, known: Iterable[TreeProblem]) -> list[TreeProblem]:
    """Return only errors, and only of ports without an error so far."""
    told = {(one.file, one.line, one.field) for one in known}
    found = (one for one in unfilled_entries(tree, given, has_task) if one.severity == "error")
    return [one for one in found if (one.file, one.line, one.field) not in told]


def _prepare_algorithms(setup: ResolvedConfig, faults: ProblemCollector) -> None:
    config, robot = setup.config, setup.robot_model
    with faults.step():
        Algorithms(config, robot)
    with faults.step():
        if robot.of(CameraPart):
            prepare_detection(config)
    with faults.step():
        Algorithms(config, robot, setup.world_model.map)  # the localizer, too
    with faults.step():
        check_odometry(config, robot)
    with faults.step():
        _ = setup.skill_parameters


def tree_problems(error: TreeLoadError) -> list[Problem]:
    """Return the faults of a tree as problems of a configuration."""
    return [
        Problem(
            *(p.file, p.line or None, f"<{p.node}> {p.field}".strip()),
            p.message + (f" ({p.suggestion})" if p.suggestion else ""),
        )
        for p in error.problems
    ]


def load_for(setup: ResolvedConfig, tree: str | Path | Behaviour | None = None, **options: Any) -> Tree:
    """Load a tree with the nodes of a setup. Raises TreeLoadError or ConfigurationError."""
    source = setup.config.task.tree if tree is None else tree
    if source == "":
        raise ConfigurationError(
            [Problem("session", None, "tree", "give a tree: this session has no task that has one")]
        )
    config = setup.config
    if config.search and not isinstance(source, Behaviour):
        options["package"] = Package.open(config.search, shipped_trees())
    if config.pretend:
        scenario = Scenario.load(config.scenario) if config.scenario else Scenario()
        options["gaps"] = SimulatedLeaves(scenario, config.seed, missing=True)
    return read_tree(source, setup.registry, **options)


def _told_start(config: RunConfig, world: World, robot: RobotModel) -> BasePose:
    """Return the initial base pose that the robot is given: approximate, as from an operator; exact if it cannot
    drive.
    """
    start = world.robot_start
    if not robot.of(BaseModel):
        return BasePose(start, 0.0, 0.0, 0.0)
    if not config.task.known_start:
        return UNKNOWN_START
    dx, dy, turn = np.random.default_rng([config.seed, 1]).uniform(-1.0, 1.0, 3)
    told = Pose2D(
        start.x + START_POSITION_ERROR * float(dx),
        start.y + START_POSITION_ERROR * float(dy),
        start.theta + START_HEADING_ERROR * float(turn),
    )
    return BasePose(told, START_POSITION_ERROR, START_HEADING_ERROR, 0.0)


def _driver_problems(config: RunConfig, model: RobotModel | None) -> Iterable[Problem]:
    try:
        refused = getattr(DRIVERS.resolve(config.driver), "refused_parts", None)
    except UnknownNameError as error:
        yield Problem("driver", None, "", str(error))
    else:
        for part, why in refused(model).items() if refused is not None and model is not None else ():
            yield Problem(str(config.task.robot), None, f"parts.{part}", why)
    if config.driver == "replay" and not config.recording:
        yield Problem("driver", None, "", "replay needs a recording: bestman-bt run --driver replay --recording RUN")
    if config.recording and config.driver != "replay":
        yield Problem("driver", None, "", f"{config.driver} does not use a recording; use --driver replay")


def _connection_problems(config: RunConfig, model: RobotModel) -> Iterable[Problem]:
    """Check that every controller has its vendor's package and an address before any of them is connected."""
    if model.parts and not any(connection.parts for connection in model.connections.values()):
        message = f"is missing, so the driver hardware has no part of {model.name}: see docs/hardware.md"
        yield Problem(str(config.task.robot), None, "connections", message)
    for name, connection in model.connections.items():
        driver: Any = CONNECTIONS.resolve(connection.driver)
        if driver.needs_address and not connection.address:
            message = (
                "is missing: give it in the robot's file, there as ${VARIABLE} of the environment, or by "
                f"--set robot.connections.{name}.address=…"
            )
            yield Problem(str(config.task.robot), None, f"connections.{name}.address", message)
        if driver.package and not _is_there(driver.package):
            message = f"needs the package {driver.package!r}: {install_command(driver.extra)}"
            yield Problem(str(config.task.robot), None, f"connections.{name}.driver", message)


def _is_there(package: str) -> bool:
    try:
        return find_spec(package) is not None
    except ValueError:  # it is marked as absent
        return False


def task_problems(task: DrawnTask) -> Iterator[Problem]:
    """Yield all unknown names of the task's goals, disturbances and contacts, and other faults in its world.

    Contacts with objects that are absent from the scene may be allowed.
    """
    config, known = task.config, task.world_model
    faults: list[Problem] = []
    goals = goals_of(task, faults)
    yield from faults
    for goal in goals:
        yield from up_to_unread_field(goal.problems)()
    yield from _tolerance_problems(config, task.world)
    for index, disturbance in numbered(config.task.disturbances):
        yield from _disturbance_problems(config, ("disturbances", index), disturbance, known, task.absent)
    yield from _contact_problems(task)


@up_to_unread_field
def _tolerance_problems(config: RunConfig, world: World) -> Iterator[Problem]:
    """Yield problems of position tolerances so large that every place in the scene satisfies them."""
    places = [wall.start for wall in world.walls] + [wall.end for wall in world.walls]
    places += [(world.robot_start.x, world.robot_start.y)]
    for piece in world.furniture:
        reach = math.hypot(*piece.model.footprint) / 2
        places += [(piece.actual.x + sign * reach, piece.actual.y + sign * reach) for sign in (-1.0, 1.0)]
    extent = float(np.linalg.norm(np.ptp(np.array(places), axis=0)))
    asked = config.task.tolerances.position
    if extent > 0.0 and asked > extent:
        message = f"should be less than the scene's extent, {extent:.1f} m, got {asked:g} m, which allows any place"
        yield config.problem(("tolerances", "position"), message)


@up_to_unread_field
def _disturbance_problems(
    config: RunConfig, path: FieldPath, asked: DisturbanceConfig, known: WorldModel, absent: Collection[str]
) -> Iterator[Problem]:
    doors = [f"{name}/{door.name}" for name, piece in known.map.furniture.items() for door in piece.articulations]
    if asked.object is not None:
        there = [*known.models, *absent]
        yield from unknown(config, (*path, "object"), asked.object, there, "the scene has no object")
    if asked.articulation is not None:
        what = "the map has no door or drawer"
        yield from unknown(config, (*path, "articulation"), asked.articulation, doors, what)
    if asked.surface is not None:
        what = "the map has no surface outside doors and drawers called"
        yield from unknown(config, (*path, "surface"), asked.surface, surface_names(known, inside=False), what)


@up_to_unread_field
def _contact_problems(task: DrawnTask) -> Iterator[Problem]:
    """Check that ``allowed_contacts`` name bodies of the world, parts of the robot, or objects of the task."""
    config, known = task.config, task.world_model
    robot = ElementTree.fromstring(task.robot_model.urdf)
    walls = [f"wall_{index}" for index in range(len(task.world.walls))]
    leaves = [f"{piece.name}/{leaf.name}" for piece in task.world.furniture for leaf in piece.model.articulations]
    names = [*known.models, *known.map.furniture, *leaves, *task.absent, "floor", *walls, "fingers", "robot"]
    links = [link.get("name", "") for link in robot.iter("link")]
    for index, pair in numbered(config.task.allowed_contacts or ()):
        for side, name in enumerate(pair):
            if name not in names and name not in links:
                close = get_close_matches(name, [*names, *links], n=1)
                remedy = f"did you mean {close[0]!r}?" if close else f"known: {', '.join(names)} and the robot's links"
                message = f"there is no object, piece of furniture or link {name!r}; {remedy}"
                yield config.problem(("allowed_contacts", index, side), message)
