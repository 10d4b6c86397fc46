"""Examples: bestman-bt run fetch_cup --seed 7 --record; bestman-bt run my_tree.xml --scene kitchen."""

from __future__ import annotations

import dataclasses
import json
import os
import shutil
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path
from typing import Annotated

import typer

from bestman_bt.cli.options import (
    Driver,
    Groot2Port,
    Json,
    Live,
    MonitorOptions,
    Plugins,
    Robot,
    Scene,
    Search,
    Seed,
    Settings,
    grouped_options,
    json_output,
)
from bestman_bt.cli.run_view import RunView
from bestman_bt.cli.started_monitor import show_in_monitor
from bestman_bt.configuration.data import data_names, find_data, shipped_trees
from bestman_bt.configuration.errors import ConfigurationError, Problem
from bestman_bt.configuration.run import RunConfig, RunRequest, read_run, run_of_options
from bestman_bt.configuration.task import task_of_tree
from bestman_bt.control.motion import PlannedMotion
from bestman_bt.engine import Tree
from bestman_bt.engine.models.package import Package
from bestman_bt.engine.validation import validate_file
from bestman_bt.evaluation.episode import RECORDING_OVER, Watcher, prepare_episode, run_episode
from bestman_bt.evaluation.result import Outcome, RunResult
from bestman_bt.evaluation.run_folder import make_run_folder
from bestman_bt.extras import DEFAULT_SIMULATOR, EXTRA_OF_SIMULATOR, require_extra
from bestman_bt.monitor.groot2.protocol import Groot2Error
from bestman_bt.monitor.groot2.publisher import Groot2Publisher, check_servable
from bestman_bt.records.writer import CONFIG_FILE, RESULT_FILE
from bestman_bt.runtime.resolved_config import ResolvedConfig
from bestman_bt.runtime.robot_session import RobotSession
from bestman_bt.visualization.errors import ViewerError
from bestman_bt.visualization.rerun.recorder import RECORDING_NAME
from bestman_bt.visualization.rerun.viewer import Display, LiveFeed, RerunViewer, ViewerOptions, has_window_system
from hal.parts.part_connection import ConnectionFailedError
from hal.twins.remote_truth import RemoteTruth


class Groot2View:
    """Serves the tree of a run to Groot2 until the context ends. Raises ConfigurationError if the port cannot be
    opened."""

    def __init__(self, port: int) -> None:
        self._port = port
        self._publisher: Groot2Publisher | None = None

    def __enter__(self) -> Groot2View:
        try:
            check_servable(self._port)
        except Groot2Error as error:
            where = f"--groot2-port {self._port}"
            raise ConfigurationError([Problem(where, None, "", str(error))]) from error
        return self

    def __exit__(self, *_: object) -> None:
        if self._publisher is not None:
            self._publisher.close()

    def watch(self, session: RobotSession, tree: Tree) -> Callable[[], None]:
        """Start serving Groot2; the returned callable does nothing."""
        self._publisher = Groot2Publisher(tree, self._port, intervened=session.intervened).open()
        print(f"Groot2: {self._publisher.host}, port {self._port}", file=sys.stderr, flush=True)
        return lambda: None


SLOW_ARMS = "safety: arms go at 10 % of their joints' speed and 0.25 m/s of the tool at most: {why}"
START_WAIT = 120.0
"""Seconds within which the first data are recorded."""
LAST_WORDS = 1.0
"""Seconds for viewers to read the last data."""


@contextmanager
def live_viewer(recording: Path) -> Iterator[None]:
    """Show ``recording`` while it is written: in a window, which stays open, or on a page until the end.

    A viewer that does not start is reported and does not stop the run.
    """
    window = has_window_system()
    ended = threading.Event()
    with tempfile.TemporaryFile("w+") as output:
        relay = RerunViewer(ViewerOptions(Display.RELAY if window else Display.BROWSER, fed=True), (), output)

        def open_viewer() -> None:
            try:
                relay.wait_until_up(START_WAIT)
                if window:
                    RerunViewer(ViewerOptions(Display.WINDOW, source=relay.address), (), output)
                else:
                    print(f"live: {relay.page}", file=sys.stderr, flush=True)
            except ViewerError as error:
                if not ended.is_set():
                    print(f"bestman-bt: --live: {error}", file=sys.stderr, flush=True)

        opening = threading.Thread(target=open_viewer, name="live-viewer", daemon=True)
        opening.start()
        try:
            with LiveFeed(recording, relay.pipe):
                yield
            time.sleep(LAST_WORDS)
        finally:
            ended.set()
            relay.stop()
            opening.join()


@dataclass(frozen=True)
class RunOptions:
    """The parts of a run that differ from the task."""

    task: Annotated[str | None, typer.Option(help="A shipped task or a YAML file.")] = None
    scene: Scene = None
    robot: Robot = None
    driver: Driver = DEFAULT_SIMULATOR
    seed: Seed = 0
    settings: Settings = None
    plugins: Plugins = None
    record: Annotated[
        bool,
        typer.Option(
            "--record", help="Write recording.rrd (of simulated runs) for the Rerun viewer, and readings to replay."
        ),
    ] = False


@dataclass(frozen=True)
class DriverOptions:
    """Options that apply to one driver only."""

    recording: Annotated[
        Path | None, typer.Option(metavar="RUN", help="With --driver replay: a run folder made with --record.")
    ] = None
    judge: Annotated[
        Path | None,
        typer.Option(metavar="SOCKET", help="With --driver hardware on twins: the judge's socket, which they print."),
    ] = None


@dataclass(frozen=True)
class TreeOptions:
    """The handling of the tree's files and of missing nodes."""

    search: Search = None
    pretend: Annotated[
        bool, typer.Option("--pretend", help="Simulate leaves without code here; the run is never a success.")
    ] = False
    scenario: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE.yaml", help="With --pretend: results of simulated leaves, as of simulate; default: random."
        ),
    ] = None
    watch: Annotated[
        bool, typer.Option("--watch", help="Take changes of the tree's files while it runs; running nodes continue.")
    ] = False

    def of(self, config: RunConfig) -> RunConfig:
        """Return ``config`` with these options applied. Raises ConfigurationError if they contradict it."""
        if self.scenario is not None and not self.pretend:
            raise ConfigurationError([Problem("--scenario", None, "", "needs --pretend")])
        if self.pretend and config.driver not in EXTRA_OF_SIMULATOR:
            message = f"is for simulated runs, not for {config.driver}"
            raise ConfigurationError([Problem("--pretend", None, "", message)])
        tree = str(config.task.tree)
        if self.watch and (self.pretend or config.pretend):
            raise ConfigurationError([Problem("--watch", None, "", "does not go with --pretend")])
        if self.watch and find_data("tree", tree).suffix != ".xml":
            raise ConfigurationError([Problem("--watch", None, "", f"is for trees in XML, and {tree} is in Python")])
        folders = tuple(str(folder.resolve()) for folder in self.search or ()) or config.search
        file = config.scenario if self.scenario is None else str(self.scenario.resolve())
        return config.changed(search=folders, pretend=self.pretend or config.pretend, scenario=file, watch=self.watch)


@dataclass(frozen=True)
class ViewOptions:
    """The ways to watch a run."""

    pictures: Annotated[bool, typer.Option("--pictures", help="Render start.png, grasp.png and end.png.")] = False
    gui: Annotated[bool, typer.Option("--gui", help="Show the simulator's window.")] = False
    groot2_port: Groot2Port = None
    live: Live = False
    confirm: Annotated[
        bool,
        typer.Option("--confirm", help="Show each motion before it starts; Enter starts it, n and Enter refuses it."),
    ] = False
    real_time: Annotated[bool, typer.Option("--real-time", help="Simulate no faster than real time, to watch it.")] = (
        False
    )

    def check(self, driver: str) -> None:
        """Raise ConfigurationError if ``driver`` does not support these options."""
        if self.gui and not os.environ.get("DISPLAY"):
            raise ConfigurationError([Problem("--gui", None, "", "needs an X display, and DISPLAY is not set")])
        if self.live and driver not in EXTRA_OF_SIMULATOR:
            raise ConfigurationError([Problem("--live", None, "", "shows simulated runs; --monitor shows all of them")])
        if self.real_time and driver not in EXTRA_OF_SIMULATOR:
            raise ConfigurationError([Problem("--real-time", None, "", f"is for simulated runs, not for {driver}")])


@grouped_options
def command(
    tree: Annotated[
        str | None, typer.Argument(metavar="[TREE]", help="A shipped tree, or an XML or Python file.")
    ] = None,
    asked: RunOptions = RunOptions(),
    driven: DriverOptions = DriverOptions(),
    runs: Annotated[Path, typer.Option(help="Folder in which run folders are created.")] = Path("runs"),
    trees: TreeOptions = TreeOptions(),
    view: ViewOptions = ViewOptions(),
    page: MonitorOptions = MonitorOptions(),
    as_json: Json = False,
) -> None:
    """Run a task, a tree with the task that names it, or a tree instead of the task's own."""
    view.check(asked.driver)
    with json_output(as_json) as print_json:
        faults: list[Problem] = []
        if driven.recording is not None:
            config = _replayed(driven.recording, tree, asked.driver)
        else:
            config = run_of_options(run_request(tree, asked), faults)
        if driven.judge is not None:
            _ask_judge(driven.judge, config.driver)
        config = trees.of(config)
        if view.confirm:
            config = config.changed(confirm=True)
        setup = prepare_episode(config, faults)
        file = find_data("tree", setup.config.task.tree)
        package = Package.open(config.search, shipped_trees()) if config.search else None
        for problem in validate_file(file, setup.registry, search_path=shipped_trees(), given=None, package=package):
            if not (config.pretend and problem.missing):
                print(problem, file=sys.stderr)
        if setup.slow_arms:
            print(SLOW_ARMS.format(why=setup.slow_arms), file=sys.stderr)
        if asked.record and asked.driver not in EXTRA_OF_SIMULATOR:
            kept = (
                f"no {RECORDING_NAME}, only the readings for --driver replay"
                if config.record
                else "nothing of a replay"
            )
            print(f"--record: writes {kept}: the world is only visible in simulation", file=sys.stderr)
        if page.monitor:
            show_in_monitor(page.monitor_port)
        result, _ = execute(setup, runs, view, driven.judge)
        print_json(result.to_document())
    if RESULT_FILE in result.not_kept and not as_json:
        print(json.dumps(result.to_document(), allow_nan=False))
    sys.exit(exit_code(result))


def execute(
    setup: ResolvedConfig, runs: Path, view: ViewOptions = ViewOptions(), twin_judge: Path | None = None
) -> tuple[RunResult, Path]:
    """Run while it is shown, print the summary; returns the result and the run folder."""
    if view.live:
        require_extra("--live", "rerun")
    with ExitStack() as stack:
        status = stack.enter_context(RunView(setup.config.name))
        watchers = [status.watch]
        if view.groot2_port is not None:
            watchers.append(stack.enter_context(Groot2View(view.groot2_port)).watch)
        if view.real_time:
            watchers.append(no_faster_than_real_time)
        if view.confirm:
            watchers.append(confirmed_on_terminal)
        folder = make_run_folder(setup.config, runs)
        recording = None
        if view.live:
            kept = setup.config.record
            place = folder if kept else Path(stack.enter_context(tempfile.TemporaryDirectory(prefix=folder.name)))
            recording = place / RECORDING_NAME
            stack.enter_context(live_viewer(recording))
        watch = _all_of(watchers)
        try:
            result = run_episode(setup, folder, view.pictures, watch, view.gui, twin_judge, recording=recording)
        except ConnectionFailedError:
            shutil.rmtree(folder)  # nothing was started: there is nothing to keep
            raise
    status.summary(result, setup, folder)
    return result, folder


def confirmed_on_terminal(session: RobotSession, tree: Tree) -> Callable[[], None]:
    """Print each motion of a session that needs confirmation, and read the answer from standard input."""
    confirmation = session.confirmation
    if confirmation is None:
        return lambda: None
    asked = threading.Semaphore(0)

    def show(planned: PlannedMotion) -> None:
        print(f"{planned}\nEnter starts it, n refuses it: ", end="", file=sys.stderr, flush=True)
        asked.release()

    def answer() -> None:
        while True:
            asked.acquire()
            line = sys.stdin.readline()
            if not line:
                return  # no terminal; the page and the shell answer as well
            while confirmation.pending is not None:
                word = line.strip().lower()
                if confirmation.decline() if word in ("n", "no") else confirmation.start():
                    break

    confirmation.asked.append(show)
    threading.Thread(target=answer, name="confirmation", daemon=True).start()
    return lambda: None


def no_faster_than_real_time(
    session: RobotSession,
    tree: Tree,
    wall: Callable[[], float] = time.monotonic,
    sleep: Callable[[float], None] = time.sleep,
) -> Callable[[], None]:
    """Return a callable that waits after each tick until real time has caught up; computing delays are not caught
    up.
    """
    clock = session.robot.clock
    began = wall() - clock.now()

    def after_tick() -> None:
        nonlocal began
        ahead = clock.now() + began - wall()
        if ahead > 0.0:
            sleep(ahead)
        else:
            began -= ahead

    return after_tick


def _all_of(watchers: Sequence[Watcher]) -> Watcher:
    def watch(session: RobotSession, tree: Tree) -> Callable[[], None]:
        calls = [watcher(session, tree) for watcher in watchers]

        def after_tick() -> None:
            for call in calls:
                call()

        return after_tick

    return watch


def _ask_judge(judge: Path, driver: str) -> None:
    """Check that a judge answers there, before anything connects; raises ConfigurationError."""
    if driver != "hardware":
        raise ConfigurationError([Problem(f"--judge {judge}", None, "", "needs --driver hardware")])
    try:
        _ = RemoteTruth(judge).object_names
    except (OSError, LookupError, ValueError) as error:
        message = f"no judge of twins answers there: {error}; twins started with --judge print its socket"
        raise ConfigurationError([Problem(f"--judge {judge}", None, "", message)]) from error


def exit_code(result: RunResult) -> int:
    """Return 0 for success, 1 for failure, 3 if the recording of a replay ended before the tree, 130 if cancelled."""
    if result.failure is not None and result.failure.error_code == RECORDING_OVER:
        return 3
    if result.outcome is Outcome.CANCELLED:
        return 130
    return 0 if result.success else 1


def _replayed(recording: Path, tree: str | None, driver: str) -> RunConfig:
    """Return the recorded run, with another tree if one is given."""
    if not (recording / CONFIG_FILE).is_file():
        raise ConfigurationError([Problem("--recording", None, "", f"{recording} is not a run folder")])
    config = read_run(recording / CONFIG_FILE)
    task = config.task if tree is None else dataclasses.replace(config.task, tree=tree)
    return dataclasses.replace(config, task=task, driver=driver, record=False, recording=str(recording))


def run_request(tree: str | None, asked: RunOptions) -> RunRequest:
    """Return the request; without a task, with the shipped task of the tree. Raises ConfigurationError without task and
    tree."""
    request = RunRequest(tree=tree, **vars(asked))
    if tree is None and asked.task is None and asked.driver == "replay":
        raise ConfigurationError(
            [Problem("--driver replay", None, "", "give --recording RUN, a run made with --record")]
        )
    if tree is None and asked.task is None:
        raise ConfigurationError([Problem("bestman-bt run", None, "", "give a tree, or --task, or both")])
    if tree is None or asked.task is not None:
        return request if tree is None else dataclasses.replace(request, name=Path(tree).stem)
    task = task_of_tree(tree)
    if task is not None:
        return dataclasses.replace(request, task=task)
    tasks, trees = data_names("task"), data_names("tree")
    close = get_close_matches(tree, [*trees, *tasks], n=1)
    if tree in tasks:
        raise ConfigurationError([Problem(tree, None, "", f"is a task, not a tree: bestman-bt run --task {tree}")])
    if close and close[0] not in trees and not Path(tree).suffix:
        message = f"unknown tree; did you mean the task {close[0]!r}? bestman-bt run --task {close[0]}"
        raise ConfigurationError([Problem(tree, None, "", message)])
    return dataclasses.replace(request, scene=asked.scene or "kitchen", robot=asked.robot or "diff_panda")
