"""Chromaticities: rgb divided by its sum, which shading does not change."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import ObjectModel

_DARK = 0.02
"""Added to each channel: the chromaticity of black is noise."""


def model_palette(model: ObjectModel) -> NDArray[np.float64]:
    """The colours that a model has somewhere, (K, 3) rgb, 0 to 1."""
    return np.array([model.color, *model.visual_colors])


def color_distances(colors: NDArray[np.uint8], palette: NDArray[np.float64]) -> NDArray[np.float64]:
    """Distances (N,) of the chromaticities of ``colors`` (N, 3) to the nearest in ``palette`` (K, 3), 0 to 1."""
    seen = colors.astype(np.float64) / 255.0 + _DARK
    seen /= seen.sum(axis=1, keepdims=True)
    wanted = palette + _DARK
    wanted /= wanted.sum(axis=1, keepdims=True)
    distances: NDArray[np.float64] = np.linalg.norm(seen[:, None] - wanted, axis=2).min(axis=1)
    return distances
