"""Faults of twins while a tree runs on the robot: when the robot was told to stop, how the leaf failed, what is left.

Usage: python -m benchmarks.twin_faults [--runs 5] [--only xarm/…] [--json]. Each run is a session of its own over twins
of all the robot's controllers; its tree is a Fallback of what the fault strikes and of a recovery, which clears the
stop and moves on. Times are seconds from when the fault was asked for, on the clock that both processes share. Names
that begin with client/: ``bestman-bt run`` is killed, or stopped by ``bestman-bt stop``.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import sys
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from typing import Any

from benchmarks.fault_trials.client_trial import CLIENT_TRIALS, ClientReport, ClientTrial, run_client_trial
from benchmarks.fault_trials.trial import TRIALS, Report, Trial, run_trial
from bestman_bt.configuration.run import load_run
from bestman_bt.runtime.resolved_config import ResolvedConfig, prepare
from hal.twins.process import TwinProcess

TASK, SEED = "pick_place_table", 11


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("--only", default="", help="trials whose name begins with this")
    parser.add_argument("--json", action="store_true")
    arguments = parser.parse_args()
    chosen = [trial for trial in (*TRIALS, *CLIENT_TRIALS) if trial.name.startswith(arguments.only)]
    reports: dict[str, list[Any]] = {trial.name: [] for trial in chosen}
    for name, report in _reports(chosen, arguments.runs):
        reports[name].append(report)
        print(f"load {os.getloadavg()[0]:.1f}, {name}: {report}", file=sys.stderr, flush=True)
    rows = [(_row if isinstance(trial, Trial) else _client_row)(trial, reports[trial.name]) for trial in chosen]
    if arguments.json:
        runs = {name: [asdict(report) for report in told] for name, told in reports.items()}
        print(json.dumps({"cores": os.cpu_count(), "load": os.getloadavg()[0], "faults": rows, "runs": runs}, indent=1))
        return
    print(f"load {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores; {arguments.runs} runs each; milliseconds")
    for row in rows:
        print("; ".join(f"{key}: {value}" for key, value in row.items()))


def hardware_setup(robot: str, twin: TwinProcess) -> ResolvedConfig:
    """The robot with twins in place of its controllers, in the world that these show."""
    settings = [f"robot.{key}={value}" for key, value in twin.settings.items()]
    return prepare(load_run(TASK, robot=robot, seed=SEED, settings=settings, driver="hardware"))


def _reports(trials: Sequence[Trial | ClientTrial], runs: int) -> Iterator[tuple[str, Report | ClientReport]]:
    """Robot by robot: twins start once for all of its trials."""
    for robot in dict.fromkeys(trial.robot for trial in trials):
        with TwinProcess(robot, TASK, SEED) as twin:
            setup = hardware_setup(robot, twin)
            for trial in (trial for trial in trials if trial.robot == robot):
                for _ in range(runs):
                    if isinstance(trial, Trial):
                        yield trial.name, run_trial(trial, twin, setup)
                    else:
                        yield trial.name, run_client_trial(trial, twin, setup)


def _row(trial: Trial, reports: list[Report]) -> dict[str, object]:
    return {
        "fault": trial.name,
        "allowed": round(1e3 * trial.allowed),
        "stop commanded": _figures([r.stopped for r in reports if r.stopped is not None]),
        "leaf failed": _figures([r.failed for r in reports]),
        "codes": " ".join(sorted({r.code for r in reports})),
        "in time": _share([(r.failed if r.stopped is None else r.stopped) <= trial.allowed for r in reports]),
        "at rest": _share([r.at_rest for r in reports]),
        "recovered": _share([r.recovered for r in reports]),
        "orphans": sum(len(r.orphans) for r in reports),
    }


def _client_row(trial: ClientTrial, reports: list[ClientReport]) -> dict[str, object]:
    return {
        "fault": trial.name,
        "allowed": round(1e3 * trial.allowed),
        "at rest after": _figures([r.rest for r in reports]),
        "exit codes": " ".join(sorted({str(r.code) for r in reports})),
        "in time": _share([r.rest <= trial.allowed for r in reports]),
        "orphans": sum(len(r.orphans) for r in reports),
    }


def _figures(seconds: list[float]) -> str:
    """Median and maximum, milliseconds."""
    return f"{1e3 * statistics.median(seconds):.0f}, {1e3 * max(seconds):.0f}" if seconds else "-"


def _share(of: list[bool]) -> str:
    return f"{sum(of)}/{len(of)}"


if __name__ == "__main__":
    main()
