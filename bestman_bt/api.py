"""The Python entry point: ``import bestman_bt as bt``.

Robots, simulators and algorithms load when a session opens, not on import.
"""

from __future__ import annotations

import logging
from collections.abc import Iterable
from contextlib import AbstractContextManager, ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any

from py_trees.behaviour import Behaviour

from bestman_bt.engine import NodeInfo, NodeStatus, Tree, ineffective_parts
from bestman_bt.extras import DEFAULT_SIMULATOR
from bestman_bt.records.writer import RESULT_FILE
from bestman_bt.runtime.plugins import node_registry, read_tree

if TYPE_CHECKING:
    from behaviours.context import SkillContext
    from bestman_bt.evaluation.episode import JudgedSession
    from bestman_bt.evaluation.result import RunResult
    from bestman_bt.runtime.resolved_config import ResolvedConfig
    from hal.api import Robot

_LOG = logging.getLogger(__name__)


def load_tree(source: str | Path | Behaviour, plugins: Iterable[str | Path] = ()) -> Tree:
    """Load and check a tree without a robot.

    ``source``: the name of a shipped tree, a file, XML text, a node or a py_trees behaviour.

    Raises:
        TreeLoadError: listing every fault of the tree.
        ConfigurationError: no such tree or plug-in.
    """
    return read_tree(source, node_registry(str(plugin) for plugin in plugins))


def nodes(plugins: Iterable[str | Path] = ()) -> dict[str, NodeInfo]:
    """Return every node that trees may use, by name, with its kind, ports and description.

    Raises ConfigurationError if a plug-in cannot be loaded.
    """
    return {info.name: info for info in node_registry(str(plugin) for plugin in plugins)}


def evaluate(  # noqa: PLR0913 - the options of bestman-bt eval, each by its name
    tasks: str | Path | Iterable[str | Path],
    episodes: int | None = None,
    seed: int | None = None,
    *,
    robot: str | Path | None = None,
    scene: str | Path | None = None,
    settings: Iterable[str] = (),
    plugins: Iterable[str | Path] = (),
    jobs: int = 1,
    folder: str | Path | None = None,
) -> dict[str, Any]:
    """Run tasks or one suite with seeds ``seed`` … ``seed + episodes - 1`` and return the result of ``eval --json``.

    ``jobs``: number of processes. ``folder``: where every episode is saved; an evaluation with the same arguments
    resumes from it.
    Raises ConfigurationError listing every fault before anything starts.
    """
    from bestman_bt.configuration.errors import Problem, ProblemCollector, naming_python_parameters
    from bestman_bt.configuration.run import RunRequest
    from bestman_bt.evaluation.evaluation import Evaluation
    from bestman_bt.evaluation.launchers.launcher import LaunchOptions
    from bestman_bt.evaluation.launchers.local import LocalProcesses
    from bestman_bt.evaluation.suite import make_suite

    low = [("episodes", episodes, 1), ("seed", seed, 0), ("jobs", jobs, 1)]
    wrong = ProblemCollector(
        [
            Problem(name, None, "", f"should be at least {least}, got {value}")
            for name, value, least in low
            if value is not None and value < least
        ]
    )
    if wrong.problems:
        episodes = seed = None
    named = [str(tasks)] if isinstance(tasks, (str, Path)) else [str(task) for task in tasks]
    with wrong.step(), naming_python_parameters():
        asked = RunRequest(scene=scene, robot=robot, settings=list(settings), plugins=list(plugins))
        suite = make_suite(named, episodes, seed, asked)
    wrong.raise_if_any()
    with Evaluation(suite, None if folder is None else Path(folder)) as evaluation:
        return evaluation.run(LocalProcesses(LaunchOptions(jobs)))


class Session(AbstractContextManager["Session"]):
    """A robot in a world, ready to run judged trees: ``with Session(scene="kitchen", seed=1) as session:``.

    The arguments are those of ``runtime.robot_session.session``: a ``task`` sets goal and limits, and the robot and
    scene unless they are given; without a task they default to diff_panda and the kitchen. Entering the context
    connects the robot; leaving it always stops and disconnects the robot. Entering raises ConfigurationError listing
    every fault before anything starts.
    """

    def __init__(
        self,
        robot: str | Path | None = None,
        scene: str | Path | None = None,
        seed: int = 0,
        task: str | Path | None = None,
        settings: Iterable[str] = (),
        plugins: Iterable[str | Path] = (),
        driver: str = DEFAULT_SIMULATOR,
        gui: bool = False,
    ) -> None:
        self._given: dict[str, Any] = {
            "task": task,
            "robot": robot,
            "scene": scene,
            "seed": seed,
            "settings": tuple(settings),
            "plugins": tuple(str(plugin) for plugin in plugins),
            "driver": driver,
        }
        self._gui = gui
        self._stack = ExitStack()
        self._judged: JudgedSession | None = None
        self._tree: Tree | None = None

    def __enter__(self) -> Session:
        from bestman_bt.evaluation.episode import open_judged
        from bestman_bt.runtime.robot_session import session_config

        self._judged = self._stack.enter_context(open_judged(session_config(**self._given), gui=self._gui))
        return self

    def __exit__(self, *raised: object) -> None:
        self._stack.close()

    @property
    def robot(self) -> Robot:
        """The robot, through the Robotics API; ``robot.clock`` is simulated or hardware time, in seconds."""
        return self._open.session.robot

    @property
    def skills(self) -> SkillContext:
        """The context of the skills: controllers, algorithms, ``world`` (the belief) and ``failures``."""
        return self._open.session.skills

    @property
    def setup(self) -> ResolvedConfig:
        """The resolved configuration, robot model and scene."""
        return self._open.session.setup

    def load(self, tree: str | Path | Behaviour | Tree | None = None) -> Tree:
        """Load a tree for this robot and make it the tree that ``tick`` ticks; the default is the tree of the task.

        Logs a warning for attributes that have no effect and for nodes that are never ticked.
        Raises TreeLoadError listing every fault, including names that the scene, map or robot do not have.
        """
        self._tree = self._open.session.load(tree)
        for problem in ineffective_parts(self._tree):
            _LOG.warning("%s", problem)
        return self._tree

    def tick(self) -> NodeStatus:
        """Tick the loaded tree once, advance the clock by one tick period and return the root's status."""
        opened = self._open.session
        tree = self.load() if self._tree is None or opened.ended else self._tree
        tree.tick_once()
        self.robot.clock.sleep(1.0 / opened.setup.config.task.tick_rate)
        return tree.status

    def run(self, tree: str | Path | Behaviour | Tree | None = None, folder: str | Path | None = None) -> RunResult:
        """Run a tree to its end and judge the outcome; the default is the tree of the task.

        Without a goal, the result is ``success`` if the tree succeeded and the audit is clean, and ``not_judged`` is
        set. The audit covers the whole session. ``folder`` receives ``result.json`` and the record of the run.

        Raises:
            TreeLoadError: as ``load`` does, before anything moves.
            ConfigurationError: ``folder`` already holds a run.
        """
        from bestman_bt.evaluation.run_folder import claim_run_folder

        kept = None if folder is None else Path(folder)
        if kept is not None:
            claim_run_folder(kept)
        result = self._open.run(tree, kept)
        if kept is not None:
            result.write(kept / RESULT_FILE)
        return result

    @property
    def _open(self) -> JudgedSession:
        from hal.api import NotConnectedError

        if self._judged is None:
            raise NotConnectedError("the session is not open: write `with bestman_bt.Session(...) as session:`")
        return self._judged
