"""A picture of what a calibration leaves over: how far corners are from where they should be, and each view's share."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from bestman_bt.runtime.calibration.result import CalibrationResult


def plot_residuals(result: CalibrationResult, path: Path) -> None:
    """Write a PNG: offsets of all corners in pixels, and the root mean square of each view."""
    figure = Figure(figsize=(10.0, 4.4), layout="constrained")
    FigureCanvasAgg(figure)
    scatter, bars = figure.subplots(1, 2, width_ratios=(1.0, 1.6))
    offsets = np.concatenate(result.offsets)
    reach = 1.1 * max(float(np.percentile(np.abs(offsets), 99.5)), 0.05)
    shades = np.concatenate([np.full(len(offset), i) for i, offset in enumerate(result.offsets)])
    scatter.scatter(offsets[:, 0], offsets[:, 1], c=shades, s=7, cmap="viridis", alpha=0.7, linewidths=0)
    scatter.axhline(0.0, color="0.6", linewidth=0.8)
    scatter.axvline(0.0, color="0.6", linewidth=0.8)
    scatter.set(xlim=(-reach, reach), ylim=(reach, -reach), aspect="equal", xlabel="u, pixels", ylabel="v, pixels")
    scatter.set_title(f"{len(offsets)} corners, {result.error:.2f} px root mean square")
    bars.bar(range(len(result.views)), result.errors, color="#4878a8")
    bars.axhline(result.error, color="#c0504d", linewidth=1.2)
    bars.set_xticks(range(len(result.views)), result.views, rotation=90, fontsize=7)
    bars.set(ylabel="pixels", title=f"{result.camera}, {result.kind.replace('_', '-')}: each view")
    bars.margins(x=0.01)
    figure.savefig(path, dpi=110, metadata={"Software": ""})
