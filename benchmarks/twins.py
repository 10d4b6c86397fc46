"""A task over the wire, many times: vendor SDKs and rosbridge here, twins and physics in another process, in real time.

Usage: ``python benchmarks/twins.py --robot diff_xarm6 --seed 7500 --episodes 10 --json``. Each episode has twins of its
own. Both processes share this machine: what it does besides shows in the figures, so the load is told with them.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np

from bestman_bt.configuration.task import load_task
from bestman_bt.evaluation.interval import wilson_interval
from bestman_bt.evaluation.versions import versions
from hal.twins.process import TwinProcess

KEPT = ("success", "outcome", "tree_status", "failure", "audit", "metrics", "sim_time_s", "run_folder")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--robot", default="diff_xarm6")
    parser.add_argument("--task", default="pick_place_table")
    parser.add_argument("--seed", type=int, default=7500)
    parser.add_argument("--episodes", type=int, default=10)
    parser.add_argument("--runs", type=Path, default=Path("runs"), help="where run folders are made")
    parser.add_argument("--json", action="store_true", help="one JSON document on standard output")
    arguments = parser.parse_args()
    episodes = []
    for seed in range(arguments.seed, arguments.seed + arguments.episodes):
        episodes.append(episode(arguments, seed))
        told = episodes[-1]
        print(f"{arguments.robot}, seed {seed}: {told['outcome']} {told.get('metrics')}", file=sys.stderr)
    report = summary(arguments, episodes)
    print(json.dumps(report, indent=2) if arguments.json else report["line"])
    return 0 if report["placed"] == len(episodes) else 1


def episode(arguments: argparse.Namespace, seed: int) -> dict[str, Any]:
    """Start twins, run the task on them, judge it with their truth."""
    with TwinProcess(arguments.robot, load_task(arguments.task).scene, seed) as twin:
        command = [
            sys.executable,
            "-m",
            "bestman_bt.cli.main",
            "run",
            "--task",
            arguments.task,
            "--robot",
            arguments.robot,
        ]
        command += ["--driver", "hardware", "--seed", str(seed), "--judge", str(twin.judge_socket), "--json"]
        command += ["--runs", str(arguments.runs)]
        for key, value in twin.settings.items():
            command += ["--set", f"robot.{key}={value}"]
        load = os.getloadavg()[0]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if not done.stdout.strip():
            return {"seed": seed, "success": False, "outcome": "error", "said": done.stderr.strip().splitlines()[-1:]}
        result = json.loads(done.stdout)
    return {"seed": seed, "load": load} | {key: result[key] for key in KEPT if key in result}


def summary(arguments: argparse.Namespace, episodes: list[dict[str, Any]]) -> dict[str, Any]:
    """Counts, errors of the places, and what they were measured with."""
    placed = sum(bool(told["success"]) for told in episodes)
    errors = [told["metrics"].get("place_error_mm", np.nan) for told in episodes if told["success"]]
    low, high = wilson_interval(placed, len(episodes))
    median, worst = (float(np.median(errors)), float(np.max(errors))) if errors else (None, None)
    return {
        "line": f"{arguments.robot}: {placed} of {len(episodes)} ({low:.0%} to {high:.0%}), place error {median} mm",
        "robot": arguments.robot,
        "task": arguments.task,
        "seed": arguments.seed,
        "placed": placed,
        "interval": [low, high],
        "place_error_mm_median": median,
        "place_error_mm_worst": worst,
        "cores": os.cpu_count(),
        "versions": versions(),
        "episodes": episodes,
    }


if __name__ == "__main__":
    raise SystemExit(main())
