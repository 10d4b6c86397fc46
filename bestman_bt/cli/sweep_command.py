"""Example: bestman-bt sweep fetch_cup --set algorithms.motion_planning.algorithm=rrt_connect,bit_star --episodes 20."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from bestman_bt.cli.eval_command import EpisodeOptions, JobOptions, evaluate
from bestman_bt.cli.options import Json, MonitorOptions, grouped_options
from bestman_bt.evaluation.suite import Suite
from bestman_bt.evaluation.sweep import combinations, sweep_suite


@grouped_options
def command(
    tasks: Annotated[list[str], typer.Argument(help="Shipped tasks or YAML files, or one suite such as manipulation.")],
    asked: EpisodeOptions = EpisodeOptions(),
    together: Annotated[
        bool, typer.Option("--together", help="The first values of all settings, then the second ones: no grid.")
    ] = False,
    execution: JobOptions = JobOptions(),
    out: Annotated[
        Path | None,
        typer.Option(
            help="Folder for all results; an interrupted evaluation is resumed.", show_default="runs/evaluations/NAME"
        ),
    ] = None,
    page: MonitorOptions = MonitorOptions(),
    as_json: Json = False,
) -> None:
    """Run the same seeds with each combination of settings (``--set KEY=A,B,C``) and compare them."""

    def suite(names: list[str]) -> Suite:
        settings = combinations(asked.settings or (), together)
        return sweep_suite(lambda one: replace(asked, settings=list(one)).suite(names), settings)

    evaluate(suite, tasks, execution, out, page, as_json, compare=True)
