"""Perception, measured: known objects, yaw, unknown things, handles, and grasps in physics.

    python benchmarks/perception.py [--seed S] [--json] [--frames N] [--grasps N] [--quick] [--only known,handles,…]

Images are rendered at 640×480 with the noise of a structured-light camera; scenes are drawn from the seed. Of the
grasps, N are of known objects that stand alone, N/2 of crowded ones and N/2 of unknown things. Intervals: 95 %.
Times: processor time of one frame, one BLAS thread.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import platform
import sys
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("OMP_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from rich.console import Console
from rich.table import Table

from benchmarks.perception_measures import (
    asymmetric_objects,
    grasps,
    handles,
    invented_objects,
    known_objects,
    unknown_objects,
)
from bestman_bt.evaluation.versions import versions

TARGETS: Mapping[str, tuple[str, float]] = {
    "identity_rate": ("≥", 0.98),
    "add_s_median_mm": ("≤", 2.5),
    "add_s_p90_mm": ("≤", 5.0),
    "yaw_p90_deg_second_look": ("≤", 10.0),
    "ambiguity_coverage": ("≥", 0.97),
    "ambiguity_width_deg_mean": ("≤", 60.0),
    "unknown_segmented_rate": ("≥", 0.95),
    "unknown_grasp_rate": ("≥", 0.80),
    "known_grasp_rate": ("≥", 0.96),
    "known_grasp_rate_clutter": ("≥", 0.90),
    "handle_recall": ("≥", 0.95),
    "handle_false_positives_per_frame": ("≤", 0.1),
    "handle_position_mm": ("≤", 5.0),
    "handle_axis_deg": ("≤", 1.0),
    "ms_per_frame": ("≤", 250.0),
}
"""The figures of the report, in its order, and what they should reach."""
QUICK_FRAMES, QUICK_GRASPS = 6, 6

Measure = Callable[[argparse.Namespace], dict[str, Any]]
MEASURES: Mapping[str, Measure] = {
    "known": lambda o: known_objects.measure(o.seed, o.frames),
    "asymmetric": lambda o: asymmetric_objects.measure(o.seed, o.frames),
    "invented": lambda o: invented_objects.measure(o.seed, o.frames),
    "handles": lambda o: handles.measure(o.seed, o.frames),
    "unknown": lambda o: unknown_objects.measure(o.seed, -(-o.grasps // 2), o.jobs, o.pictures),
    "grasps": lambda o: grasps.measure(o.seed, o.grasps, -(-o.grasps // 2), o.jobs, o.pictures),
}


def run(options: argparse.Namespace) -> dict[str, object]:
    """All that was asked for: the figures of TARGETS first, what lies behind them in ``details``."""
    progress = Console(stderr=True)
    details: dict[str, dict[str, Any]] = {}
    seconds: dict[str, float] = {}
    for name in options.only:
        progress.print(f"{name} …")
        start = time.perf_counter()
        details[name] = MEASURES[name](options)
        seconds[name] = round(time.perf_counter() - start, 1)
    figures = {key: value for measured in details.values() for key, value in measured.items()}
    report: dict[str, object] = {"seed": options.seed, "frames": options.frames}
    report |= {key: figures.get(key) for key in TARGETS}
    report["intervals"] = {key: interval for key in TARGETS if (interval := interval_of(key, figures)) is not None}
    report |= {"grasps": options.grasps, "seconds": seconds, "details": details}
    load = round(os.getloadavg()[0], 2) if hasattr(os, "getloadavg") else None
    report["machine"] = {"platform": platform.platform(), "cores": os.cpu_count(), "load": load}
    report["versions"] = versions()
    printable: dict[str, object] = strict(report)
    return printable


def interval_of(key: str, figures: Mapping[str, Any]) -> list[float] | None:
    """The 95 % interval that the measures give beside a figure."""
    found: list[float] | None = figures.get(f"{key}_interval", figures.get(f"{key.removesuffix('_rate')}_interval"))
    return found


def strict(value: Any) -> Any:
    """The same with None for what JSON cannot say: numbers that are not finite."""
    if isinstance(value, Mapping):
        return {key: strict(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [strict(item) for item in value]
    if isinstance(value, float):
        return float(value) if math.isfinite(value) else None
    return value


def table(report: Mapping[str, Any]) -> Table:
    """The figures beside their targets."""
    drawn = Table(title=f"Perception, seed {report['seed']}, {report['frames']} frames, {report['grasps']} grasps")
    for column in ("figure", "value", "95 %", "target", "reached"):
        drawn.add_column(column, justify="left" if column == "figure" else "right")
    for key, (sign, target) in TARGETS.items():
        value = report[key]
        interval = " to ".join(f"{end:.3g}" for end in report["intervals"].get(key, ()))
        reached = "" if value is None else "yes" if (value >= target if sign == "≥" else value <= target) else "no"
        drawn.add_row(key, "not measured" if value is None else f"{value:.4g}", interval, f"{sign} {target:g}", reached)
    return drawn


def read_options(arguments: list[str] | None = None) -> argparse.Namespace:
    """Checked; exits with code 2 where they are wrong."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=5000, help="first seed; below 5000 for development")
    parser.add_argument("--frames", type=int, help="images of each kind (default 100)")
    parser.add_argument("--grasps", type=int, help="grasps of known objects that stand alone (default 200)")
    parser.add_argument("--quick", action="store_true", help=f"{QUICK_FRAMES} frames and {QUICK_GRASPS} grasps")
    parser.add_argument("--only", default=",".join(MEASURES), help=f"some of {','.join(MEASURES)}")
    parser.add_argument("--jobs", type=int, default=1, help="processes for the grasps; results do not depend on it")
    parser.add_argument("--pictures", type=Path, help="folder for pictures of grasps that failed")
    parser.add_argument("--json", action="store_true", help="one JSON document on standard output")
    options = parser.parse_args(arguments)
    options.frames = options.frames if options.frames is not None else QUICK_FRAMES if options.quick else 100
    options.grasps = options.grasps if options.grasps is not None else QUICK_GRASPS if options.quick else 200
    options.only = tuple(dict.fromkeys(options.only.split(",")))
    unknown = [name for name in options.only if name not in MEASURES]
    if unknown:
        parser.error(f"--only: there is no {', '.join(map(repr, unknown))}; there is {', '.join(MEASURES)}")
    for name, least in (("seed", 0), ("frames", 1), ("grasps", 1), ("jobs", 1)):
        if getattr(options, name) < least:
            parser.error(f"--{name} should be {least} or more but is {getattr(options, name)}")
    return options


def main() -> None:
    """Read the options, measure, print."""
    options = read_options()
    report = run(options)
    if options.json:
        print(json.dumps(report, ensure_ascii=False, allow_nan=False))
    else:
        Console().print(table(report))


if __name__ == "__main__":
    main()
