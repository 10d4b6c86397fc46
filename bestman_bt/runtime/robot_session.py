"""Sessions: a robot in a world, with everything that skills need, ready to run trees."""

from __future__ import annotations

import dataclasses
import logging
import os
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np
from py_trees.behaviour import Behaviour

from behaviours.computation import InlineComputation
from behaviours.context import SkillContext
from behaviours.navigation.localise import KNOWN_POSITION_STD
from behaviours.skill import RobotNode
from bestman_bt.configuration.errors import naming_python_parameters
from bestman_bt.configuration.run import RunConfig, load_run
from bestman_bt.configuration.task import task_of_tree
from bestman_bt.control.operator_speed import OperatorSpeed
from bestman_bt.control.robot_stop import RobotStop
from bestman_bt.engine import Tree, TreeLoadError, TreeProblem
from bestman_bt.engine.reloading import watched
from bestman_bt.extras import DEFAULT_SIMULATOR
from bestman_bt.records.events import RunEvent
from bestman_bt.records.keeping import RecordingErrors
from bestman_bt.registry import DRIVERS
from bestman_bt.runtime.algorithms import Algorithms, algorithm_by_name
from bestman_bt.runtime.confirmation import Confirmation
from bestman_bt.runtime.control_channel import ControlChannel
from bestman_bt.runtime.executor import Execution, Executor
from bestman_bt.runtime.policies import find_policy
from bestman_bt.runtime.resolved_config import ResolvedConfig, load_for, prepare
from bestman_bt.runtime.robot_parts import RobotParts
from bestman_bt.runtime.robot_source import PictureSource, RobotSource
from bestman_bt.runtime.telemetry import Telemetry
from bestman_bt.runtime.tree_checks import unfilled_entries
from hal.api import NotConnectedError, Robot, Sensor
from hal.parts.simulated_clock import SimulatedClock


def describe_run(setup: ResolvedConfig, executor: Executor, folder: Path | None) -> RunEvent:
    """Return the event that describes an execution of this process, at its start."""
    config = setup.config
    return RunEvent(
        task=config.name,
        tree=str(config.task.tree),
        scene=str(config.task.scene),
        robot=str(config.task.robot),
        seed=config.seed,
        folder="" if folder is None else str(folder.resolve()),
        pid=os.getpid(),
        started=time.time(),
        tick_rate=1.0 / executor.period,
        clock="simulated" if isinstance(executor.clock, SimulatedClock) else "real",
    )


_LOG = logging.getLogger(__name__)

COMPUTATION_COSTS = {
    "detection": 0.25,
    "segmentation": 0.1,
    "pose_estimation": 0.15,
    "handle_detection": 0.15,
    "opening_by_rays": 0.05,
    "hand_check": 0.05,
    "view_planning": 0.3,
    "depth_fusion": 0.1,
    "grasp_planning": 0.2,
    "stand_planning": 0.2,
    "motion_planning": 0.15,
    "policy": 0.05,
    "trajectory": 0.05,
    "global_planning": 0.05,
    "exploration": 0.1,
    "task_planning": 0.2,
    "global_localization": 0.5,
    "clear_stop": 0.1,
}
"""Seconds that each computation takes on the robot's computer, in simulated time."""


@dataclass
class RobotSession:
    """A connected robot and its skills.

    ``entries``: root blackboard entries of the configured task, set in every tree. ``speed``: scales the robot's speed
    (``session.speed.set(0.3)``). ``ended``: True after the ``with`` block; then nothing can be loaded or run.
    ``latest_telemetry``: the telemetry of the latest execution with telemetry.
    """

    setup: ResolvedConfig
    robot: Robot
    skills: SkillContext
    entries: dict[str, Any]
    speed: OperatorSpeed
    confirmation: Confirmation | None = None
    ended: bool = False
    latest_telemetry: Telemetry | None = None

    def load(self, tree: str | Path | Behaviour | Tree | None = None) -> Tree:
        """Load a tree for this robot: a shipped name, a file, XML text, a node or a py_trees behaviour; by default the
        task's.

        A tree that is already loaded gets the robot's skills and clock, and keeps its entries. In a session without a
        task, a shipped tree brings the goal of its shipped task, as in ``bestman-bt run TREE``. The root blackboard
        gets the entries of the task and, if known, ``start``: the current pose of the base. Logs a warning for entries
        that are read but not filled yet. Creates the controllers and sensors that the nodes need.

        Raises:
            TreeLoadError: listing every fault, including unknown names and parts that the robot lacks.
            ConfigurationError: the task's goal does not exist in this scene.
            NotConnectedError: the session has ended.
        """
        if self.ended:
            raise NotConnectedError("the session has ended, its robot is disconnected: run trees inside the with block")
        setup = self.setup_for(tree)
        entries = self.entries_of(setup)
        loaded = self._checked(tree, entries)
        if setup is not self.setup:
            self.skills.world.given_places.update(setup.given_places)
        filled = self._filled(loaded, entries if loaded is not tree else _missing(entries, loaded))
        if not self.setup.config.watch:
            return filled
        return watched(filled, lambda replaces: self._checked(tree, entries, replaces), self.intervened)

    def _checked(
        self, tree: str | Path | Behaviour | Tree | None, entries: Mapping[str, Any], replaces: Tree | None = None
    ) -> Tree:
        """Load a tree, check it, and create what its nodes need; ``replaces`` is of ``LoadOptions``."""
        wrong: list[TreeProblem] = []
        with naming_python_parameters():
            if isinstance(tree, Tree):
                loaded = tree
                loaded.bind(self.skills, self.robot.clock)
            else:
                clock = self.robot.clock
                loaded = load_for(self.setup, tree, context=self.skills, clock=clock, faults=wrong, replaces=replaces)
        self.check(loaded, entries, wrong)
        needed = {kind for node in loaded.nodes if isinstance(node, RobotNode) for kind in (*node.REQUIRES, *node.USES)}
        for arm in self.skills.robot.arm_names or ("",):
            self.skills.for_arm(arm).make(needed)
        return loaded

    def executor(self, tree: Tree, after_tick: Callable[[], None] | None = None) -> Executor:
        """Return an executor with the configured tick rate and time limit."""
        task = self.setup.config.task
        made = Executor(
            tree, self.robot.clock, period=1.0 / task.tick_rate, time_limit=task.time_limit, after_tick=after_tick
        )
        made.watchers.append(self.speed)
        if self.confirmation is not None:
            self.confirmation.executor = made
        return made

    def run(
        self, tree: str | Path | Behaviour | Tree | None = None, after_tick: Callable[[], None] | None = None
    ) -> Execution:
        """Load a tree and tick it to its end, with telemetry and control channel; the robot is at rest afterwards.

        Raises the errors of ``load``, before anything moves.
        """
        executor = self.executor(self.load(tree), after_tick)
        telemetry = self.telemetry(executor)
        with telemetry, self.control_channel(executor, telemetry).serving():
            execution = executor.run()
            telemetry.end_as(execution)
        return execution

    def control_channel(self, executor: Executor, telemetry: Telemetry) -> ControlChannel:
        """Return the control channel of an execution."""
        return ControlChannel(
            executor, self.skills.stop.hold, telemetry, self.robot_state, self.speed, self.confirmation
        )

    def robot_state(self) -> dict[str, dict[str, str]]:
        """Return ``parts``: name → ``ok``, ``stopped`` or its diagnostics; ``robot``: the driver's diagnostics."""
        by_part, usual = self.robot.diagnostics(), "stopped" if self.robot.stopped else "ok"
        return {"parts": {name: by_part.get(name, usual) for name in self.robot.parts}, "robot": by_part}

    def check(self, tree: Tree, entries: Mapping[str, Any], known: Iterable[TreeProblem] = ()) -> None:
        """Check a tree as ``load`` does; ``entries``: filled by a task; ``known``: faults found so far. Raises
        TreeLoadError.
        """
        wrong = [*known, *self.setup.missing_in(tree)]
        if wrong:
            raise TreeLoadError(sorted(wrong, key=lambda one: (one.file, one.line)))
        for problem in unfilled_entries(tree, entries, bool(self.entries)):
            _LOG.warning("%s", dataclasses.replace(problem, severity="warning"))

    def setup_for(self, tree: str | Path | Behaviour | Tree | None) -> ResolvedConfig:
        """Return the setup of the session; for a shipped tree in a session without a task, with its shipped task."""
        named = tree.file if isinstance(tree, Tree) else tree
        shipped = isinstance(named, (str, Path)) and not self.setup.config.task.tree
        task = task_of_tree(str(named)) if shipped else None
        return self.setup if task is None else self.setup.with_task(task)

    def entries_of(self, setup: ResolvedConfig) -> dict[str, Any]:
        """Return the root blackboard entries of a tree that is run with ``setup``."""
        return self.entries if setup is self.setup else dict(setup.entries)

    def _filled(self, tree: Tree, entries: Mapping[str, Any]) -> Tree:
        for key, value in entries.items():
            tree.blackboard.set(key, value)
        believed = self.skills.world.base
        if believed.position_std <= KNOWN_POSITION_STD:
            tree.blackboard.set("start", believed.pose)
        return tree

    def telemetry(
        self, executor: Executor, folder: Path | None = None, keeping: RecordingErrors | None = None
    ) -> Telemetry:
        """Create the telemetry of one execution: tree states, robot, images, failures; stored in ``folder``, if any.

        The robot writes its black box there, too. ``keeping``: receives write errors of the folder.
        """
        self.robot.keep_black_box_in(None if folder is None else folder.resolve())
        sources = (
            RobotSource(self.robot, self.setup.robot_model, self.skills, self.speed),
            PictureSource(self.skills, folder),
        )
        run = describe_run(self.setup, executor, folder)
        self.latest_telemetry = Telemetry(executor, run, folder, self.skills.failures, sources, keeping)
        return self.latest_telemetry

    def intervened(self, what: str) -> None:
        """Record a manual intervention in the current execution; its result lists it."""
        if self.latest_telemetry is not None:
            self.latest_telemetry.intervened(what)


def _missing(entries: Mapping[str, Any], tree: Tree) -> dict[str, Any]:
    return {key: value for key, value in entries.items() if tree.blackboard.get(key) is None}


@contextmanager
def open_session(
    config: RunConfig | ResolvedConfig,
    prepare_robot: Callable[[Robot], None] | None = None,
    gui: bool = False,
    wrap_robot: Callable[[Robot], Robot] | None = None,
) -> Iterator[RobotSession]:
    """Connect the configured robot; it is always stopped and disconnected at the end.

    ``prepare_robot``: called right after connecting, before time runs (for evaluation and recording). ``gui``: show the
    driver's own window, if it has one. ``wrap_robot``: wraps the connected robot for the skills.
    """
    setup = prepare(config) if isinstance(config, RunConfig) else config
    driver = DRIVERS.resolve(setup.config.driver)
    recording = {"recording": setup.config.recording} if setup.config.recording else {}
    robot: Robot = driver(setup.robot_model, setup.world, seed=setup.config.seed, gui=gui, **recording)
    with robot:
        if prepare_robot is not None:
            prepare_robot(robot)
        seen = robot if wrap_robot is None else wrap_robot(robot)
        confirmation = Confirmation() if setup.config.confirm else None
        skills = _skills(setup, seen, confirmation)
        skills.joints.start(robot.clock)
        localised = skills.has("base") and skills.has("lidar")
        if localised:
            skills.base.surroundings = skills.known_costmap
            skills.base.start()
        opened = RobotSession(
            setup,
            robot,
            skills,
            dict(setup.entries),
            OperatorSpeed(seen.set_speed, isinstance(robot.clock, SimulatedClock)),
            confirmation,
        )
        try:
            yield opened
        finally:
            opened.ended = True
            if localised:
                skills.base.close()
            skills.joints.close()
            robot.keep_black_box_in(None)  # the stop at the end is not reported
            robot.stop()


class UnopenedSession(AbstractContextManager[RobotSession]):
    """The result of ``session()``: ``with`` opens the session."""

    def __init__(self, opening: AbstractContextManager[RobotSession]) -> None:
        self._opening = opening

    def __enter__(self) -> RobotSession:
        return self._opening.__enter__()

    def __exit__(self, *raised: Any) -> bool | None:
        return self._opening.__exit__(*raised)

    def __getattr__(self, name: str) -> Any:
        opened = f"with session(...) as s: s.{name}"
        raise AttributeError(f"the session is not open: it has {name!r} inside a with block, as in `{opened}`")


def session_config(task: str | Path | None = None, **given: Any) -> RunConfig:
    """Return the configuration of a session; ``given``: arguments of ``load_run``.

    Without a task there is no goal, and the scene defaults to the kitchen and the robot to diff_panda.
    """
    if task is None:
        given["scene"], given["robot"] = given.get("scene") or "kitchen", given.get("robot") or "diff_panda"
    with naming_python_parameters():
        return load_run(task, **given)


def session(
    robot: str | Path | None = None,
    scene: str | Path | None = None,
    seed: int = 0,
    task: str | Path | None = None,
    settings: Iterable[str] = (),
    plugins: Iterable[str] = (),
    driver: str = DEFAULT_SIMULATOR,
    gui: bool = False,
) -> UnopenedSession:
    """Return a session to open in a ``with`` statement: ``with session(scene="kitchen", seed=1) as s:
    s.run("fetch_cup")``.

    The task sets goal and limits, and the robot and scene unless they are given. Its runs are not judged. Opening it
    raises the errors of ``prepare``.
    """

    @contextmanager
    def opening() -> Iterator[RobotSession]:
        with naming_python_parameters():
            setup = prepare(
                session_config(
                    task, scene=scene, robot=robot, seed=seed, settings=settings, plugins=plugins, driver=driver
                )
            )
        with open_session(setup, gui=gui) as opened:
            yield opened

    return UnopenedSession(opening())


def _skills(setup: ResolvedConfig, robot: Robot, confirmation: Confirmation | None) -> SkillContext:
    config, model, world = setup.config, setup.robot_model, setup.world_model.initial_beliefs()
    confirm = None if confirmation is None else confirmation.confirm
    parts = RobotParts(robot, model, world, Algorithms(config, model, world.map), confirm)
    return SkillContext(
        clock=robot.clock,
        robot=model,
        kinds=parts.kinds,
        make_accessor=parts.made,
        arm_name=parts.default_arm,
        parameters=setup.skill_parameters,
        sensors={name: part for name, part in robot.parts.items() if isinstance(part, Sensor)},
        world=world,
        stop=RobotStop(robot),
        computation=InlineComputation(robot.clock),
        costs=COMPUTATION_COSTS,
        rng=np.random.default_rng([config.seed, 2]),
        planners=cache(partial(algorithm_by_name, config, "global_planning")),
        followers=cache(partial(algorithm_by_name, config, "local_planning")),
        policies=find_policy,
    )
