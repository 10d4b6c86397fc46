"""Navigation, measured: drives, also among walking people, exploration, localisation with slipping wheels.

    python benchmarks/navigation.py [--json] [--seed S] [--goals N] [--walker-goals N] [--apartments N] [--episodes N]

Each part is a benchmark of its own with more figures: drives with ``--details``, the others slam.py and
localisation.py; docs/navigation.md tells the keys. All poses that count as truth come from the simulator, and only
these programs see them. A part of which nothing is asked (0) is left out, and its keys are null.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.navigation_measures import apartment_maps, drives, knowing_where
from benchmarks.navigation_measures.report import print_report

KEYS = {
    "drives": (
        "goals",
        "reached_rate",
        "contacts",
        "final_error_mm_median",
        "final_yaw_deg_median",
        "path_ratio_median",
        "plan_ms_median",
        "local_tick_ms_p95",
    ),
    "walkers": ("reached_rate_dynamic", "contacts_dynamic"),
    "slam": ("slam_ate_rmse_m", "slam_wall_cells_within_5cm", "exploration_sim_s"),
    "localisation": ("localisation_error_mm_mean", "kidnap_recovered_rate"),
}
"""What each part tells, in the order of the report."""


def run(asked: argparse.Namespace) -> tuple[dict[str, Any], dict[str, Any]]:
    """The figures, and what lies behind them by part."""
    task = "navigate_kitchen" if asked.kitchen else "navigate_apartment"

    def drive(task: str, goals: int) -> dict[str, Any]:
        return drives.measure(task, asked.seed, goals, asked.worlds, asked.settings).summary(asked.seed)

    parts: Mapping[str, tuple[int, Callable[[], dict[str, Any]]]] = {
        "drives": (asked.goals, lambda: drive(task, asked.goals)),
        "walkers": (asked.walker_goals, lambda: drive(f"{task}_walkers", asked.walker_goals)),
        "slam": (asked.apartments, lambda: apartment_maps.measure(asked.seed, asked.apartments)),
        "localisation": (
            asked.episodes,
            lambda: knowing_where.measure(asked.seed, asked.episodes).summary(asked.seed),
        ),
    }
    details: dict[str, Any] = {}
    for name, (count, measure) in parts.items():
        if count:
            begin = time.perf_counter()
            details[name] = measure()
            print(f"{name}: {time.perf_counter() - begin:.0f} s", file=sys.stderr, flush=True)
    if "walkers" in details:
        details["walkers"] |= {f"{key}_dynamic": details["walkers"][key] for key in ("reached_rate", "contacts")}
    figures: dict[str, Any] = {"seed": asked.seed}
    figures |= {key: details.get(name, {}).get(key) for name, keys in KEYS.items() for key in keys}
    worlds = {
        "drives": min(asked.worlds, asked.goals),
        "walkers": min(asked.worlds, asked.walker_goals),
        "slam": asked.apartments,
        "localisation": asked.episodes,
    }
    figures["seeds"] = {name: [asked.seed, asked.seed + worlds[name] - 1] for name in details}
    return figures, details


def main() -> None:
    """Parse the command line, measure, print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=0, help="the first of each part; below 5000 for development")
    parser.add_argument("--goals", type=int, default=100, help="drives")
    parser.add_argument("--walker-goals", type=int, default=100, help="drives while people walk about")
    parser.add_argument("--worlds", type=int, default=5, help="apartments, or kitchens, that the drives share")
    parser.add_argument("--apartments", type=int, default=5, help="that are explored")
    parser.add_argument("--episodes", type=int, default=30, help="drives with wheels that slip, and as many kidnaps")
    parser.add_argument("--kitchen", action="store_true", help="drive in the kitchen instead of in apartments")
    parser.add_argument("--set", action="append", default=[], metavar="key=value", dest="settings", help="for drives")
    parser.add_argument("--details", type=Path, metavar="FILE.json", help="write what lies behind the figures")
    parser.add_argument("--json", action="store_true", help="one JSON document instead of lines")
    asked = parser.parse_args()
    for name in ("seed", "goals", "walker_goals", "apartments", "episodes"):
        if getattr(asked, name) < 0:
            parser.error(f"--{name.replace('_', '-')} should be 0 or more but is {getattr(asked, name)}")
    if asked.worlds < 1:
        parser.error(f"--worlds should be 1 or more but is {asked.worlds}")
    figures, details = run(asked)
    if asked.details is not None:
        asked.details.write_text(json.dumps(details, indent=1), encoding="utf-8")
    print_report(figures, asked.json)


if __name__ == "__main__":
    main()
