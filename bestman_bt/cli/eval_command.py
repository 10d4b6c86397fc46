"""Example: bestman-bt eval fetch_cup --episodes 50 --seed 1000 --jobs 2 --json."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from bestman_bt.cli.json_output import json_output
from bestman_bt.cli.options import Json, Plugins, Robot, Scene, Seed, Settings
from bestman_bt.cli.run_view import CONSOLE
from bestman_bt.configuration import RunConfig, load_run
from bestman_bt.evaluation.batch import run_batch
from bestman_bt.evaluation.episode import prepare_episode
from bestman_bt.evaluation.result import RunResult


def command(
    task: Annotated[str, typer.Argument(help="A shipped task or a YAML file.")],
    episodes: Annotated[int, typer.Option(min=1, help="How many seeds to run.")] = 10,
    seed: Seed = 0,
    jobs: Annotated[int, typer.Option(min=1, help="Processes that run at the same time.")] = 1,
    scene: Scene = None,
    robot: Robot = None,
    settings: Settings = None,
    plugins: Plugins = None,
    runs: Annotated[Path | None, typer.Option(help="Keep a run folder per episode here.")] = None,
    as_json: Json = False,
) -> None:
    """Run seeds SEED … SEED + EPISODES - 1 and summarise."""
    with json_output(as_json) as tell:
        config = load_run(
            task,
            scene=scene,
            robot=robot,
            seed=seed,
            settings=settings or (),
            plugins=[str(plugin) for plugin in plugins or ()],
        )
        prepare_episode(config)  # what is wrong is told before the progress bar begins
        document = _evaluate(config, episodes, jobs, runs)
        tell(document)
    if not as_json:
        _tell(document)
    if document["episodes"] < episodes:
        sys.exit(130)
    sys.exit(0 if document["succeeded"] == episodes else 1)


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
