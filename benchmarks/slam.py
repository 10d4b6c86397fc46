"""Maps apartments by exploration in physics, and judges the map and the way with and without loop closures.

``python benchmarks/slam.py [--apartments N] [--seed S] [--area M2] [--slip SHARE] [--json] [--pictures DIR]``;
docs/slam.md tells the keys. The control without loop closures is the same readings given to SLAM again. All poses that
count as truth come from the simulator, and only this program sees them.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.navigation_measures.apartment_maps import AREA, SLIP, measure
from benchmarks.navigation_measures.report import print_report


def main() -> None:
    """Parse the command line, explore, print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--apartments", type=int, default=5)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--area", type=float, default=AREA, help="of an apartment, square metres")
    parser.add_argument("--slip", type=float, default=SLIP, help="mean share by which wheels turn without driving")
    parser.add_argument("--set", action="append", default=[], metavar="key=value", dest="settings")
    parser.add_argument("--json", action="store_true", help="one JSON document instead of lines")
    parser.add_argument("--pictures", type=Path, metavar="DIR", help="draw each map, and save it")
    asked = parser.parse_args()
    if asked.apartments < 1:
        parser.error("--apartments should be at least 1")
    report = measure(asked.seed, asked.apartments, asked.area, asked.slip, asked.settings, asked.pictures)
    print_report(report, asked.json)


if __name__ == "__main__":
    main()
