"""Faults of twins while a tree runs on the robot: when the robot was told to stop, how the leaf failed, what is left.

Usage: python -m benchmarks.twin_faults [--runs 5] [--only xarm/…] [--json]. Each run is a session of its own over twins
of all the robot's controllers; its tree is a Fallback of what the fault strikes and of a recovery, which clears the
stop and moves on. Times are seconds from when the fault was asked for, on the clock that both processes share.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import sys
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import asdict

from benchmarks.fault_trials.trial import TRIALS, Report, Trial, run_trial
from bestman_bt.configuration import load_run
from bestman_bt.runtime import Setup, prepare
from hal.twins import TwinProcess

SCENE, SEED = "pick_place_table", 11


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("--only", default="", help="trials whose name begins with this")
    parser.add_argument("--json", action="store_true")
    arguments = parser.parse_args()
    chosen = [trial for trial in TRIALS if trial.name.startswith(arguments.only)]
    reports = {trial.name: [] for trial in chosen}
    for trial, report in _reports(chosen, arguments.runs):
        reports[trial.name].append(report)
        print(f"{trial.name}: {report}", file=sys.stderr, flush=True)
    rows = [_row(trial, reports[trial.name]) for trial in chosen]
    if arguments.json:
        runs = {name: [asdict(report) for report in told] for name, told in reports.items()}
        print(json.dumps({"cores": os.cpu_count(), "load": os.getloadavg()[0], "faults": rows, "runs": runs}, indent=1))
        return
    print(f"load {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores; {arguments.runs} runs each; ms after the fault")
    for row in rows:
        print("  ".join(f"{key}: {value}" for key, value in row.items()))


def _reports(trials: list[Trial], runs: int) -> Iterator[tuple[Trial, Report]]:
    """Robot by robot: twins start once for all of its trials."""
    for robot in dict.fromkeys(trial.robot for trial in trials):
        with ExitStack() as stack:
            twin = stack.enter_context(TwinProcess(robot, SCENE, SEED))
            setup = hardware_setup(robot, twin)
            for trial in (trial for trial in trials if trial.robot == robot):
                for _ in range(runs):
                    yield trial, run_trial(trial, twin, setup)


def hardware_setup(robot: str, twin: TwinProcess) -> Setup:
    """The robot with twins in place of its controllers, in the world that these show."""
    settings = [f"robot.{key}={value}" for key, value in twin.settings.items()]
    return prepare(load_run("pick_place_table", robot=robot, seed=SEED, settings=settings, driver="hardware"))


def _row(trial: Trial, reports: list[Report]) -> dict[str, object]:
    def figures(values: list[float]) -> str:
        return f"{1e3 * statistics.median(values):.0f}, {1e3 * max(values):.0f}" if values else "-"

    return {
        "fault": trial.name,
        "allowed": f"{1e3 * trial.allowed:.0f}",
        "stop commanded (median, max)": figures([r.stopped for r in reports if r.stopped is not None]),
        "leaf failed": figures([r.failed for r in reports]),
        "codes": " ".join(sorted({r.code for r in reports})),
        "at rest": f"{sum(r.at_rest for r in reports)}/{len(reports)}",
        "recovered": f"{sum(r.recovered for r in reports)}/{len(reports)}",
        "orphans": sum(len(r.orphans) for r in reports),
        "in time": all((r.failed if r.stopped is None else r.stopped) <= trial.allowed for r in reports),
    }


if __name__ == "__main__":
    main()
