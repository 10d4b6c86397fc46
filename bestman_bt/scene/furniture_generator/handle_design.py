"""The common handle of all fronts of a piece of furniture: kind and measures."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Literal, TypeVar

import numpy as np

from bestman_bt.configuration.quantity import PositiveLength
from bestman_bt.messages.handle import HandleKind
from bestman_bt.scene.furniture_generator.option_error import FurnitureOptionError

Direction = Literal["horizontal", "vertical"]
KnobShape = Literal["cylinder", "ball"]
Choice = TypeVar("Choice")

BORDER = 0.025  # metres of a front that a bar keeps free at either end
HOOK_DEPTH = 0.030  # metres that fingers reach behind a lip
LIP_GRIP = 0.010  # metres from the edge of a lip to the middle of what fingers hold
CUP_BACK = 0.006  # thickness of the plate that closes the cup behind a lip, metres
FINGER_ROOM = 0.018  # metres between bar and front

_SHAPES: dict[KnobShape, float] = {"cylinder": 0.5, "ball": 0.5}
_OPTIONS_OF: dict[HandleKind, tuple[str, ...]] = {
    "bar": ("direction", "radius", "length", "standoff", "inset"),
    "knob": ("shape", "radius", "standoff", "inset"),
    "edge": ("length", "groove", "lip"),
}


@dataclass(frozen=True)
class HandleOptions:
    """Options of a handle; missing ones are drawn.

    ``bar``: a straight rod of ``radius`` and ``length`` on two posts, its axis ``standoff`` in front of the panel.
    ``knob``: a cylinder or sphere of ``radius`` on a stem, its middle ``standoff`` in front of the panel. ``edge``: no
    protruding part; ``groove`` metres are cut into the panel's border over ``length``, down to a lip of thickness
    ``lip`` with room for fingers behind it. ``inset``: metres from the panel's free border to the middle of bar or knob
    (doors only).
    """

    kind: HandleKind | None = None
    direction: Direction | None = None
    shape: KnobShape | None = None
    radius: PositiveLength | None = None
    length: PositiveLength | None = None
    standoff: PositiveLength | None = None
    inset: PositiveLength | None = None
    groove: PositiveLength | None = None
    lip: PositiveLength | None = None


@dataclass(frozen=True)
class HandleDesign:
    """A HandleOptions with all values determined; metres.

    ``length_given``: the length is fixed; a drawn length adapts to a small front. ``whole_border``: the groove of an
    edge covers the whole border. ``cup``: room behind a lip. ``height``: position of bar or knob on its front, -1 to 1
    of the free range.
    """

    kind: HandleKind
    direction: Direction
    shape: KnobShape
    radius: float
    length: float
    length_given: bool
    whole_border: bool
    standoff: float
    inset: float
    groove: float
    lip: float
    cup: float
    height: float

    def door_thickness(self, plain: float) -> float:
        """Return the thickness of a door, metres: ``plain``, or more if a cup behind the lip needs it."""
        return self.lip + self.cup + CUP_BACK if self.kind == "edge" else plain

    def fitting_length(self, room: float) -> float:
        """Return the length for a front with ``room`` metres along the handle.

        Raises FurnitureOptionError if a given length is too long.
        """
        free = room if self.kind == "edge" else room - 2 * BORDER
        if self.length_given and self.length > free:
            message = f"should be at most {free:.3f} m on a front with room for {room:.3f} m, got {self.length:g} m"
            raise FurnitureOptionError(("handle", "length"), message)
        return free if self.whole_border else min(self.length, free)


def draw_handle(
    options: HandleOptions,
    rng: np.random.Generator,
    weights: dict[HandleKind, float],
    *,
    largest_length: float = 0.40,
    directions: dict[Direction, float],
) -> HandleDesign:
    """Return a design; ``weights``, ``directions``: relative frequencies."""
    # All is drawn, whatever is given: so to fix one option changes no other.
    kind, direction, shape = _chosen(weights, rng), _chosen(directions, rng), _chosen(_SHAPES, rng)
    kind, direction, shape = options.kind or kind, options.direction or direction, options.shape or shape
    bar_radius, knob_radius, lip = rng.uniform(0.004, 0.010), rng.uniform(0.010, 0.020), rng.uniform(0.014, 0.020)
    bar_length, groove_length = rng.uniform(0.08, largest_length), rng.uniform(0.12, 0.30)
    bar_standoff, stem = rng.uniform(0.025, 0.055), rng.uniform(0.010, 0.018)
    inset, groove, cup = rng.uniform(0.030, 0.060), rng.uniform(0.035, 0.050), rng.uniform(0.032, 0.042)
    whole_border, height = bool(rng.random() < 0.4), rng.uniform(-1.0, 1.0)
    if unfit := [field.name for field in fields(options) if _unfit(options, field.name, kind)]:
        message = f"a handle of kind {kind} has {', '.join(_OPTIONS_OF[kind])}, not {unfit[0]}"
        raise FurnitureOptionError(("handle", unfit[0]), message)
    radius = options.radius or (bar_radius if kind == "bar" else knob_radius)
    if kind == "bar":
        standoff = options.standoff or max(bar_standoff, radius + FINGER_ROOM)
        inset = max(inset, radius + 0.01)
    else:
        standoff = options.standoff or stem + knob_head(shape, radius) / 2
    if kind != "edge" and standoff < (radius if kind == "bar" else knob_head(shape, radius) / 2):
        message = f"should be more than what the handle itself takes (radius {radius:g} m), got {standoff:g} m"
        raise FurnitureOptionError(("handle", "standoff"), message)
    return HandleDesign(
        kind=kind,
        direction=direction,
        shape=shape,
        radius=float(radius),
        length=float(options.length or (groove_length if kind == "edge" else bar_length)),
        length_given=options.length is not None,
        whole_border=kind == "edge" and whole_border and options.length is None,
        standoff=float(standoff),
        inset=float(options.inset or inset),
        groove=float(options.groove or groove),
        lip=float(options.lip or lip),
        cup=float(cup),
        height=float(height),
    )


def knob_head(shape: KnobShape, radius: float) -> float:
    """Return the extent of a knob's head along the front's normal, metres."""
    return 2 * radius if shape == "ball" else 1.2 * radius


def _unfit(options: HandleOptions, name: str, kind: HandleKind) -> bool:
    return name != "kind" and getattr(options, name) is not None and name not in _OPTIONS_OF[kind]


def _chosen(weights: dict[Choice, float], rng: np.random.Generator) -> Choice:
    shares = np.array(list(weights.values()))
    return list(weights)[int(rng.choice(len(shares), p=shares / shares.sum()))]
