"""Things found in images: names with boxes and masks, in pixels."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages.frozen_array import frozen_array
from bestman_bt.perception.errors import PerceptionError


@dataclass(frozen=True, eq=False)
class ImageDetection:
    """A named part of an image.

    ``score``: 0 to 1. ``box``: left, top, right, bottom in pixels; pixel (u, v) fills u - 0.5 to u + 0.5.
    ``mask``: (H, W) bool of the whole image, or None where only the box is known.
    Raises PerceptionError where the score or the box is none.
    """

    label: str
    score: float
    box: tuple[float, float, float, float]
    mask: NDArray[np.bool_] | None = None

    def __post_init__(self) -> None:
        left, top, right, bottom = self.box
        if not (np.isfinite(self.box).all() and left < right and top < bottom):
            raise PerceptionError(
                f"ImageDetection {self.label!r}: box should be left < right, top < bottom: {self.box}"
            )
        if not 0.0 <= self.score <= 1.0:
            raise PerceptionError(f"ImageDetection {self.label!r}: score should be 0 to 1 but is {self.score}")
        if self.mask is not None:
            object.__setattr__(self, "mask", frozen_array(self.mask, (None, None), "ImageDetection mask", np.bool_))

    def clipped(self, width: int, height: int) -> ImageDetection | None:
        """The part inside an image of that size; None where nothing is."""
        left, right = (float(np.clip(value, -0.5, width - 0.5)) for value in (self.box[0], self.box[2]))
        top, bottom = (float(np.clip(value, -0.5, height - 0.5)) for value in (self.box[1], self.box[3]))
        if left >= right or top >= bottom:
            return None
        return replace(self, box=(left, top, right, bottom))

    def holds(self, pixels: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Which of the pixels (N, 2), as (u, v), lie in the mask, else in the box; NaN lies in none."""
        left, top, right, bottom = self.box
        u, v = pixels[:, 0], pixels[:, 1]
        inside: NDArray[np.bool_] = (u >= left) & (u <= right) & (v >= top) & (v <= bottom)
        if self.mask is not None:
            height, width = self.mask.shape
            nearest = np.rint(np.where(inside[:, None], pixels, 0.0)).astype(np.intp)
            nearest = np.clip(nearest, 0, (width - 1, height - 1))
            inside &= self.mask[nearest[:, 1], nearest[:, 0]]
        return inside
