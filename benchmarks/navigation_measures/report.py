"""How the navigation benchmarks tell what they found."""

from __future__ import annotations

import json
import os
import platform
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from bestman_bt.evaluation.versions import versions


def median(values: Sequence[float]) -> float | None:
    """None of nothing."""
    return float(np.median(values)) if len(values) else None


def mean(values: Sequence[float]) -> float | None:
    """None of nothing."""
    return float(np.mean(values)) if len(values) else None


def percentile(values: Sequence[float], share: float) -> float | None:
    """None of nothing."""
    return float(np.percentile(values, share)) if len(values) else None


def scaled(value: float | None, factor: float) -> float | None:
    """In another unit."""
    return None if value is None else factor * value


def machine() -> dict[str, Any]:
    """What it was measured on."""
    load = round(os.getloadavg()[0], 2) if hasattr(os, "getloadavg") else None
    return {"platform": platform.platform(), "cores": os.cpu_count(), "load": load}


def print_report(report: Mapping[str, Any], as_json: bool) -> None:
    """One JSON document with machine and versions, or a line for each key."""
    if as_json:
        print(json.dumps({**report, "machine": machine(), "versions": versions()}, allow_nan=False))
        return
    for key, value in report.items():
        print(f"{key:44} {value:.4f}" if isinstance(value, float) else f"{key:44} {value}")
