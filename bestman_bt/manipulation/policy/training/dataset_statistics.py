"""Statistics of the features of a dataset, as LeRobot stores them for each episode and for all."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

THINNED = 4
"""Sampling step of the pixels of a picture in its statistics."""
QUANTILES = {"q01": 0.01, "q10": 0.1, "q50": 0.5, "q90": 0.9, "q99": 0.99}
"""Quantiles that LeRobot writes since 0.4; policies that normalise by quantiles need them."""


def number_statistics(values: NDArray[Any]) -> dict[str, Any]:
    """Return the entry of LeRobot's ``stats.json`` for a feature with (N,) or (N, size) values in N frames."""
    array = np.asarray(values, dtype=float).reshape(len(values), -1)
    found = {"min": array.min(axis=0), "max": array.max(axis=0), "mean": array.mean(axis=0), "std": array.std(axis=0)}
    found |= dict(zip(QUANTILES, np.quantile(array, list(QUANTILES.values()), axis=0), strict=True))
    return {name: value.tolist() for name, value in found.items()} | {"count": [len(array)]}


class PictureStatistics:
    """Statistics of the channels of pictures, 0 to 1, over the pixels of all of them."""

    def __init__(self) -> None:
        self._pixels = np.zeros((3, 256), dtype=np.int64)
        """Number of pixels by channel and value, (3, 256)."""
        self._count = 0

    def add(self, picture: NDArray[np.uint8]) -> None:
        """Add one (H, W, 3) picture, sampled at each ``THINNED``th pixel in both directions."""
        for channel, values in enumerate(picture[::THINNED, ::THINNED].reshape(-1, 3).T):
            self._pixels[channel] += np.bincount(values, minlength=256)
        self._count += 1

    def to_dict(self) -> dict[str, Any]:
        """Return the entry of LeRobot's ``stats.json``; each value is (3, 1, 1)."""
        levels, up_to = np.arange(256) / 255.0, self._pixels.cumsum(axis=1)
        total = up_to[:, -1]
        mean = self._pixels @ levels / total
        spread = (levels - mean[:, None]) ** 2
        found = {
            "min": levels[(up_to > 0).argmax(axis=1)],
            "max": levels[(up_to == total[:, None]).argmax(axis=1)],
            "mean": mean,
            "std": np.sqrt((self._pixels * spread).sum(axis=1) / total),
        }
        for name, share in QUANTILES.items():
            found[name] = levels[(up_to >= share * total[:, None]).argmax(axis=1)]
        return {name: value.reshape(3, 1, 1).tolist() for name, value in found.items()} | {"count": [self._count]}


def combined(total: Mapping[str, Any] | None, episode: Mapping[str, Any]) -> dict[str, Any]:
    """Return the statistics of all frames, from those of the frames so far and of a further episode.

    Quantiles do not follow from those of episodes: the median and lower ones become the minimum over all episodes,
    higher ones the maximum. They are omitted if an episode has none.
    """
    if total is None:
        return {name: episode[name] for name in ("min", "max", "mean", "std", *QUANTILES, "count") if name in episode}
    (old, new) = (int(one["count"][0]) for one in (total, episode))
    share = new / (old + new)
    there, here = ({name: np.array(value, dtype=float) for name, value in one.items()} for one in (total, episode))
    mean = there["mean"] + share * (here["mean"] - there["mean"])
    variances = [one["std"] ** 2 + (one["mean"] - mean) ** 2 for one in (there, here)]
    values = {
        "min": np.minimum(there["min"], here["min"]),
        "max": np.maximum(there["max"], here["max"]),
        "mean": mean,
        "std": np.sqrt((1 - share) * variances[0] + share * variances[1]),
    }
    for name, quantile in QUANTILES.items():
        if name in there and name in here:
            values[name] = (np.minimum if quantile <= 0.5 else np.maximum)(there[name], here[name])
    return {name: value.tolist() for name, value in values.items()} | {"count": [old + new]}
