"""Minimum, maximum, mean, deviation and count of what a dataset holds, as LeRobot keeps them."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray


class FeatureStatistics:
    """Of one feature of ``size`` numbers; pictures count their channels over all pixels, 0 to 1."""

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
        """Add one (H, W, 3) picture; each fourth pixel both ways is looked at."""
        self._include(picture[::4, ::4].reshape(-1, 3) / 255.0, 1)

    def to_dict(self, picture: bool = False) -> dict[str, Any]:
        """As LeRobot's ``stats.json`` has it; of pictures each number is (3, 1, 1)."""
        mean = self._sum / self._samples
        std = np.sqrt(np.maximum(self._squares / self._samples - mean**2, 0.0))
        found = {"min": self.low, "max": self.high, "mean": mean, "std": std}
        shape = (3, 1, 1) if picture else (-1,)
        return {name: value.reshape(shape).tolist() for name, value in found.items()} | {"count": [self.count]}

    def _include(self, rows: NDArray[np.float64], frames: int) -> None:
        self.low, self.high = np.minimum(self.low, rows.min(axis=0)), np.maximum(self.high, rows.max(axis=0))
        self._sum += rows.sum(axis=0)
        self._squares += (rows**2).sum(axis=0)
        self._samples += len(rows)
        self.count += frames
