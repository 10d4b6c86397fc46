"""Example: bestman-bt eval fetch_cup --episodes 50 --seed 1000 --jobs 2 --json."""

from __future__ import annotations

import json
import re
import sys
import time
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, NoReturn

import typer
from rich.console import Console, Group, RenderableType
from rich.live import Live
from rich.markup import escape
from rich.table import Table
from rich.text import Text

from bestman_bt.cli.options import (
    Engine,
    Json,
    LauncherOptions,
    MonitorOptions,
    Plugins,
    Robot,
    Scene,
    Settings,
    grouped_options,
    json_output,
)
from bestman_bt.cli.run_view import CONSOLE
from bestman_bt.cli.started_monitor import show_in_monitor
from bestman_bt.configuration.errors import ConfigurationError, Problem
from bestman_bt.configuration.run import RunRequest
from bestman_bt.evaluation.comparison import ComparedEntries, differences_table, within
from bestman_bt.evaluation.evaluation import Evaluation
from bestman_bt.evaluation.interval import Precision
from bestman_bt.evaluation.journal import JournalError
from bestman_bt.evaluation.launchers.launcher import Launcher
from bestman_bt.evaluation.markdown import accuracy_words, markdown, own_targets, verdict
from bestman_bt.evaluation.result import RunResult
from bestman_bt.evaluation.seed_ranges import ranges
from bestman_bt.evaluation.shards import KnownDurations, Shard
from bestman_bt.evaluation.suite import Suite, SuiteEntry, make_suite
from bestman_bt.evaluation.summary import spread_words
from bestman_bt.evaluation.sweep import draw_settings
from bestman_bt.extras import DEFAULT_SIMULATOR


class EvaluationView:
    """Shows the progress of an evaluation on ``console``; pass each result to ``show_result``."""

    def __init__(self, evaluation: Evaluation, console: Console) -> None:
        self._evaluation, self._console = evaluation, console
        self._began = time.perf_counter()
        self._finished_before = self._done()
        self._live: Live | None = None
        self._next_picture = 0.0

    def __enter__(self) -> EvaluationView:
        for note in self._evaluation.notes:
            self._print(f"note: {note}")
        for entry in self._evaluation.suite.entries:
            if entry.settings:
                changes = ", ".join(f"{key}={value}" for key, value in entry.settings.items())
                self._print(f"{entry.name}: {entry.config.name} with {changes}")
        if self._finished_before:
            self._print(f"{self._finished_before} episodes are finished already")
        if self._console.is_terminal:
            self._live = Live(self._picture(), console=self._console, auto_refresh=False, vertical_overflow="visible")
            self._live.start()
        return self

    def __exit__(self, *_: object) -> None:
        if self._live is not None:
            self._live.update(self._picture(), refresh=True)
            self._live.stop()

    def show_result(self, entry: SuiteEntry, result: RunResult) -> None:
        """Show the result of one episode."""
        if not result.success and not entry.control:
            why = result.failure.why if result.failure else str(result.outcome)
            why = f"{result.failure.named}: {why}" if result.failure and result.failure.named else why
            self._print(f"{entry.name}, seed {result.seed}: {why}")
        elif self._live is None or result.unearned or (result.success and entry.control):
            unearned = f", but {result.unearned}" if result.unearned else ""
            self._print(f"{entry.name}, seed {result.seed}: {result.outcome}{unearned}")
        began = time.perf_counter()
        if self._live is not None and began >= self._next_picture:
            self._live.update(self._picture(), refresh=True)
            now = time.perf_counter()
            self._next_picture = now + 20 * (now - began)

    def _print(self, text: str) -> None:
        self._console.print(text, highlight=False, markup=False, soft_wrap=True)

    def _done(self) -> int:
        return sum(summary.episodes for summary in self._evaluation.summaries.values())

    def _picture(self) -> RenderableType:
        total = self._evaluation.asked.total()
        done, passed = self._done(), time.perf_counter() - self._began
        line = f"{done} of {total} episodes, {passed / 60:.0f} min"
        if done > self._finished_before:
            left = (total - done) * passed / (done - self._finished_before)
            line += f", about {left / 60:.0f} min to go"
        return Group(table(self._evaluation), Text(line, style="dim"))


def table(evaluation: Evaluation) -> Table:
    """Return the table of the progress of each entry."""
    shown = Table(box=None, padding=(0, 2, 0, 0), header_style="dim")
    shown.add_column("")
    for name in ("run", "well", "95 %", "false", "× real"):
        shown.add_column(name, justify="right", no_wrap=True)
    shown.add_column("targets")
    shown.add_column("median / p95", overflow="ellipsis", no_wrap=True)
    for entry in evaluation.suite.entries:
        document = evaluation.entry_document(entry)
        low, high = document["interval"]
        begun = document["episodes"] > 0
        shown.add_row(
            Text.assemble(entry.name, (" (control)", "dim") if entry.control else ""),
            f"{document['episodes']}/{document['asked_episodes']}",
            str(document["succeeded"]),
            f"{low:.0%}–{high:.0%}" if begun else "",
            str(document["false_successes"]),
            f"{document['real_time_factor']:.1f}" if begun else "",
            _standing(document) if begun else "",
            escape(accuracy_words(document["accuracy"])),
        )
    return shown


def _standing(document: dict[str, Any]) -> Text:
    """Return how the finished episodes compare with the targets."""
    missed = [target["what"] for target in document["targets"] if not target["met"]]
    done = document["episodes"] == document["asked_episodes"]
    if not document["audit_clean"] and "audit" not in missed:
        missed.append("audit")
    if missed:
        return Text(("missed: " if done else "behind: ") + ", ".join(missed), style="red" if done else "yellow")
    return (
        Text("met" if done else "on course", style="green" if done else "dim") if own_targets(document) else Text("–")
    )


MOST_EPISODES = 1000
"""Limit of episodes with --until if neither the command nor the suite's entry sets one."""


@dataclass(frozen=True)
class EpisodeOptions:
    """The episodes to run; the scene and the robot if they differ from the task's."""

    episodes: Annotated[
        int | None,
        typer.Option(min=1, help="Number of seeds of each; default: that of the suite, else 10.", show_default=False),
    ] = None
    seed: Annotated[
        int | None, typer.Option(min=0, help="The first seed; default: that of the suite, else 0.", show_default=False)
    ] = None
    scene: Scene = None
    robot: Robot = None
    until: Annotated[
        str | None,
        typer.Option(
            metavar="95%±3",
            help="Run until the 95 % interval of each success rate is this narrow; at most EPISODES, 1000.",
            show_default=False,
        ),
    ] = None
    engine: Engine = DEFAULT_SIMULATOR
    settings: Settings = None
    plugins: Plugins = None

    def suite(self, tasks: list[str]) -> Suite:
        """Return the suite of tasks, everything checked; ConfigurationError."""
        asked = RunRequest(
            scene=self.scene, robot=self.robot, settings=self.settings, plugins=self.plugins, driver=self.engine
        )
        episodes = MOST_EPISODES if self.until and self.episodes is None else self.episodes
        suite = make_suite(tasks, episodes, self.seed, asked)
        return suite if self.until is None else replace(suite, precision=Precision.parse(self.until))


@dataclass(frozen=True)
class JobOptions(LauncherOptions):
    """The machines, and their part of the episodes."""

    shard: Annotated[
        str | None,
        typer.Option(metavar="K/N", help="Run part K of N; slurm: that of this array task.", show_default=False),
    ] = None
    balance: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Deal by the wall times of an earlier evaluation.", show_default=False),
    ] = None
    merge: Annotated[
        list[Path] | None,
        typer.Option(
            metavar="DIR…", help="Run no episodes; write one summary of the shards below.", show_default=False
        ),
    ] = None

    def check(self) -> None:
        """Raise ConfigurationError if the options contradict each other."""
        problems = self.problems()
        if self.merge and self.shard:
            problems.append(Problem("--merge", None, "", "applies to all shards together; omit --shard"))
        if self.balance and not self.shard:
            problems.append(Problem("--balance", None, "", "deals the episodes of shards; give --shard K/N"))
        if problems:
            raise ConfigurationError(problems)


@grouped_options
def command(
    tasks: Annotated[list[str], typer.Argument(help="Shipped tasks or YAML files, or one suite such as manipulation.")],
    asked: EpisodeOptions = EpisodeOptions(),
    execution: JobOptions = JobOptions(),
    out: Annotated[
        Path | None,
        typer.Option(
            help="Folder for all results; an interrupted evaluation is resumed.", show_default="runs/evaluations/NAME"
        ),
    ] = None,
    compare: Annotated[
        bool, typer.Option("--compare", help="Compare each entry, seed by seed, with the first one of its task.")
    ] = False,
    keep_old: Annotated[
        bool, typer.Option("--keep-old", help="Count finished episodes that were run with other code.")
    ] = False,
    page: MonitorOptions = MonitorOptions(),
    as_json: Json = False,
) -> None:
    """Run seeds SEED … SEED + EPISODES - 1 of each task and summarise."""
    evaluate(asked.suite, tasks, execution, out, page, as_json, compare, keep_old)


def evaluate(
    make: Callable[[list[str]], Suite],
    tasks: Sequence[str],
    execution: JobOptions,
    out: Path | None,
    page: MonitorOptions,
    as_json: bool,
    compare: bool = False,
    keep_old: bool = False,
) -> NoReturn:
    """Run or merge the suite that ``make`` returns for ``tasks``, print the result, and exit with its code."""
    with json_output(as_json) as print_json:
        execution.check()
        merged = [*(execution.merge or ()), *(Path(task) for task in tasks if execution.merge and Path(task).is_dir())]
        suite = make([task for task in tasks if Path(task) not in merged])
        if compare and sum(not entry.control for entry in suite.entries) < 2:
            raise ConfigurationError([Problem("--compare", None, "", f"needs two entries, {suite.name} has one")])
        if page.monitor:
            show_in_monitor(page.monitor_port)
        folder = out or Path("runs/evaluations") / suite.name
        shard = None if execution.shard is None else Shard.parse(execution.shard)
        balance = None if execution.balance is None else KnownDurations(execution.balance)
        if shard is not None:
            folder = folder / "shards" / f"{shard.number}_of_{shard.of}"
        if suite.precision is not None and (shard is not None or merged):
            why = "needs all episodes to decide their number: leave out --shard and --merge, give a --launcher"
            raise ConfigurationError([Problem("--until", None, "", why)])
        _refuse_other_suite(folder / "summary.json", suite)
        evaluation = Evaluation(suite, folder, keep_old, shard, balance)
        try:
            document = _evaluate(evaluation, folder, execution.made(folder, page.monitor), compare, merged)
        except JournalError as error:
            CONSOLE.print(f"bestman-bt: {error}", highlight=False, markup=False, soft_wrap=True)
            sys.exit(130)
        print_json(document)
    if not as_json:
        print_result(document)
    sys.exit(130 if document["interrupted"] else 0 if document["met"] else 1)


def _evaluate(
    evaluation: Evaluation, folder: Path, launcher: Launcher, compare: bool, merged: Sequence[Path]
) -> dict[str, Any]:
    """Run the unfinished episodes with a table on standard error; write ``summary.json``, ``summary.md``, comparisons.

    ``merged``: folders of shards; nothing is run then. Raises JournalError if a file cannot be written.
    """
    with evaluation:
        CONSOLE.print(f"kept in {folder}", highlight=False, markup=False, soft_wrap=True)
        printed = 0 if merged else len(evaluation.notes)
        if merged:
            document = evaluation.merge(merged)
        else:
            with EvaluationView(evaluation, CONSOLE) as view:
                document = evaluation.run(launcher, view.show_result)
        for note in evaluation.notes[printed:]:
            CONSOLE.print(f"note: {note}", highlight=False, markup=False, soft_wrap=True)
        compared = within(evaluation.finished_entries()) if compare and not document["interrupted"] else []
        document["comparisons"] = [one.document() for one in compared]
        try:
            _write_summary(folder, document, evaluation, compared)
        except OSError as error:
            why = f"{error.filename or folder} cannot be written: {error.strerror}"
            raise JournalError(f"{why}; the episodes are kept: make room there and repeat the command") from error
        CONSOLE.print(f"written: {folder / 'summary.md'}", highlight=False, markup=False, soft_wrap=True)
    return document


def _write_summary(
    folder: Path, document: dict[str, Any], evaluation: Evaluation, compared: Sequence[ComparedEntries]
) -> None:
    (folder / "summary.json").write_text(json.dumps(document, indent=2, allow_nan=False) + "\n", encoding="utf-8")
    lines = ["", "## Comparisons", ""]
    if len(compared) > 1:
        lines += [*differences_table(compared), ""]
    lines += [line for one in compared for line in (*one.lines(), "")]
    text = markdown(document) + ("\n".join(lines) if compared else "")
    (folder / "summary.md").write_text(text, encoding="utf-8", errors="backslashreplace")
    for one in compared:
        one.draw(folder / re.sub(r"[^\w.=-]+", "_", f"{one.names[1]}_against_{one.names[0]}.svg"))
    if len(compared) > 1:
        draw_settings(folder / "settings.svg", evaluation.finished_entries())


def _refuse_other_suite(summary: Path, suite: Suite) -> None:
    """Refuse a second suite of the same name, whose figures would overwrite those of the first."""
    try:
        file = json.loads(summary.read_text(encoding="utf-8"))["file"]
    except (OSError, ValueError, KeyError, TypeError):
        return  # nothing is there, or nothing that tells
    if file != suite.file:
        message = f"holds the figures of another suite ({file or 'a shipped one'}); choose another folder with --out"
        raise ConfigurationError([Problem(str(summary.parent), None, "", message)])


def print_result(document: dict[str, Any]) -> None:
    """Print the result of an evaluation as text."""
    episodes = "" if document["interrupted"] else f"{document['episodes']} episodes, "
    print(
        f"{document['evaluation']}: {verdict(document)}; {episodes}"
        f"{document['false_successes']} false successes, {document['unearned']} unearned successes, "
        f"audit {'clean' if document['audit_clean'] else 'NOT CLEAN'}"
    )
    for contradiction in document["contradictions"]:
        print(f"ERROR: one episode has two results: {contradiction}")
    for entry in document["entries"]:
        if entry["missing"]:
            print(f"{entry['name']}: missing are the seeds {ranges(entry['missing'])}")
        if not entry["episodes"]:
            print(f"{entry['name']}: none of {entry['asked_episodes']} episodes was completed")
            continue
        low, high = entry["interval"]
        print(
            f"{entry['name']}: {entry['succeeded']} of {entry['episodes']} succeeded "
            f"({entry['success_rate']:.0%}, 95 % interval {low:.0%} to {high:.0%})"
        )
        for why, count in Counter(one["why"] for one in entry["unearned"]).items():
            print(f"  of which {count} unearned: {why}")
        if len(document["entries"]) == 1:
            for name, spread in {**entry["accuracy"], **entry["durations"]}.items():
                print(f"  {name:16} median / p95 {spread_words(spread)}")
            print(f"  {entry['sim_time_s']:.0f} s simulated, {entry['real_time_factor']:.1f} × real time per process")
    for compared in document["comparisons"]:
        print(f"{compared['second']['name']} against {compared['first']['name']}:")
        for sentence in compared["sentences"]:
            print(f"  {sentence}")
