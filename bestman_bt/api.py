"""The way in from Python: ``import bestman_bt as bt``.

Robots, simulators and algorithms load when a session is opened, not before.
"""

from __future__ import annotations

import logging
from collections.abc import Iterable
from contextlib import AbstractContextManager, ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any

from py_trees.behaviour import Behaviour

from bestman_bt.engine import NodeInfo, NodeStatus, Tree, ineffective_parts
from bestman_bt.runtime.plugins import node_registry, read_tree

if TYPE_CHECKING:
    from behaviours.context import SkillContext
    from bestman_bt.evaluation.episode import JudgedSession
    from bestman_bt.evaluation.result import RunResult
    from bestman_bt.runtime.setup import Setup
    from hal.api import Robot

_LOG = logging.getLogger(__name__)


def load_tree(source: str | Path | Behaviour, plugins: Iterable[str | Path] = ()) -> Tree:
    """Load and check a tree without a robot: a shipped name, a file, XML text, a node or a py_trees behaviour.

    Raises TreeLoadError with everything that is wrong, ConfigurationError where there is no such tree or plug-in.
    """
    return read_tree(source, node_registry(str(plugin) for plugin in plugins))


def nodes(plugins: Iterable[str | Path] = ()) -> dict[str, NodeInfo]:
    """Every node that trees may name, with its kind, ports and description; ConfigurationError for a bad plug-in."""
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
    """Run seeds ``seed`` … ``seed + episodes - 1`` of tasks or of one suite; the result is that of ``eval --json``.

    ``jobs``: processes. ``folder``: keeps every episode, and an evaluation of the same goes on where it stopped.
    Raises ConfigurationError with everything that is wrong, before anything is started.
    """
    from bestman_bt.configuration.errors import Problem, ProblemCollector, told_to_programs
    from bestman_bt.configuration.run import RunRequest
    from bestman_bt.evaluation.evaluation import Evaluation
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
    with wrong.step(), told_to_programs():
        asked = RunRequest(scene=scene, robot=robot, settings=list(settings), plugins=list(plugins))
        suite = make_suite(named, episodes, seed, asked)
    wrong.raise_if_any()
    with Evaluation(suite, None if folder is None else Path(folder)) as evaluation:
        return evaluation.run(jobs)


class Session(AbstractContextManager["Session"]):
    """A robot in a world, ready to run trees that are judged: ``with Session(scene="kitchen", seed=1) as session:``.

    Arguments as of ``runtime.session``: a ``task`` gives goal and limits, and robot and scene where none are named;
    without a task the scene is the kitchen and the robot diff_panda. Entering it connects the robot; at the end of the
    block the robot is stopped and disconnected, whatever happened. Entering raises ConfigurationError with everything
    that is wrong, before anything is started.
    """

    def __init__(
        self,
        robot: str | Path | None = None,
        scene: str | Path | None = None,
        seed: int = 0,
        task: str | Path | None = None,
        settings: Iterable[str] = (),
        plugins: Iterable[str | Path] = (),
        driver: str = "pybullet",
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
        """The Robotics API; ``robot.clock`` is the time of simulation or hardware."""
        return self._open.session.robot

    @property
    def skills(self) -> SkillContext:
        """What skills have: controllers, algorithms, ``world`` (what the robot believes), ``failures``."""
        return self._open.session.skills

    @property
    def setup(self) -> Setup:
        """Configuration, robot model and scene."""
        return self._open.session.setup

    def load(self, tree: str | Path | Behaviour | Tree | None = None) -> Tree:
        """Load a tree for this robot and make it the one that ``tick`` ticks; by default that of the task.

        Raises TreeLoadError with everything that is wrong, also with names that scene, map and robot do not have.
        Warns, in the log, of attributes that nobody reads and nodes that are never ticked.
        """
        self._tree = self._open.session.load(tree)
        for problem in ineffective_parts(self._tree):
            _LOG.warning("%s", problem)
        return self._tree

    def tick(self) -> NodeStatus:
        """Tick the loaded tree once, let the time of one tick pass, and return the root's status."""
        opened = self._open.session
        tree = self.load() if self._tree is None or opened.ended else self._tree
        tree.tick_once()
        self.robot.clock.sleep(1.0 / opened.setup.config.task.tick_rate)
        return tree.status

    def run(self, tree: str | Path | Behaviour | Tree | None = None, folder: str | Path | None = None) -> RunResult:
        """Run a tree to its end and judge what has come of it; by default that of the task.

        Without a goal the result is ``success`` where the tree succeeded and the audit is clean, and ``not_judged``
        says so. The audit is of the whole session. ``folder`` receives ``result.json`` and the record of the run.
        Raises as ``load``, before anything moves; ConfigurationError, too, for a ``folder`` that holds a run already.
        """
        from bestman_bt.evaluation.run_folder import claim_run_folder

        kept = None if folder is None else Path(folder)
        if kept is not None:
            claim_run_folder(kept)
        result = self._open.run(tree, kept)
        if kept is not None:
            result.write(kept / "result.json")
        return result

    @property
    def _open(self) -> JudgedSession:
        from hal.api import NotConnectedError

        if self._judged is None:
            raise NotConnectedError("the session is not open: write `with bestman_bt.Session(...) as session:`")
        return self._judged
