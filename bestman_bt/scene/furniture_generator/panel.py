"""The front of a door or drawer with its handle, in the panel frame.

Its origin is in the middle of the front face, x to the right and y up as seen from the front, z out of it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from bestman_bt.configuration.quantity import Color as ColorOption
from bestman_bt.configuration.quantity import PositiveLength
from bestman_bt.messages import Pose
from bestman_bt.scene.furniture_generator.handle_design import (
    BORDER,
    CUP_BACK,
    HOOK_DEPTH,
    LIP_GRIP,
    HandleDesign,
    knob_head,
)
from bestman_bt.scene.furniture_generator.solid import Color, Point, Solid, ball, block, rod
from bestman_bt.scene.scene import Articulation, FurnitureModel, Surface


def carcass(
    front: float, back: float, width: float, bottom: float, top: float, board: float, color: Color
) -> list[Solid]:
    """Return the boards of a box that is open to the front: x from ``front`` to ``back``, z from ``bottom`` to ``top``,
    metres."""
    half = width / 2
    return [
        block((front, -half, bottom), (back, -half + board, top), color),
        block((front, half - board, bottom), (back, half, top), color),
        block((back - board, -half + board, bottom), (back, half - board, top), color),
        block((front, -half + board, bottom), (back - board, half - board, bottom + board), color),
        block((front, -half + board, top - board), (back - board, half - board, top), color),
    ]


def given_or_drawn(options: Any, drawn: NDArray[np.float64], *names: str) -> Iterator[float]:
    """Return the named values of ``options``, or for those that are None the ``drawn`` ones."""
    for name, value in zip(names, drawn, strict=True):
        given = getattr(options, name)
        yield float(value if given is None else given)


def surface(name: str, x: tuple[float, float], y: tuple[float, float], z: float) -> Surface:
    """Return a horizontal rectangle at height ``z``."""
    return Surface(name, Pose.from_xyz_rpy(((x[0] + x[1]) / 2, (y[0] + y[1]) / 2, z)), (x[1] - x[0], y[1] - y[0]))


def model(
    name: str,
    footprint: tuple[float, float],
    solids: Sequence[Solid],
    surfaces: Sequence[Surface],
    articulations: Sequence[Articulation] = (),
) -> FurnitureModel:
    """Return the piece of furniture with these elements."""
    return FurnitureModel(
        name=name,
        footprint=footprint,
        parts=tuple(solid.placed for solid in solids),
        colors=tuple(solid.rgba for solid in solids),
        surfaces=tuple(surfaces),
        articulations=tuple(articulations),
    )


Style = Literal["white", "steel", "dark", "wood", "coloured"]

_STYLES: dict[Style, tuple[Color, Color]] = {  # of the front and of the body
    "white": ((0.93, 0.93, 0.91), (0.88, 0.88, 0.86)),
    "steel": ((0.72, 0.74, 0.77), (0.45, 0.46, 0.48)),
    "dark": ((0.13, 0.13, 0.15), (0.10, 0.10, 0.12)),
    "wood": ((0.70, 0.52, 0.34), (0.58, 0.42, 0.27)),
    "coloured": ((0.35, 0.50, 0.48), (0.86, 0.85, 0.80)),
}
_HANDLES: tuple[Color, ...] = (
    (0.60, 0.61, 0.63),  # brushed steel
    (0.12, 0.12, 0.12),  # black
    (0.72, 0.58, 0.30),  # brass
    (0.92, 0.92, 0.90),  # white
    (0.45, 0.31, 0.19),  # wood
)
_SAME_AS_FRONT = 0.3  # share of furniture whose handles have the colour of the front


@dataclass(frozen=True)
class FinishOptions:
    """Colours; missing ones are drawn. ``handle_like_front``: the handles have the colour of the front."""

    style: Style | None = None
    front: ColorOption | None = None
    body: ColorOption | None = None
    handle: ColorOption | None = None
    handle_like_front: bool | None = None


@dataclass(frozen=True)
class PieceOptions:
    """Options of all furniture; missing ones are drawn."""

    width: PositiveLength | None = None
    depth: PositiveLength | None = None
    height: PositiveLength | None = None
    finish: FinishOptions = field(default_factory=FinishOptions)


@dataclass(frozen=True)
class Finish:
    """The colours, rgb from 0 to 1."""

    front: Color
    body: Color
    handle: Color


def draw_finish(options: FinishOptions, rng: np.random.Generator, styles: tuple[Style, ...] = tuple(_STYLES)) -> Finish:
    """Draw the colours of one of ``styles``, with a random change of brightness."""
    drawn, shade, tint = styles[int(rng.integers(len(styles)))], rng.uniform(0.92, 1.07), rng.uniform(0.7, 1.3, 3)
    style = options.style or drawn
    if style != "coloured":
        tint = np.ones(3)
    front_color, body_color = _STYLES[style]
    front = options.front or _shaded(front_color, shade * tint)
    body = options.body or _shaded(body_color, np.full(3, shade))
    other = _HANDLES[int(rng.integers(len(_HANDLES)))]
    like_front = bool(rng.random() < _SAME_AS_FRONT)
    if options.handle_like_front is not None:
        like_front = options.handle_like_front
    return Finish(front, body, options.handle or (front if like_front else other))


def _shaded(color: Color, factor: np.ndarray) -> Color:
    red, green, blue = (float(value) for value in np.clip(np.array(color) * factor, 0.0, 1.0))
    return red, green, blue


# furniture_from_panel turns the panel's x, y, z to the furniture's -y, z, -x
_FRONT = np.array([[0.0, 0.0, -1.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
_UPWARDS = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])  # panel_from_handle of a vertical handle

FreeBorder = Literal["top", "bottom", "left", "right"]


@dataclass(frozen=True)
class Panel:
    """A front ``width`` × ``height``; ``free``: the border opposite to the hinge (of a drawer: the top one).

    ``closed_behind``: the cup behind a lip has a back plate; a drawer is open there.
    """

    width: float
    height: float
    thickness: float
    free: FreeBorder
    closed_behind: bool


@dataclass(frozen=True)
class PanelHandle:
    """The handle of a panel: panel_from_handle, with the measures of bestman_bt.messages.Handle."""

    pose: Pose
    radius: float
    length: float
    standoff: float


def furniture_from_panel(centre: Point) -> Pose:
    """Return furniture_from_panel for a panel whose front face is centred at ``centre`` (3,), metres."""
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = _FRONT, centre
    return Pose.from_matrix(matrix)


def front_with_handle(
    panel: Panel, design: HandleDesign, finish: Finish, *, centred: bool
) -> tuple[list[Solid], PanelHandle]:
    """Return the solids of the front and its handle in the panel frame. ``centred``: the handle sits in the middle
    (drawers)."""
    if design.kind == "edge":
        return _edge(panel, design, finish)
    slab = block(
        (-panel.width / 2, -panel.height / 2, -panel.thickness), (panel.width / 2, panel.height / 2, 0.0), finish.front
    )
    solids, handle = (_bar if design.kind == "bar" else _knob)(panel, design, finish, centred)
    return [slab, *solids], handle


def _bar(panel: Panel, design: HandleDesign, finish: Finish, centred: bool) -> tuple[list[Solid], PanelHandle]:
    vertical = design.direction == "vertical"
    length = design.fitting_length(panel.height if vertical else panel.width)
    extent = (0.0, length) if vertical else (length, 0.0)
    x, y = _middle(panel, design, extent, centred)
    along = "y" if vertical else "x"
    radius, standoff = design.radius, design.standoff
    solids = [rod((x, y, standoff), along, radius, length, finish.handle)]
    reach = length / 2 - max(0.012, radius)
    for side in (-reach, reach):
        foot = (x, y + side, standoff / 2) if vertical else (x + side, y, standoff / 2)
        solids.append(rod(foot, "z", 0.8 * radius, standoff, finish.handle))
    return solids, PanelHandle(_pose((x, y, standoff), vertical), radius, length, standoff)


def _knob(panel: Panel, design: HandleDesign, finish: Finish, centred: bool) -> tuple[list[Solid], PanelHandle]:
    radius, standoff = design.radius, design.standoff
    x, y = _middle(panel, design, (2 * radius, 2 * radius), centred)
    centre = (x, y, standoff)
    head = (
        ball(centre, radius, finish.handle)
        if design.shape == "ball"
        else rod(centre, "z", radius, knob_head("cylinder", radius), finish.handle)
    )
    stem = rod((x, y, standoff / 2), "z", max(0.005, 0.4 * radius), standoff, finish.handle)
    return [head, stem], PanelHandle(_pose(centre, False), radius, 2 * radius, standoff)


def _middle(panel: Panel, design: HandleDesign, extent: tuple[float, float], centred: bool) -> tuple[float, float]:
    """Return the position of the middle of bar or knob; its whole extent stays on the panel."""
    room = (panel.width / 2 - extent[0] / 2 - BORDER / 2, panel.height / 2 - extent[1] / 2 - BORDER / 2)
    if centred:
        return 0.0, 0.5 * max(0.0, design.height) * max(0.0, room[1])
    toward = {"top": (0, 1), "bottom": (0, -1), "left": (-1, 0), "right": (1, 0)}[panel.free]
    if toward[0]:
        bar_end = extent[0] / 2 if extent[0] > extent[1] else 0.0
        return toward[0] * (panel.width / 2 - design.inset - bar_end), 0.8 * design.height * max(0.0, room[1])
    bar_end = extent[1] / 2 if extent[1] > extent[0] else 0.0
    return 0.0, toward[1] * (panel.height / 2 - design.inset - bar_end)


def _edge(panel: Panel, design: HandleDesign, finish: Finish) -> tuple[list[Solid], PanelHandle]:
    """Return a front whose free border is cut back: lip, cup behind it, and the cup's back plate.

    Built in (u along the free border, v towards it, z), then turned.
    """
    sideways = panel.free in ("left", "right")
    across, toward = (panel.height, panel.width) if sideways else (panel.width, panel.height)
    sign = 1.0 if panel.free in ("top", "right") else -1.0
    length = design.fitting_length(across)
    edge, bottom = toward / 2 - design.groove, toward / 2 - design.groove - HOOK_DEPTH
    back = -panel.thickness

    def piece(u: tuple[float, float], v: tuple[float, float], z: tuple[float, float], color: Point) -> Solid:
        v = (v[0], v[1]) if sign > 0 else (-v[1], -v[0])
        x, y = (v, u) if sideways else (u, v)
        return block((x[0], y[0], z[0]), (x[1], y[1], z[1]), color)

    solids = [piece((-across / 2, across / 2), (-toward / 2, bottom), (back, 0.0), finish.front)]
    if across - length > 1e-6:
        solids.extend(
            piece(u, (bottom, toward / 2), (back, 0.0), finish.front)
            for u in ((-across / 2, -length / 2), (length / 2, across / 2))
        )
    solids.append(piece((-length / 2, length / 2), (bottom, edge), (-design.lip, 0.0), finish.front))
    if panel.closed_behind:
        solids.append(piece((-length / 2, length / 2), (bottom, toward / 2), (back, back + CUP_BACK), finish.body))
    v = sign * (edge - LIP_GRIP)
    centre = (v, 0.0, -design.lip / 2) if sideways else (0.0, v, -design.lip / 2)
    return solids, PanelHandle(_pose(centre, sideways), design.lip / 2, length, -design.lip / 2)


def _pose(centre: Point, vertical: bool) -> Pose:
    matrix = np.eye(4)
    matrix[:3, 3] = centre
    if vertical:
        matrix[:3, :3] = _UPWARDS
    return Pose.from_matrix(matrix)
