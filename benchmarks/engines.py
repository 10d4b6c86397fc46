"""Runs the same tasks and seeds on each physics engine, and tells success, accuracy and speed side by side.

Run it with ``python -m benchmarks.engines [--tasks fetch_cup,pick_place_table] [--seeds 900000,900001] [--json]``. The
engines take turns, seed by seed, so that what else the machine does slows both; figures are of one process, without
recording. ``cpu_time_factor`` is simulated over processor time, with the set-up of the episode.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
from statistics import median
from typing import Any

from benchmarks.fetch import FIRST_SEED, Episode, measure, summary
from bestman_bt.configuration.run import load_run
from bestman_bt.evaluation.episode import run_episode
from bestman_bt.evaluation.versions import versions
from bestman_bt.extras import EXTRA_OF_SIMULATOR, is_installed

SHOWN = ("successes", "clean_audits", "cpu_time_factor", "real_time_factor", "simulated_s", "cpu_s")


def figures(episodes: list[Episode]) -> dict[str, Any]:
    """Those of one engine on one task; medians of what the judge has measured."""
    names = sorted({name for episode in episodes for name in episode.metrics})
    return {
        **summary(episodes),
        "clean_audits": sum(episode.clean for episode in episodes),
        "median": {name: median(e.metrics[name] for e in episodes if name in e.metrics) for name in names},
    }


def print_figures(found: dict[str, Any]) -> None:
    """In lines."""
    for key in SHOWN:
        print(f"  {key:24} {found[key]:8.2f}")
    for name, value in found["median"].items():
        print(f"  {name:24} {value:8.2f}")
    for stage, seconds in found["cpu_s_by_stage"].items():
        print(f"    {stage:22} {seconds:6.2f} s")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--tasks", default="fetch_cup,pick_place_table", help="comma-separated")
    parser.add_argument("--seeds", default=f"{FIRST_SEED},{FIRST_SEED + 1},{FIRST_SEED + 2}", help="comma-separated")
    parser.add_argument("--json", action="store_true", help="one JSON document instead of lines")
    arguments = parser.parse_args()
    engines = [driver for driver, extra in EXTRA_OF_SIMULATOR.items() if is_installed(extra)]
    document: dict[str, Any] = {"tasks": {}}
    for driver in engines:  # what is imported and compiled once is no part of the figures
        run_episode(load_run("fetch_cup", seed=FIRST_SEED + 99, driver=driver))
    for task in arguments.tasks.split(","):
        episodes: dict[str, list[Episode]] = {driver: [] for driver in engines}
        for seed in map(int, arguments.seeds.split(",")):
            for driver in engines:
                episodes[driver].append(measure(seed, None, task, driver))
        document["tasks"][task] = {driver: figures(found) for driver, found in episodes.items()}
    document["machine"] = {
        "processor": platform.processor() or platform.machine(),
        "cores": os.cpu_count(),
        "load": os.getloadavg(),
    }
    document["versions"] = versions()
    if arguments.json:
        print(json.dumps(document))
        return
    for task, by_engine in document["tasks"].items():
        for driver, found in by_engine.items():
            print(f"{task}, {driver}, {len(found['seeds'])} seeds")
            print_figures(found)


if __name__ == "__main__":
    main()
