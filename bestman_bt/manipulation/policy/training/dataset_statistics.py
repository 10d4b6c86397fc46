"""Statistics of the features of a dataset, as LeRobot stores them for each episode and for all."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

THINNED = 4
"""Every so many pixels of a picture count in its statistics."""


class FeatureStatistics:
    """Statistics of one feature of ``size`` numbers; for images of the channels over all pixels, 0 to 1."""

    def __init__(self, size: int) -> None:
        self.low, self.high = np.full(size, np.inf), np.full(size, -np.inf)
        self._sum, self._squares = np.zeros(size), np.zeros(size)
        self._samples = 0
        self.count = 0

    def add(self, values: ArrayLike) -> None:
        """Add (N, size) numbers of N frames."""
        array = np.asarray(values, dtype=float).reshape(-1, len(self.low))
        self._include(array, len(array))

    def add_picture(self, picture: NDArray[np.uint8]) -> None:
        """Add one (H, W, 3) image, sampled at each ``THINNED``th pixel in both directions."""
        self._include(picture[::THINNED, ::THINNED].reshape(-1, 3) / 255.0, 1)

    def to_dict(self, picture: bool = False) -> dict[str, Any]:
        """Return the entry of LeRobot's ``stats.json``; for images each value is (3, 1, 1)."""
        mean = self._sum / self._samples
        std = np.sqrt(np.maximum(self._squares / self._samples - mean**2, 0.0))
        found = {"min": self.low, "max": self.high, "mean": mean, "std": std}
        shape = (3, 1, 1) if picture else (-1,)
        return {name: value.reshape(shape).tolist() for name, value in found.items()} | {"count": [self.count]}

    def _include(self, samples: NDArray[np.float64], frames: int) -> None:
        self.low, self.high = np.minimum(self.low, samples.min(axis=0)), np.maximum(self.high, samples.max(axis=0))
        self._sum += samples.sum(axis=0)
        self._squares += (samples**2).sum(axis=0)
        self._samples += len(samples)
        self.count += frames


def combined(total: Mapping[str, Any] | None, episode: Mapping[str, Any]) -> dict[str, Any]:
    """Return the statistics of all frames, from those of the frames so far and of a further episode."""
    names = ("min", "max", "mean", "std")
    if total is None:
        return {name: episode[name] for name in (*names, "count")}
    (old, new) = (int(one["count"][0]) for one in (total, episode))
    share = new / (old + new)
    low, high, mean, std = (np.array(total[name], dtype=float) for name in names)
    low_here, high_here, mean_here, std_here = (np.array(episode[name], dtype=float) for name in names)
    together = mean + share * (mean_here - mean)
    variance = (1 - share) * (std**2 + (mean - together) ** 2) + share * (std_here**2 + (mean_here - together) ** 2)
    values = (np.minimum(low, low_here), np.maximum(high, high_here), together, np.sqrt(variance))
    return {name: value.tolist() for name, value in zip(names, values, strict=True)} | {"count": [old + new]}
