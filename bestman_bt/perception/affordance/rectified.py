"""A front rectified to a frontal view: cells of its plane, the measurement in each, and the borders of panels."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Annotated, Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from bestman_bt.perception.affordance.fronts import FrontPlane, FrontSearch
from bestman_bt.perception.view import View


@dataclass(frozen=True, eq=False)
class HeightMap:
    """The rectangle of pixels around a front, in the front's frame.

    ``rows``, ``columns``: of the rectangle in the image. ``height``: (h, w) metres in front of the front, NaN where the
    depth is unknown. ``noise``: (h, w) metres, its standard deviation. ``near``: (h, w), the front or close to it.
    ``rays``: (h, w, 3), the directions of the pixels' rays; ``eye``: (3,) where they start.
    """

    front: FrontPlane
    rows: slice
    columns: slice
    height: NDArray[np.float64]
    noise: NDArray[np.float64]
    near: NDArray[np.bool_]
    rays: NDArray[np.float64]
    eye: NDArray[np.float64]

    def on_level(self, pixels: tuple[NDArray[np.intp], NDArray[np.intp]], level: float) -> NDArray[np.float64]:
        """Return the points (N, 2), metres, at which the rays of ``pixels`` (rows, columns) meet the plane ``level``
        metres in front.

        Unlike measured points, they are free of depth noise, which acts along the ray.
        """
        rays = self.rays[pixels]
        met: NDArray[np.float64] = self.eye[:2] + rays[:, :2] * ((level - self.eye[2]) / rays[:, 2])[:, None]
        return met

    def window(self, low: NDArray[np.float64], high: NDArray[np.float64], level: float) -> tuple[slice, slice]:
        """Return the slices (rows, columns) of the pixels that show x, y from ``low`` to ``high``, metres, in the plane
        ``level`` metres in front.
        """
        corners = np.array([[x, y, level] for x in (low[0], high[0]) for y in (low[1], high[1])]) - self.eye
        # rays[v, u] = rays[0, 0] + u right + v down, and a corner is a multiple of its pixel's ray.
        first = self.rays[0, 0]
        right, down = self.rays[0, 1] - first, self.rays[1, 0] - first
        u, v, scale = np.linalg.solve(np.stack([right, down, first], axis=1), corners.T)
        height, width = self.height.shape
        u, v = u / scale, v / scale
        rows = slice(int(np.clip(math.floor(v.min()), 0, height)), int(np.clip(math.ceil(v.max()) + 1, 0, height)))
        columns = slice(int(np.clip(math.floor(u.min()), 0, width)), int(np.clip(math.ceil(u.max()) + 1, 0, width)))
        return rows, columns

    def pixel_size(self) -> float:
        """Return the approximate size of a pixel on the front, metres."""
        return float(np.linalg.norm(self.eye) * np.linalg.norm(self.rays[0, 1] - self.rays[0, 0]))


def relief(view: View, front: FrontPlane, search: FrontSearch, margin: float = 0.08) -> HeightMap:
    """Return the relief of ``front``, with ``margin`` metres around it."""
    k = view.image.intrinsics
    grow = max(
        2, round(margin * k.fx / max(0.3, float(np.linalg.norm(front.frame_from_front.position - view.viewpoint))))
    )
    v, u = np.nonzero(front.region)
    rows = slice(max(0, int(v.min()) - grow), min(k.height, int(v.max()) + grow + 1))
    columns = slice(max(0, int(u.min()) - grow), min(k.width, int(u.max()) + grow + 1))
    front_from_camera = front.frame_from_front.inverse() @ view.frame_from_camera
    rotation, eye = front_from_camera.rotation, front_from_camera.position
    x = (np.arange(columns.start, columns.stop) - k.cx) / k.fx
    y = (np.arange(rows.start, rows.stop) - k.cy) / k.fy
    rays = x[None, :, None] * rotation[:, 0] + y[:, None, None] * rotation[:, 1] + rotation[:, 2]
    depth = view.image.depth[rows, columns].astype(np.float64)
    known = np.isfinite(depth) & (depth > 0)
    height = np.where(known, rays[..., 2] * depth + eye[2], np.nan)
    noise = search.noise(np.where(known, depth, 0.4)) + 0.0005
    near = cv2.dilate(front.region[rows, columns].astype(np.uint8), np.ones((2 * grow + 1, 2 * grow + 1), np.uint8)) > 0
    return HeightMap(front, rows, columns, height, noise, near, rays, eye)


@dataclass(frozen=True, eq=False)
class RectifiedFront:
    """An orthographic grid of the plane z = 0 of a front; row 0 is the highest, column 0 the leftmost.

    ``low``: (2,) metres, x and y of the centre of the lowest left cell; ``cell``: metres. ``height``: (R, C) metres,
    mean height of the measurements along the rays through the cell above the front (negative: through an opening); NaN
    where unknown. ``noise``: (R, C) metres, of those means. ``rgb``: (R, C, 3) float32. ``outside``: (R, C), not in the
    image.
    """

    low: NDArray[np.float64]
    cell: float
    height: NDArray[np.float64]
    noise: NDArray[np.float64]
    rgb: NDArray[np.float32]
    outside: NDArray[np.bool_]

    @property
    def shape(self) -> tuple[int, int]:
        """Numbers of rows and columns."""
        rows, columns = self.height.shape
        return rows, columns

    def x_of(self, column: float) -> float:
        """Return x of a column, metres."""
        return float(self.low[0] + column * self.cell)

    def y_of(self, row: float) -> float:
        """Return y of a row, metres."""
        return float(self.low[1] + (self.shape[0] - 1 - row) * self.cell)

    def column_of(self, x: float) -> float:
        """Return the column of ``x``, in cells, not rounded."""
        return float((x - self.low[0]) / self.cell)

    def row_of(self, y: float) -> float:
        """Return the row of ``y``, in cells, not rounded."""
        return float(self.shape[0] - 1 - (y - self.low[1]) / self.cell)

    @property
    def on_front(self) -> NDArray[np.bool_]:
        """The cells that show the front, (rows, columns) bool."""
        with np.errstate(invalid="ignore"):
            shown: NDArray[np.bool_] = np.abs(self.height) < np.maximum(0.006, 3.0 * self.noise)
        return shown

    @property
    def open(self) -> NDArray[np.bool_]:
        """The cells through which the camera sees something further back."""
        with np.errstate(invalid="ignore"):
            seen_through: NDArray[np.bool_] = self.height < -np.maximum(0.009, 3.5 * self.noise)
        return seen_through


def rectify(
    view: View,
    front: FrontPlane,
    relief: HeightMap,
    margin: float = 0.11,
    finest: float = 0.0025,
    most_cells: int = 250_000,
) -> RectifiedFront:
    """Return the front and ``margin`` metres around it, in cells about as large as a pixel, at least ``finest``
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


Side = Literal["left", "right", "bottom", "top"]
SIDES: tuple[Side, ...] = ("left", "right", "bottom", "top")


@dataclass(frozen=True)
class BorderSearch:
    """Finds the borders of the panel around a handle, by changes of colour and by openings.

    ``contrast``: minimum difference of colours across a border, summed over red, green and blue (0 to 255 each).
    ``span``: metres on either side of the handle in which borders are first searched. ``share``: minimum fraction of a
    border's length that shows it, first near the handle, then along the whole panel. ``before``: protrusions higher
    than this, metres, are ignored. ``clear``: metres around the handle that are excluded from the search.
    """

    contrast: float = 14.0
    span: Annotated[float, "m"] = 0.05
    share: tuple[float, float] = (0.7, 0.88)
    before: Annotated[float, "m"] = 0.006
    clear: Annotated[float, "m"] = 0.012

    def around(
        self,
        front: RectifiedFront,
        low: NDArray[np.float64],
        high: NDArray[np.float64],
        known: PanelBorders | None = None,
    ) -> PanelBorders:
        """Return the borders around a handle that covers the rectangle ``low`` to ``high``, (2,) metres.

        ``known``: not sought.
        """
        known = known or PanelBorders()
        evidence = self._evidence(front)
        found = known
        # First by what is beside the handle, then by the whole length of each border.
        middle = 0.5 * (low + high)
        start_low, start_high = np.minimum(low, middle - self.span), np.maximum(high, middle + self.span)
        for share in self.share:
            sought = known
            for side in SIDES:
                if getattr(known, side) is None:
                    across = _span(side, found, start_low, start_high)
                    sought = replace(sought, **{side: self._search(front, evidence, side, (low, high), across, share)})
            found = sought
        return found

    def seams(
        self, front: RectifiedFront, low: NDArray[np.float64], high: NDArray[np.float64], level: bool
    ) -> list[float]:
        """Return the y of horizontal (``level``) or the x of vertical seams across the rectangle ``low`` to ``high``,
        metres.
        """
        shown, telling = self._evidence(front)["lying" if level else "upright"]
        rows = slice(max(0, round(front.row_of(high[1]))), max(0, round(front.row_of(low[1])) + 1))
        columns = slice(max(0, round(front.column_of(low[0]))), max(0, round(front.column_of(high[0])) + 1))
        part, informative = shown[rows, columns], telling[rows, columns]
        if not level:
            part, informative = part.T, informative.T
        if not part.size:
            return []
        counts = informative.sum(axis=1)
        seen = (part & informative).sum(axis=1) >= self.share[1] * np.maximum(counts, 1)
        hits = np.flatnonzero(seen & (counts >= 0.5 * part.shape[1]))
        first = rows.start if level else columns.start
        groups = np.split(hits, np.flatnonzero(np.diff(hits) > 2) + 1) if len(hits) else []
        middles = [first + float(group.mean()) for group in groups]
        return [front.y_of(middle) if level else front.x_of(middle) for middle in middles]

    def _evidence(self, front: RectifiedFront) -> dict[str, tuple[NDArray[np.bool_], NDArray[np.bool_]]]:
        """Return, for upright and level borders, the cells that show one and the cells with evidence."""
        with np.errstate(invalid="ignore"):
            hidden = front.height > self.before
        hidden = cv2.dilate((hidden | front.outside).astype(np.uint8), np.ones((5, 5), np.uint8)) > 0
        result = {}
        for axis, name in ((1, "upright"), (0, "lying")):
            # A border between two cells is noted at the right or lower one, whatever shows it.
            differs = np.abs(np.diff(front.rgb, axis=axis)).sum(axis=2) > self.contrast
            differs |= np.diff(front.open, axis=axis)
            shown = front.open.copy()
            if axis == 1:
                shown[:, 1:] |= differs
            else:
                shown[1:] |= differs
            kernel = np.ones((5, 1) if axis == 1 else (1, 5), np.uint8)
            filled = cv2.dilate(shown.astype(np.uint8), kernel) > 0
            kernel = np.ones((1, 3) if axis == 1 else (3, 1), np.uint8)
            result[name] = (cv2.dilate((filled & ~hidden).astype(np.uint8), kernel) > 0, ~hidden)
        return result

    def _search(
        self,
        front: RectifiedFront,
        evidence: dict[str, tuple[NDArray[np.bool_], NDArray[np.bool_]]],
        side: Side,
        handle: tuple[NDArray[np.float64], NDArray[np.float64]],
        across: tuple[float, float],
        share: float,
    ) -> float | None:
        """Return the first line outwards of the handle that enough of shows a border."""
        upright = side in ("left", "right")
        shown, telling = evidence["upright" if upright else "lying"]
        if not upright:
            shown, telling = shown.T, telling.T
            ends = front.column_of(across[0]), front.column_of(across[1])
            start = (
                front.row_of(handle[1][1] + self.clear) if side == "top" else front.row_of(handle[0][1] - self.clear)
            )
        else:
            ends = front.row_of(across[1]), front.row_of(across[0])
            start = (
                front.column_of(handle[0][0] - self.clear)
                if side == "left"
                else front.column_of(handle[1][0] + self.clear)
            )
        first, last = max(0, round(ends[0])), min(shown.shape[0], round(ends[1]) + 1)
        if last - first < 3:
            return None
        telling_part = telling[first:last]
        counts = telling_part.sum(axis=0)
        shares = np.where(
            counts >= 0.3 * (last - first), (shown[first:last] & telling_part).sum(axis=0) / np.maximum(counts, 1), 0.0
        )
        step = -1 if side in ("left", "top") else 1
        begin = int(np.clip(round(start), 0, len(shares) - 1))
        line = shares[begin::-1] if step < 0 else shares[begin:]
        hits = np.flatnonzero(line >= share)
        if not len(hits):
            return None
        # The change of colour was widened by a cell.
        index = begin + step * (int(hits[0]) + 1)
        return front.x_of(index - 0.5) if upright else front.y_of(index - 0.5)


@dataclass(frozen=True)
class PanelBorders:
    """The borders of a panel, metres in the frame of its front; None where not observed."""

    left: float | None = None
    right: float | None = None
    bottom: float | None = None
    top: float | None = None

    @property
    def rectangle(self) -> tuple[float, float, float, float] | None:
        """Return left, right, bottom, top, metres, if all are known, else None."""
        if self.left is None or self.right is None or self.bottom is None or self.top is None:
            return None
        return self.left, self.right, self.bottom, self.top


def _span(side: Side, found: PanelBorders, low: NDArray[np.float64], high: NDArray[np.float64]) -> tuple[float, float]:
    """Return the part of a border to look at: between its neighbours, where these are known."""
    if side in ("left", "right"):
        first, last = found.bottom, found.top
        start, stop = float(low[1]), float(high[1])
    else:
        first, last = found.left, found.right
        start, stop = float(low[0]), float(high[0])
    start, stop = (start if first is None else first), (stop if last is None else last)
    inset = 0.06 * (stop - start)
    return start + inset, stop - inset
