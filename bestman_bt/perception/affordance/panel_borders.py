"""The borders of the panel that a handle is on: seams, changes of colour, ends of the front."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from bestman_bt.perception.affordance.rectified import RectifiedFront

Side = Literal["left", "right", "bottom", "top"]
SIDES: tuple[Side, ...] = ("left", "right", "bottom", "top")


@dataclass(frozen=True)
class BorderSearch:
    """Finds the borders of the panel around a handle, by changes of colour and by openings.

    ``contrast``: minimum difference of colours across a border, summed over red, green and blue (0 to 255 each).
    ``span``: metres on either side of the handle in which borders are first searched. ``share``: minimum fraction of a
    border's length that shows it, first near the handle, then along the whole panel. ``before``: protrusions higher
    than this, metres, are ignored. ``clear``: metres around the handle that are left out of the search.
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
        part, told = shown[rows, columns], telling[rows, columns]
        if not level:
            part, told = part.T, told.T
        if not part.size:
            return []
        counts = told.sum(axis=1)
        seen = (part & told).sum(axis=1) >= self.share[1] * np.maximum(counts, 1)
        hits = np.flatnonzero(seen & (counts >= 0.5 * part.shape[1]))
        first = rows.start if level else columns.start
        groups = np.split(hits, np.flatnonzero(np.diff(hits) > 2) + 1) if len(hits) else []
        middles = [first + float(group.mean()) for group in groups]
        return [front.y_of(middle) if level else front.x_of(middle) for middle in middles]

    def _evidence(self, front: RectifiedFront) -> dict[str, tuple[NDArray[np.bool_], NDArray[np.bool_]]]:
        """For upright and lying borders: the cells that show one, and those that tell anything."""
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
        """left, right, bottom, top, where all are known."""
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
