"""Measures how well the base knows where it is, with slipping wheels and a noisy lidar, and whether it finds itself.

Run it with ``python benchmarks/localisation.py [--episodes N] [--seed S] [--localizer NAME] [--json]``; the keys are
those of docs/localisation.md. Every other episode is in the kitchen, the others each in an apartment of its own. All
poses that count as truth come from the simulator, and only this program sees them.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.navigation_measures.knowing_where import LOCALIZER, measure
from benchmarks.navigation_measures.report import print_report


def main() -> None:
    """Parse the command line, drive, print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--episodes", type=int, default=20, help="drives, and as many kidnaps")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--localizer", default=LOCALIZER)
    parser.add_argument("--only", choices=["track", "kidnap"], help="drives, or kidnaps")
    parser.add_argument("--json", action="store_true", help="one JSON document instead of lines")
    asked = parser.parse_args()
    if asked.episodes < 1:
        parser.error("--episodes should be at least 1")
    of = (asked.only,) if asked.only else ("track", "kidnap")
    found = measure(asked.seed, asked.episodes, asked.localizer, of)
    print_report(found.summary(asked.seed, asked.localizer), asked.json)


if __name__ == "__main__":
    main()
