"""Which pieces of a depth image are one thing: what stands on a surface stands beside other things, not over them.

Three reasons join two pieces. Seen from above one lies over the other: the head and the body of a duck. One is the
hollow inside of what stands before it: the far wall of a cup. One does not reach down to the surface though nothing
hides its lower end: a handle, so it hangs on its neighbour.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from bestman_bt.perception.segmentation.horizontal_plane import footprint, overlaps


@dataclass(frozen=True)
class FragmentMerging:
    """Rules for merging smooth fragments into objects. Lengths in metres.

    ``merge_overlap``: minimum overlap of two footprints of one object, as a fraction of the smaller one.
    ``hollow_depth``: minimum depth of the middle of a hollow below its sides; ``rim_tolerance``: maximum height
    difference between its rim and the wall in front of it. ``foot_height``: a fragment whose lowest points are higher
    does not stand on the surface; ``hidden_share``: fraction of its lower border above which its foot counts as hidden.
    ``contact_distance``: maximum distance of points of touching fragments with adjacent pixels.
    """

    merge_overlap: float = 0.30
    hollow_depth: Annotated[float, "m"] = 0.005
    rim_tolerance: Annotated[float, "m"] = 0.015
    foot_height: Annotated[float, "m"] = 0.025
    hidden_share: float = 0.35
    contact_distance: Annotated[float, "m"] = 0.020


@dataclass(frozen=True, eq=False)
class _Fragment:
    """``local``: (N, 3) points, metres, z above the surface. ``outline``: see footprint."""

    local: NDArray[np.float64]
    rows: NDArray[np.intp]
    columns: NDArray[np.intp]
    outline: NDArray[np.float32]

    @property
    def top(self) -> float:
        return float(np.percentile(self.local[:, 2], 98.0))


def merge_fragments(
    labels: NDArray[np.int32],
    local: NDArray[np.float64],
    depth: NDArray[np.float32],
    eye: NDArray[np.float64],
    p: FragmentMerging,
) -> NDArray[np.int32]:
    """Return the labels (h, w) of objects, from 1, for the ``labels`` of fragments.

    ``local``: (h, w, 3) points with z above the surface, metres, NaN unknown; ``depth``: (h, w) metres along the
    optical axis, 0 unknown; ``eye``: (3,) the camera in the frame of ``local``.
    """
    count = int(labels.max())
    if count < 2:
        return labels
    fragments = _fragments(labels, local, count)
    links = overlaps([fragment.outline for fragment in fragments]) >= p.merge_overlap
    touching, hides = _borders(labels, depth, local, p, count)
    for i, fragment in enumerate(fragments):
        behind = _hollow_inside(i, fragments, hides, eye, p)
        if behind is not None:
            links[i, behind] = True
        elif _floats(i, fragment, labels, depth, p) and touching[i].any():
            links[i, int(np.argmax(touching[i]))] = True
    _, group = connected_components(coo_matrix(links), directed=False)
    numbers = np.concatenate([[0], group + 1]).astype(np.int32)
    merged: NDArray[np.int32] = numbers[labels]
    return merged


def _fragments(labels: NDArray[np.int32], local: NDArray[np.float64], count: int) -> list[_Fragment]:
    rows, columns = np.nonzero(labels)
    order = np.argsort(labels[rows, columns], kind="stable")
    rows, columns = rows[order], columns[order]
    ends = np.cumsum(np.bincount(labels[rows, columns], minlength=count + 1)[1:])
    fragments = []
    for r, c in zip(np.split(rows, ends[:-1]), np.split(columns, ends[:-1]), strict=True):
        points = local[r, c]
        fragments.append(_Fragment(points, r, c, footprint(points[:, :2])))
    return fragments


def _borders(
    labels: NDArray[np.int32],
    depth: NDArray[np.float32],
    local: NDArray[np.float64],
    p: FragmentMerging,
    count: int,
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """(n, n) numbers of pixel pairs, up to four pixels apart: that touch; and in which row i is hidden by column j."""
    touching = np.zeros((count + 1, count + 1), dtype=np.int64)
    hides = np.zeros((count + 1, count + 1), dtype=np.int64)
    for axis in (0, 1):
        for gap in (1, 4):
            first = (slice(None, -gap), slice(None)) if axis == 0 else (slice(None), slice(None, -gap))
            second = (slice(gap, None), slice(None)) if axis == 0 else (slice(None), slice(gap, None))
            a, b = labels[first], labels[second]
            where = np.nonzero((a != b) & (a > 0) & (b > 0))
            if len(where[0]) == 0:
                continue
            a, b = a[where], b[where]
            near = np.linalg.norm(local[first][where] - local[second][where], axis=1) <= p.contact_distance
            np.add.at(touching, (a[near], b[near]), 1)
            np.add.at(touching, (b[near], a[near]), 1)
            step = depth[first][where] - depth[second][where]
            np.add.at(hides, (a[step > 0], b[step > 0]), 1)
            np.add.at(hides, (b[step < 0], a[step < 0]), 1)
    return touching[1:, 1:], hides[1:, 1:]


def _hollow_inside(
    i: int,
    fragments: list[_Fragment],
    hides: NDArray[np.int64],
    eye: NDArray[np.float64],
    p: FragmentMerging,
) -> int | None:
    """Return the piece of whose inside ``i`` is the far wall: it stands before it and its rim is as high."""
    if not hides[i].any():
        return None
    inner = fragments[i]
    before = int(np.argmax(hides[i]))
    outer = fragments[before]
    if abs(inner.top - outer.top) > p.rim_tolerance:
        return None
    wall = inner.local[inner.local[:, 2] < inner.top - 0.008]
    if len(wall) < max(12, 0.4 * len(inner.local)):
        return None
    away = inner.local[:, :2].mean(axis=0) - eye[:2]
    away /= max(float(np.linalg.norm(away)), 1e-9)
    along, across = wall[:, :2] @ away, wall[:, :2] @ np.array([-away[1], away[0]])
    half = float(np.percentile(across, 95) - np.percentile(across, 5)) / 2
    if half < 0.004:
        return None
    t = (across - across.mean()) / half
    bend = float(np.polynomial.polynomial.polyfit(t, along, 2)[2])
    return before if -bend > p.hollow_depth else None


def _floats(
    i: int,
    fragment: _Fragment,
    labels: NDArray[np.int32],
    depth: NDArray[np.float32],
    p: FragmentMerging,
) -> bool:
    """Return whether the lower end of piece ``i`` is in view and above the surface."""
    if float(np.percentile(fragment.local[:, 2], 3.0)) <= p.foot_height:
        return False
    lowest = np.full(labels.shape[1], -1)
    np.maximum.at(lowest, fragment.columns, fragment.rows)
    columns = np.flatnonzero(lowest >= 0)
    rows = lowest[columns]
    below = cv2.erode(np.where(depth > 0, depth, np.float32(100.0)), np.ones((3, 3), dtype=np.uint8))
    looked = np.minimum(rows + 4, labels.shape[0] - 1)
    hidden = (below[looked, columns] < depth[rows, columns] - 0.01) | (rows + 4 >= labels.shape[0])
    return bool(hidden.mean() < p.hidden_share)
