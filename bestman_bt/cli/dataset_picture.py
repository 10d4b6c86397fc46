"""A picture of an episode of a dataset: what the cameras saw, and states, actions and running leaves over time."""

from __future__ import annotations

from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

from bestman_bt.manipulation.policy.training.dataset_folder import DatasetError, DatasetFolder, entry_names
from bestman_bt.manipulation.policy.training.dataset_video import pictures

PICTURES = 8
"""Number of pictures per camera, spread evenly over the episode."""
STATE, ACTION, NODE = "observation.state", "action", "node"


def draw_episode(dataset: DatasetFolder, episode: int, path: Path) -> None:
    """Write the picture as a PNG. Raises DatasetError if files are missing, MissingExtraError if the dataset has videos
    and PyAV is not installed.
    """
    data, row, videos = dataset.data(episode), dataset.episodes[episode], dataset.videos
    times = np.array(data["timestamp"])
    curves = _curves(dataset, data)
    spans = _spans(data.get(NODE, []), times)
    if not (videos or curves or spans):
        raise DatasetError(f"{dataset.path} has no videos, no states with actions of the same names, and no {NODE}")
    heights = [*[1.2] * len(videos), *[2.0] * len(curves), *([0.3 + 0.16 * len(spans)] if spans else [])]
    figure = Figure(figsize=(12, 0.6 + sum(heights)), dpi=100, layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(len(heights), 1, squeeze=False, gridspec_kw={"height_ratios": heights})[:, 0]
    figure.suptitle(f"episode {episode} of {dataset.path.name}: {', '.join(row['tasks'])}")
    for name, axis in zip(videos, axes, strict=False):
        axis.imshow(_strip(dataset, episode, name))
        axis.set(title=name, xticks=[], yticks=[])
    for (unit, entries), axis in zip(curves.items(), axes[len(videos) :], strict=False):
        for name, state, action in entries:
            (line,) = axis.plot(times, state, label=name, linewidth=1)
            axis.plot(times, action, color=line.get_color(), linewidth=0.8, linestyle=":")
        axis.set(ylabel=unit, xlim=(times[0], times[-1]))
        axis.legend(fontsize=6, loc="center left", bbox_to_anchor=(1.0, 0.5))
    if spans:
        axis = axes[-1]
        for place, (name, start, end) in enumerate(spans):
            axis.barh(place, end - start, left=start)
            axis.text(end, place, f" {name}", va="center", fontsize=6)
        axis.set(yticks=[], xlim=(times[0], times[-1]), xlabel="s; dotted: actions")
        axis.invert_yaxis()
    figure.savefig(path)


def _curves(
    dataset: DatasetFolder, data: dict[str, list[Any]]
) -> dict[str, list[tuple[str, NDArray[np.float64], NDArray[np.float64]]]]:
    """Return unit → name, state and action of its entries; empty for a dataset whose states and actions differ."""
    feature, commanded = dataset.features.get(STATE), dataset.features.get(ACTION)
    if feature is None or commanded is None or entry_names(feature) != entry_names(commanded):
        return {}
    state, action = np.array(data[STATE], dtype=float), np.array(data[ACTION], dtype=float)
    names = entry_names(feature) or [str(column) for column in range(feature["shape"][0])]
    units = feature.get("units") or [""] * len(names)
    curves: dict[str, list[tuple[str, NDArray[np.float64], NDArray[np.float64]]]] = {}
    for column, (name, unit) in enumerate(zip(names, units, strict=True)):
        curves.setdefault(unit, []).append((name, state[:, column], action[:, column]))
    return curves


def _spans(nodes: list[str], times: NDArray[np.float64]) -> list[tuple[str, float, float]]:
    """Return the last part of the name, and begin and end in seconds, of each stretch with the same running leaves."""
    spans = []
    for name, group in groupby(enumerate(nodes), key=lambda frame: frame[1]):
        frames = [index for index, _ in group]
        if name:
            end = min(frames[-1] + 1, len(times) - 1)
            spans.append((name.rpartition("/")[2], float(times[frames[0]]), float(times[end])))
    return spans


def _strip(dataset: DatasetFolder, episode: int, name: str) -> NDArray[np.uint8]:
    path, start, end = dataset.video(episode, name)
    wanted = set(np.linspace(0, dataset.episodes[episode]["length"] - 1, PICTURES).astype(int).tolist())
    try:
        return np.hstack([picture for index, picture in enumerate(pictures(path, start, end)) if index in wanted])
    except ValueError as error:
        raise DatasetError(f"{path} cannot be decoded as a video: {error}") from error
