"""A run on the terminal: its live tree on standard error, its summary at the end on standard output."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from itertools import count
from pathlib import Path

from rich.console import Console
from rich.live import Live
from rich.table import Table
from rich.text import Text
from typing_extensions import override

from bestman_bt.engine import FAILURE, SUCCESS, Node, StateChanges, Tree
from bestman_bt.evaluation.audit import CHEATS, counter_words
from bestman_bt.evaluation.result import Outcome, RunResult
from bestman_bt.records.described_tree import describe_changes, describe_tree
from bestman_bt.records.events import MAIN_TREE, LogEvent
from bestman_bt.records.palette import HALTED, LOOKS, Look
from bestman_bt.runtime.resolved_config import ResolvedConfig
from bestman_bt.runtime.robot_session import RobotSession
from bestman_bt.runtime.telemetry import PackageLog
from bestman_bt.visualization.terminal import LiveTree, style_of
from hal.parts.simulated_clock import SimulatedClock


class ProgressConsole(Console):
    """A console whose reader may close it, as with ``2>&1 | head``: the run then continues without output."""

    @override
    def on_broken_pipe(self) -> None:
        self.quiet = True


CONSOLE = ProgressConsole(stderr=True)
"""Progress, warnings and errors."""
RESULTS = Console()
"""Console for the result: with ``--json``, which uses standard output, standard error."""

OUTCOME_LOOKS: dict[Outcome, Look] = {
    Outcome.SUCCESS: LOOKS[SUCCESS],
    Outcome.FAILURE: LOOKS[FAILURE],
    Outcome.CANCELLED: HALTED,
    Outcome.ERROR: LOOKS[FAILURE],
}
_UNITS = {"mm": " mm", "deg": "°"}


class RunView:
    """Shows a running tree: redrawn in place on a terminal, otherwise one line per event; with warnings and errors."""

    def __init__(self, title: str) -> None:
        self._title = title
        self._live: Live | None = None
        self._stack = ExitStack()
        self._simulated = True

    def __enter__(self) -> RunView:
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def watch(self, session: RobotSession, tree: Tree) -> Callable[[], None]:
        """Attach to a tree; returns a callable for the end of each tick."""
        clock, start, wall_start = session.robot.clock, session.robot.clock.now(), time.perf_counter()
        self._simulated = isinstance(clock, SimulatedClock)
        self._stack.enter_context(PackageLog(_print_problem, lambda: clock.now() - start))
        shown = LiveTree(describe_tree(tree), self._title, simulated=self._simulated)
        on_terminal = CONSOLE.is_terminal
        if on_terminal:
            self._live = Live(shown, console=CONSOLE, auto_refresh=False, vertical_overflow="crop")
            self._stack.enter_context(self._live)

        numbers = count(MAIN_TREE + 1)

        def follow(followed: Tree, number: int) -> None:
            """Print the events of a tree, and of the trees that its leaves tick, such as ``ExecutePlan``."""

            def on_changes(changes: StateChanges) -> None:
                for event in shown.take(describe_changes(followed, changes, start, 0, number)):
                    if not on_terminal:
                        CONSOLE.print(str(event), highlight=False, markup=False, soft_wrap=True)

            def on_inner(inner: Tree, leaf: Node) -> None:
                number = next(numbers)
                shown.take(describe_tree(inner, number))
                follow(inner, number)

            followed.subscribe(on_changes)
            followed.subscribe_to_inner(on_inner)

        drawn = 0.0

        def after_tick() -> None:
            nonlocal drawn
            now = time.perf_counter()
            shown.set_time(clock.now() - start, now - wall_start)
            if self._live is not None and now - drawn > 0.15:
                drawn = now
                _print_messages(tree, shown)
                self._live.refresh()

        follow(tree, MAIN_TREE)
        return after_tick

    def summary(self, result: RunResult, setup: ResolvedConfig, folder: Path) -> None:
        """Print outcome, durations and audit of a run."""
        goals = setup.goals
        table = Table(show_header=False, box=None, padding=(0, 2, 0, 0))
        look = OUTCOME_LOOKS[result.outcome]
        table.add_row(f"{result.task}, seed {result.seed}", Text(result.outcome, f"bold {style_of(look)}"))
        if result.unearned:
            table.add_row("note", f"{result.unearned}: the success is not the robot's")
        for goal in goals if result.success and result.judged and not result.unearned else ():
            table.add_row("fetched", f"the {goal.object} from the {goal.source} to the {goal.surface}")
        if result.failure is not None:
            named = result.failure.named
            where = f"{named}: " if named else ""
            table.add_row("why", f"{where}{result.failure.why} ({result.failure.error_code})")
        if result.not_judged:
            table.add_row("judge", result.not_judged)
        if result.metrics:
            table.add_row("measured", _metric_words(result.metrics))
        time_taken = f"{result.sim_time_s:.1f} s of real time"
        if self._simulated:
            speed = f"{result.real_time_factor:.1f} × real time"
            time_taken = f"{result.sim_time_s:.1f} s simulated in {result.wall_time_s:.1f} s, {speed}"
        table.add_row("time", time_taken)
        if result.audit:
            counts = ", ".join(f"{counter_words(name)} {result.audit[name]}" for name in (*CHEATS, "collisions"))
            table.add_row("audit", f"{counts}, deepest contact {result.audit['max_penetration_mm']:.2f} mm")
            for disturbance in result.audit["disturbances"]:
                table.add_row("disturbance", disturbance)
        _add_files(table, result, folder)
        RESULTS.print()
        RESULTS.print(table, highlight=False)


def _add_files(table: Table, result: RunResult, folder: Path) -> None:
    for what, why in result.not_kept.items():
        table.add_row("not kept", f"{what}: {why}")
    table.add_row("files", str(folder))
    for path in sorted(folder.iterdir()):
        table.add_row("", path.name)


def _metric_words(metrics: Mapping[str, float]) -> str:
    """Format metrics as ``place error 3.1 mm, tilt 0.2°``; those of single objects only if there is none over all."""
    texts = []
    for name, value in metrics.items():
        if not any(name.startswith(f"{other}_") for other in metrics):
            words, _, unit = name.rpartition("_")
            if unit in _UNITS:
                texts.append(f"{words.replace('_', ' ')} {value:.1f}{_UNITS[unit]}")
            else:
                texts.append(f"{name.replace('_', ' ')} {value:.3g}")
    return ", ".join(texts)


def _print_problem(event: LogEvent) -> None:
    """Print a warning or an error of the log, without its traceback, which is in the run folder."""
    if event.level in ("warning", "error"):
        first, *_ = event.message.split("\n")
        CONSOLE.print(f"[{event.time:7.2f} s] {event.level}: {first}", highlight=False, markup=False, soft_wrap=True)


def _print_messages(tree: Tree, shown: LiveTree) -> None:
    for node in tree.nodes:
        if node.feedback_message:
            shown.set_message(node.uid, node.feedback_message)
