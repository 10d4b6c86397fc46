"""Borders between handles: two handles are on two panels, even where the seam between these is too narrow to see."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from bestman_bt.perception.affordance.handle_on_front import HandleOnFront
from bestman_bt.perception.affordance.panel_borders import PanelBorders, Side


def parted(
    borders: PanelBorders, one: HandleOnFront, others: Iterable[HandleOnFront], beside: float = 0.15
) -> PanelBorders:
    """``borders`` of the panel of ``one``, which does not reach to ``others`` on the same front.

    A border that was sought beyond another handle is taken to be halfway to that, as in a chest of equal drawers.
    ``beside``: metres by which two handles may be off a column or a row and still be in it.
    """
    for other in sorted(others, key=lambda other: float(np.linalg.norm(other.centre - one.centre))):
        across, along = (float(value) for value in other.centre[:2] - one.centre[:2])
        side: Side
        if abs(across) < beside and abs(along) > abs(across):
            side, place, apart = ("top" if along > 0 else "bottom"), float(one.centre[1]), along
        elif abs(along) < beside and abs(across) > abs(along):
            side, place, apart = ("right" if across > 0 else "left"), float(one.centre[0]), across
        else:
            continue
        known: float | None = getattr(borders, side)
        if known is None or abs(known - place) > abs(apart):
            borders = replace(borders, **{side: place + apart / 2})
    return borders
