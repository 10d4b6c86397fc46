"""Colours of models and clusters: chromaticity histograms over a model's few colours.

Swain and Ballard, "Color Indexing", 1991, with the model's own colours as bins. Chromaticity (rgb divided by its sum)
does not change with shading; brightness tells white from black, but weighs little.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

_DARK = 0.02
"""Added to each channel: the chromaticity of black is noise."""


def palette_distance(colors: NDArray[np.uint8], palette: NDArray[np.float64], shares: NDArray[np.float64]) -> float:
    """How badly the colours (N, 3) of a cluster fit to a model's, 0 to about 1.

    ``palette``: (K, 3) rgb, each 0 to 1. ``shares``: (Y, K) how much of the model's visible surface has each colour, at
    each yaw. It is the mean distance of each point to the nearest colour of the palette, and 0.3 times how far the
    shares of the colours are off at the best yaw, beyond 0.08: something nearer may hide a part.
    """
    seen = colors[np.linspace(0, len(colors) - 1, min(len(colors), 400)).astype(np.intp)].astype(np.float64) / 255.0
    distance = np.linalg.norm(_chromaticity(seen)[:, None] - _chromaticity(palette)[None], axis=2)
    brightness = np.log((seen.sum(axis=1) + 3 * _DARK)[:, None] / (palette.sum(axis=1) + 3 * _DARK)[None])
    distance = distance + 0.1 * np.maximum(0.0, np.abs(brightness) - np.log(2.0)) + 0.01 * np.abs(brightness)
    nearest = distance.argmin(axis=1)
    found = np.bincount(nearest, minlength=len(palette)) / len(seen)
    mixed_up = float(np.abs(found - shares).sum(axis=1).min()) / 2
    return float(np.minimum(distance.min(axis=1), 0.4).mean()) + 0.3 * max(0.0, mixed_up - 0.08)


def _chromaticity(rgb: NDArray[np.float64]) -> NDArray[np.float64]:
    lit = rgb + _DARK
    chromaticity: NDArray[np.float64] = lit / lit.sum(axis=-1, keepdims=True)
    return chromaticity
