"""Example: bestman-bt eval fetch_cup --episodes 50 --seed 1000 --jobs 2 --json."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from bestman_bt.cli.eval_view import EvaluationView
from bestman_bt.cli.json_output import json_output
from bestman_bt.cli.options import MONITOR_PORT, Json, Monitor, MonitorPort, Plugins, Robot, Scene, Settings
from bestman_bt.cli.run_view import CONSOLE
from bestman_bt.cli.started_monitor import show_in_monitor
from bestman_bt.configuration import ConfigurationError, Problem, ProblemCollector, RunConfig, load_run
from bestman_bt.evaluation.batch import run_batch
from bestman_bt.evaluation.episode import prepare_episode
from bestman_bt.evaluation.evaluation import Evaluation
from bestman_bt.evaluation.markdown import markdown
from bestman_bt.evaluation.result import RunResult
from bestman_bt.evaluation.suite import Entry, Suite, is_suite, load_suite


def command(
    tasks: Annotated[list[str], typer.Argument(help="Shipped tasks or YAML files, or one suite such as manipulation.")],
    episodes: Annotated[
        int | None, typer.Option(min=1, help="How many seeds of each; 10, or what the suite says.", show_default=False)
    ] = None,
    seed: Annotated[
        int | None, typer.Option(min=0, help="The first seed; 0, or what the suite says.", show_default=False)
    ] = None,
    jobs: Annotated[int, typer.Option(min=1, help="Processes that run at the same time.")] = 1,
    scene: Scene = None,
    robot: Robot = None,
    settings: Settings = None,
    plugins: Plugins = None,
    runs: Annotated[Path | None, typer.Option(help="Keep a run folder per episode of one task here.")] = None,
    out: Annotated[
        Path | None,
        typer.Option(help="Keep everything here and go on where it stopped; of a suite: runs/evaluations/NAME."),
    ] = None,
    keep_old: Annotated[
        bool, typer.Option("--keep-old", help="Count finished episodes that were run with other code.")
    ] = False,
    monitor: Monitor = False,
    monitor_port: MonitorPort = MONITOR_PORT,
    as_json: Json = False,
) -> None:
    """Run seeds SEED … SEED + EPISODES - 1 of each task and summarise."""
    with json_output(as_json) as tell:
        if len(tasks) == 1 and out is None and not is_suite(tasks[0]):
            config = _config(tasks[0], seed or 0, scene, robot, settings, plugins)
            prepare_episode(config)  # what is wrong is told before the progress bar begins
            _show(monitor, monitor_port)
            document = _evaluate(config, episodes or 10, jobs, runs)
            ended, met = document["episodes"] == (episodes or 10), not document["failures"]
        else:
            suite = _suite(tasks, episodes, seed, scene, robot, settings, plugins)
            _show(monitor, monitor_port)
            is_kept = any(entry.asked is not None for entry in suite.entries)
            folder = out or (Path("runs/evaluations") / suite.name if is_kept else runs)
            document = _evaluate_suite(suite, folder, jobs, keep_old, as_json)
            ended, met = not document["interrupted"], document["met"]
        tell(document)
    if not as_json:
        (_tell_evaluation if "evaluation" in document else _tell)(document)
    sys.exit((0 if met else 1) if ended else 130)


def _show(monitor: bool, port: int) -> None:
    if monitor:
        show_in_monitor(port)


def _config(
    task: str,
    seed: int,
    scene: str | None,
    robot: str | None,
    settings: list[str] | None,
    plugins: list[Path] | None,
) -> RunConfig:
    given = [str(plugin) for plugin in plugins or ()]
    return load_run(task, scene=scene, robot=robot, seed=seed, settings=settings or (), plugins=given)


def _suite(
    tasks: list[str],
    episodes: int | None,
    seed: int | None,
    scene: str | None,
    robot: str | None,
    settings: list[str] | None,
    plugins: list[Path] | None,
) -> Suite:
    """The suite that is named, or one made of the tasks, which asks that all episodes succeed."""
    suites = [name for name in tasks if is_suite(name)]
    if suites and (len(tasks) > 1 or scene or robot or plugins):
        message = "is a suite: no other task, scene, robot or plug-in can be given with it"
        raise ConfigurationError([Problem(suites[0], None, "", message)])
    if suites:
        return load_suite(suites[0], episodes, seed, settings or ())
    entries = []
    faults = ProblemCollector()
    for name in dict.fromkeys(tasks):
        with faults.step():
            config = _config(name, seed or 0, scene, robot, settings, plugins)
            prepare_episode(config)
            entries.append(Entry(name, config, episodes or 10))
    faults.raise_if_any()
    return Suite("+".join(Path(name).stem for name in dict.fromkeys(tasks)), tuple(entries))


def _evaluate_suite(suite: Suite, folder: Path | None, jobs: int, keep_old: bool, as_json: bool) -> dict[str, Any]:
    """Run what is not finished with a table on standard error; write ``summary.json`` and ``summary.md``."""
    if folder is not None:
        _refuse_other_suite(folder / "summary.json", suite)
    with Evaluation(suite, folder, keep_old) as evaluation:
        told = len(evaluation.notes)
        with EvaluationView(evaluation, CONSOLE) as view:
            document = evaluation.run(jobs, view.told)
        for note in evaluation.notes[told:]:
            CONSOLE.print(f"note: {note}", highlight=False)
        if folder is not None:
            text = json.dumps(document, indent=2, allow_nan=False) + "\n"
            (folder / "summary.json").write_text(text, encoding="utf-8")
            (folder / "summary.md").write_text(markdown(document), encoding="utf-8")
            CONSOLE.print(f"written: {folder / 'summary.md'}", highlight=False, soft_wrap=True)
    return document


def _refuse_other_suite(summary: Path, suite: Suite) -> None:
    """Two suites of one name would overwrite each other's figures."""
    try:
        file = json.loads(summary.read_text(encoding="utf-8"))["file"]
    except (OSError, ValueError, KeyError, TypeError):
        return  # nothing is there, or nothing that tells
    if file != suite.file:
        message = f"holds the figures of another suite ({file or 'a shipped one'}); choose another folder with --out"
        raise ConfigurationError([Problem(str(summary.parent), None, "", message)])


def _evaluate(config: RunConfig, episodes: int, jobs: int, runs: Path | None) -> dict[str, Any]:
    """Run all episodes with a progress bar on standard error."""
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=CONSOLE, transient=True) as progress:
        bar = progress.add_task(config.name, total=episodes)

        def on_result(result: RunResult) -> None:
            progress.advance(bar)
            if not result.success:
                why = f"{result.failure.node}: {result.failure.why}" if result.failure else str(result.outcome)
                progress.console.print(f"seed {result.seed}: {why}", highlight=False, markup=False)

        return run_batch(config, episodes, jobs, runs, on_result)


def _tell(document: dict[str, Any]) -> None:
    low, high = document["interval"]
    print(
        f"{document['task']}: {document['succeeded']} of {document['episodes']} succeeded "
        f"({document['success_rate']:.0%}, 95 % interval {low:.0%} to {high:.0%}), "
        f"{document['false_successes']} false successes, audit {'clean' if document['audit_clean'] else 'NOT CLEAN'}"
    )
    for name, spread in document["metrics"].items():
        print(f"  {name:16} median {spread['median']:8.2f}   p95 {spread['p95']:8.2f}")
    print(f"  {document['sim_time_s']:.0f} s simulated, {document['real_time_factor']:.1f} × real time per process")


def _tell_evaluation(document: dict[str, Any]) -> None:
    verdict = "interrupted" if document["interrupted"] else "all met" if document["met"] else "NOT all met"
    print(
        f"{document['evaluation']}: {verdict}; {document['episodes']} episodes, {document['false_successes']} false "
        f"successes, audit {'clean' if document['audit_clean'] else 'NOT CLEAN'}"
    )
