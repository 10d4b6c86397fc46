"""A tidy left-to-right drawing of a tree.

Subtrees are packed by their contours, as in Reingold and Tilford, "Tidier Drawings of Trees" (1981), with the
root on the left and one column per depth: labels are wide and flat, so this is far more compact than top-down.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from bestman_bt.visualization.tree_description import TreeDescription

Point = tuple[float, float]


@dataclass(frozen=True)
class LayoutParameters:
    """Sizes in the units of the drawing (points at zoom 1)."""

    character_width: float = 6.2
    label_padding: float = 14.0
    row_height: float = 27.0
    column_gap: float = 34.0


@dataclass(frozen=True)
class TreeLayout:
    """``centers``: uid → (x, y) of the node's label, y downwards. ``size``: (width, height) from the origin."""

    centers: Mapping[int, Point]
    size: Point


def tidy_layout(
    tree: TreeDescription, labels: Mapping[int, str], parameters: LayoutParameters | None = None
) -> TreeLayout:
    """Place every node so that no two labels overlap, parents centred on their children; ``labels``: uid → text."""
    sizes = parameters or LayoutParameters()
    widths = {uid: sizes.character_width * len(text) + sizes.label_padding for uid, text in labels.items()}
    rows = _rows(tree)
    depths = _depths(tree)
    column_widths: dict[int, float] = {}
    for uid, depth in depths.items():
        column_widths[depth] = max(column_widths.get(depth, 0.0), widths[uid])
    lefts, left = {}, 0.0
    for depth in sorted(column_widths):
        lefts[depth] = left
        left += column_widths[depth] + sizes.column_gap
    top = min(rows.values())
    centers = {
        uid: (lefts[depths[uid]] + widths[uid] / 2, (rows[uid] - top + 0.5) * sizes.row_height) for uid in depths
    }
    height = (max(rows.values()) - top + 1.0) * sizes.row_height
    return TreeLayout(centers, (left - sizes.column_gap, height))


def _depths(tree: TreeDescription) -> dict[int, int]:
    depths: dict[int, int] = {}
    for node in tree.nodes:
        depths[node.uid] = 0 if node.parent is None else depths[node.parent] + 1
    return depths


@dataclass
class _Contour:
    """Lowest and highest row per depth below a node, relative to the node's own row."""

    low: list[float]
    high: list[float]


def _rows(tree: TreeDescription) -> dict[int, float]:
    contours: dict[int, _Contour] = {}
    offsets: dict[int, float] = {tree.root.uid: 0.0}
    for node in reversed(list(tree.depth_first())):
        children = [child.uid for child in tree.children(node.uid)]
        if not children:
            contours[node.uid] = _Contour([0.0], [0.0])
            continue
        merged = contours.pop(children[0])
        shifts = [0.0]
        for child in children[1:]:
            contour = contours.pop(child)
            shift = max(high - low for high, low in zip(merged.high, contour.low, strict=False)) + 1.0
            shifts.append(shift)
            for depth, (low, high) in enumerate(zip(contour.low, contour.high, strict=True)):
                if depth < len(merged.low):
                    merged.high[depth] = high + shift
                else:
                    merged.low.append(low + shift)
                    merged.high.append(high + shift)
        centre = (shifts[0] + shifts[-1]) / 2
        for child, shift in zip(children, shifts, strict=True):
            offsets[child] = shift - centre
        contours[node.uid] = _Contour(
            [0.0, *(low - centre for low in merged.low)], [0.0, *(high - centre for high in merged.high)]
        )
    rows: dict[int, float] = {}
    for node in tree.depth_first():
        rows[node.uid] = offsets[node.uid] + (0.0 if node.parent is None else rows[node.parent])
    return rows
