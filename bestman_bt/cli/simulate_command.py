"""Examples: bestman-bt simulate my_tree.xml --runs 1000; bestman-bt simulate fetch_cup --scenario s.yaml."""

from __future__ import annotations

import math
import os
import sys
import time
from collections import Counter
from collections.abc import Iterable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer

from bestman_bt.cli.options import (
    Json,
    MonitorOptions,
    OtherFiles,
    Seed,
    grouped_options,
    is_package,
    json_output,
    writable_file,
)
from bestman_bt.cli.started_monitor import show_in_monitor
from bestman_bt.configuration.data import find_data, shipped_trees
from bestman_bt.engine import FAILURE, IDLE, RUNNING, SUCCESS, EngineError, Tree, WallClock, render_svg
from bestman_bt.engine.coverage import Coverage
from bestman_bt.engine.models.scenario import Scenario, fits
from bestman_bt.engine.simulation import LIMIT, SimulatedRun, simulate
from bestman_bt.engine.status import STATUS_NAMES
from bestman_bt.records.events import RunEvent
from bestman_bt.runtime.control_channel import ControlChannel
from bestman_bt.runtime.executor import Executor, TerminationReason
from bestman_bt.runtime.telemetry import Telemetry

PAGE_LOOKS = 1.5
"""Seconds before and after a run for the page to find it and to receive its result."""
MOST_NAMES = 12
"""Largest number of paths in one line of the summary."""


def _finite(value: float) -> float:
    if not math.isfinite(value):
        raise typer.BadParameter(f"should be a finite number, got {value}")
    return value


@grouped_options
def command(  # noqa: PLR0913 - its options, each by its name
    tree: Annotated[str, typer.Argument(help="A shipped tree, an XML or Python file, a folder or a .btproj.")],
    scenario: Annotated[
        Path | None,
        typer.Option(metavar="FILE.yaml", help="Results of leaves, by path, name or type; default: random."),
    ] = None,
    seed: Seed = 0,
    runs: Annotated[int, typer.Option(min=1, help="Number of runs; their seeds are --seed and those after it.")] = 1,
    limit: Annotated[
        float, typer.Option(min=0.001, help="Simulated seconds after which a run ends.", callback=_finite)
    ] = LIMIT,
    period: Annotated[
        float, typer.Option(min=0.001, help="Simulated seconds between two ticks.", callback=_finite)
    ] = 0.05,
    enums: Annotated[
        list[str] | None, typer.Option("--enum", metavar="NAME=1", help="A name that scripts and ports know.")
    ] = None,
    tree_id: Annotated[
        str | None, typer.Option("--tree", metavar="ID", help="Another tree of an XML file, or of a package.")
    ] = None,
    svg: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE.svg", help="Write a picture, coloured by the results of the runs.", callback=writable_file
        ),
    ] = None,
    page: MonitorOptions = MonitorOptions(),
    others: OtherFiles = OtherFiles(),
    json: Json = False,
) -> None:
    """Run a tree in simulated time without a robot, with simulated leaves, and report the coverage."""
    with json_output(json) as print_json:
        played = Scenario() if scenario is None else Scenario.load(scenario)
        played = replace(played, enums={**played.enums, **_enums(enums or ())})
        registry = others.registry()
        shown: dict[str, Any] = {}
        if page.monitor:
            if runs > 1:
                raise typer.BadParameter("shows one run: omit --runs", param_hint="--monitor")
            show_in_monitor(page.monitor_port)
            shown = {
                "clock": WallClock(),
                "drive": partial(run_shown, name=tree, seed=seed, period=period, limit=limit),
            }
        whole = is_package(tree)
        package = others.package(tree if whole else None)
        if whole and tree_id is None:
            what = f"{tree} is a package: name one of its trees: {package.tree_names()}"
            raise typer.BadParameter(what, param_hint="--tree")
        path = Path(package.file_of(tree_id or "", tree)) if whole else find_data("tree", tree)
        results: list[tuple[int, SimulatedRun]] = []
        coverage: Coverage | None = None
        for number in range(seed, seed + runs):
            run = simulate(
                path, registry, scenario=played, seed=number, period=period, limit=limit, package=package,
                search_path=shipped_trees(), main_tree=tree_id, **shown,
            )  # fmt: skip
            coverage = coverage or Coverage(run.tree)
            coverage.add(run.transitions)
            results.append((number, replace(run, changes=[], transitions=[])))  # a thousand of them are kept
        assert coverage is not None
        _warn_of_idle_rules(played, coverage)
        document = _document(str(path), results, coverage)
        if svg is not None:
            svg.write_text(render_svg(coverage.tree, _states(coverage)), encoding="utf-8")
        if not json:
            _print(document)
        print_json(document)
    outcomes = set(document["outcomes"])
    sys.exit(1 if outcomes & {"error", "time limit"} or (runs == 1 and outcomes != {"success"}) else 0)


def run_shown(tree: Tree, *, name: str, seed: int, period: float, limit: float) -> tuple[int, int]:
    """Tick in real time, with the control channel that the live page connects to; return the last status and the number
    of ticks.
    """
    executor = Executor(tree, tree.clock, period=period, time_limit=limit)
    run = RunEvent(
        task=f"simulation of {Path(name).stem}", tree=name, scene="", robot="", seed=seed, folder="", pid=os.getpid(),
        started=time.time(), tick_rate=1.0 / period, clock="real",
    )  # fmt: skip
    telemetry = Telemetry(executor, run)
    channel = ControlChannel(executor, partial(executor.cancel, "stopped"), telemetry)
    with telemetry, channel.serving():
        time.sleep(PAGE_LOOKS)
        execution = executor.run()
        telemetry.end_as(execution)
        time.sleep(PAGE_LOOKS)
    if execution.ending is TerminationReason.ERROR:
        raise EngineError(execution.why)
    status = (
        RUNNING if execution.ending is not TerminationReason.FINISHED else STATUS_NAMES.index(execution.tree_status)
    )
    return status, execution.ticks


def _enums(texts: Iterable[str]) -> dict[str, int]:
    found = {}
    for text in texts:
        name, _, value = text.partition("=")
        if not name.isidentifier() or not value.lstrip("-").isdecimal():
            raise typer.BadParameter(f"should be NAME=NUMBER, got '{text}'", param_hint="--enum")
        found[name] = int(value)
    return found


def _warn_of_idle_rules(scenario: Scenario, coverage: Coverage) -> None:
    for pattern in scenario.nodes:
        if not any(fits(pattern, node) for node in coverage.tree.nodes):
            print(f"warning: the scenario's '{pattern}' is not a path, name or type of a node", file=sys.stderr)


def _states(coverage: Coverage) -> dict[int, int]:
    """Return the style of each node: green if it only succeeded, red if it only failed, blue for both, thin if it never
    ended.
    """
    states = {}
    for node in coverage.tree.nodes:
        use = coverage.of(node)
        both = use.succeeded and use.failed
        states[node.uid] = RUNNING if both else SUCCESS if use.succeeded else FAILURE if use.failed else IDLE
    return states


def _document(file: str, results: list[tuple[int, SimulatedRun]], coverage: Coverage) -> dict[str, Any]:
    runs = [run for _, run in results]
    nodes = coverage.tree.nodes
    shared = Counter(node.path for node in nodes)
    names = {node.uid: node.path if shared[node.path] == 1 else f"{node.path}::{node.uid}" for node in nodes}
    ends: dict[str, int] = {}
    for number, run in results:
        if run.outcome in ("error", "time limit"):
            ends.setdefault(run.error or "time limit", number)
    return {
        "tree": file,
        "runs": len(runs),
        "outcomes": dict(Counter(run.outcome for run in runs)),
        "seconds": [min(run.seconds for run in runs), max(run.seconds for run in runs)],
        "ticks": [min(run.ticks for run in runs), max(run.ticks for run in runs)],
        "simulated": dict(sorted({**runs[0].simulated}.items())),
        "invented_entries": sorted({key for run in runs for key in run.invented}),
        "first_seed_of": ends,
        "coverage": {
            "nodes": len(nodes),
            "share": round(coverage.share, 4),
            "never_ticked": [names[node.uid] for node in coverage.never_ticked],
            "never_failed": [names[node.uid] for node in coverage.never_failed],
            "never_succeeded": [names[node.uid] for node in coverage.never_succeeded],
            "never_left": [names[node.uid] for node in coverage.never_left],
            "unused_recoveries": [names[node.uid] for node in coverage.unused_recoveries],
            "counts": {names[node.uid]: vars(coverage.of(node)) for node in nodes},
        },
    }


def _print(document: dict[str, Any]) -> None:
    outcomes = ", ".join(f"{count} {name}" for name, count in document["outcomes"].items())
    low, high = document["seconds"]
    fewest, most = document["ticks"]
    print(f"{document['tree']}: {document['runs']} run{'s' if document['runs'] > 1 else ''}: {outcomes}")
    print(f"  {low:.2f} to {high:.2f} s of simulated time, {fewest} to {most} ticks")
    if document["simulated"]:
        names = [
            f"{name} ({where})" if where != "the registry" else name for name, where in document["simulated"].items()
        ]
        print(f"  simulated types: {_some(names)}")
    if document["invented_entries"]:
        print(f"  entries that no node writes, given a value here: {_some(document['invented_entries'])}")
    for what, number in document["first_seed_of"].items():
        if what == "time limit":
            print(f"  possible endless loop: with seed {number} it ran to the time limit")
        else:
            print(f"  error with seed {number}: {what}")
    coverage = document["coverage"]
    print(f"  {coverage['share']:.0%} of {coverage['nodes']} nodes began")
    for key, words in (
        ("never_ticked", "never ticked (with all below)"),
        ("never_failed", "never failed"),
        ("never_succeeded", "never succeeded"),
        ("never_left", "never finished"),
        ("unused_recoveries", "recovery never used"),
    ):
        if coverage[key]:
            print(f"  {words}: {_some(coverage[key])}")


def _some(names: list[str]) -> str:
    rest = f" and {len(names) - MOST_NAMES} more" if len(names) > MOST_NAMES else ""
    return ", ".join(names[:MOST_NAMES]) + rest
