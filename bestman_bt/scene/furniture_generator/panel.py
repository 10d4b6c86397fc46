"""The front of a door or a drawer with its handle, in the panel frame: origin in the middle of the front face, x to the
right and y up for who stands before it, z out of the front."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from bestman_bt.messages import Pose
from bestman_bt.scene.furniture_generator.finish import Finish
from bestman_bt.scene.furniture_generator.handle_design import (
    BORDER,
    CUP_BACK,
    HOOK_DEPTH,
    LIP_GRIP,
    HandleDesign,
    knob_head,
)
from bestman_bt.scene.furniture_generator.solid import Point, Solid, ball, block, rod

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
    """Where the handle of a panel is: panel_from_handle, with the measures of bestman_bt.messages.Handle."""

    pose: Pose
    radius: float
    length: float
    standoff: float


def furniture_from_panel(centre: Point) -> Pose:
    """Pose of a panel whose front face has its middle at ``centre`` in the furniture frame."""
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = _FRONT, centre
    return Pose.from_matrix(matrix)


def front_with_handle(
    panel: Panel, design: HandleDesign, finish: Finish, *, centred: bool
) -> tuple[list[Solid], PanelHandle]:
    """Solids of the front and its handle in the panel frame. ``centred``: the handle sits in the middle (drawers)."""
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
    """Where the middle of bar or knob comes to lie; its whole extent stays on the panel."""
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
    """A front whose free border is cut back: lip, cup behind it, and the cup's back plate.

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
