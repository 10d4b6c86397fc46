"""A front as if seen straight on: a grid of cells of its plane, with what the camera saw through each."""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from bestman_bt.perception.affordance.fronts import Front
from bestman_bt.perception.affordance.relief import Relief
from bestman_bt.perception.view import View


@dataclass(frozen=True, eq=False)
class RectifiedFront:
    """Cells of the plane z = 0 of a front; row 0 is the highest, column 0 the leftmost.

    ``low``: (2,) metres, x and y of the middle of the lowest left cell; ``cell``: metres. ``height``: (R, C) metres,
    mean of what the camera saw along the rays through the cell, against the front (negative: through an opening);
    NaN where unknown. ``noise``: (R, C) metres, of those means. ``rgb``: (R, C, 3) float32. ``outside``: (R, C), not
    in the image.
    """

    low: NDArray[np.float64]
    cell: float
    height: NDArray[np.float64]
    noise: NDArray[np.float64]
    rgb: NDArray[np.float32]
    outside: NDArray[np.bool_]

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        rows, columns = self.height.shape
        return rows, columns

    def x_of(self, column: float) -> float:
        """Metres."""
        return float(self.low[0] + column * self.cell)

    def y_of(self, row: float) -> float:
        """Metres."""
        return float(self.low[1] + (self.shape[0] - 1 - row) * self.cell)

    def column_of(self, x: float) -> float:
        """Cells, not rounded."""
        return float((x - self.low[0]) / self.cell)

    def row_of(self, y: float) -> float:
        """Cells, not rounded."""
        return float(self.shape[0] - 1 - (y - self.low[1]) / self.cell)

    @property
    def on_front(self) -> NDArray[np.bool_]:
        """The cells that show the front."""
        with np.errstate(invalid="ignore"):
            shown: NDArray[np.bool_] = np.abs(self.height) < np.maximum(0.006, 3.0 * self.noise)
        return shown

    @property
    def open(self) -> NDArray[np.bool_]:
        """The cells through which something farther back is seen."""
        with np.errstate(invalid="ignore"):
            seen_through: NDArray[np.bool_] = self.height < -np.maximum(0.009, 3.5 * self.noise)
        return seen_through


def rectify(
    view: View, front: Front, relief: Relief, margin: float = 0.11, finest: float = 0.0025, most_cells: int = 250_000
) -> RectifiedFront:
    """The front and ``margin`` metres around it, in cells about as large as a pixel, at least ``finest``
    metres."""
    low = front.low - margin
    extent = front.high + margin - low
    cell = max(finest, 0.9 * relief.pixel_size(), math.sqrt(float(np.prod(extent)) / most_cells))
    columns, rows = (int(n) for n in np.ceil(extent / cell) + 1)
    k = view.image.intrinsics
    camera_from_front = view.frame_from_camera.inverse() @ front.frame_from_front
    plane = np.column_stack([camera_from_front.rotation[:, :2], camera_from_front.position])
    cells = np.array([[cell, 0.0, low[0]], [0.0, -cell, low[1] + (rows - 1) * cell], [0.0, 0.0, 1.0]])
    offset = np.array([[1.0, 0.0, -relief.columns.start], [0.0, 1.0, -relief.rows.start], [0.0, 0.0, 1.0]])
    into_relief = offset @ k.matrix @ plane @ cells
    known = np.isfinite(relief.height)
    height = np.where(known, np.clip(relief.height, -0.5, 0.5), 0.0).astype(np.float32)
    weight = cv2.blur(known.astype(np.float32), (3, 3), borderType=cv2.BORDER_CONSTANT)
    total = cv2.blur(height, (3, 3), borderType=cv2.BORDER_CONSTANT)

    def warped(image: cv2.typing.MatLike, fill: float) -> NDArray[np.float32]:
        flags = cv2.INTER_NEAREST | cv2.WARP_INVERSE_MAP
        result: NDArray[np.float32] = np.asarray(
            cv2.warpPerspective(image, into_relief, (columns, rows), flags=flags, borderValue=(fill,) * 3)
        )
        return result

    weights = warped(weight, -1.0)
    totals = warped(total, 0.0)
    sigma = warped(relief.noise.astype(np.float32), 1.0)
    enough = weights > 0.1
    mean = np.where(enough, totals / np.where(enough, weights, 1.0), np.nan).astype(np.float64)
    noise = sigma / np.sqrt(np.maximum(9.0 * weights, 1.0))
    rgb = warped(view.image.rgb[relief.rows, relief.columns].astype(np.float32), 0.0)
    return RectifiedFront(low, cell, mean, noise.astype(np.float64), rgb, weights < 0)
