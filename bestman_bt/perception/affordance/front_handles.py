"""Handles on upright fronts in one depth image, without learned weights."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import Handle, Pose
from bestman_bt.messages.handle import HandleKind, HingeSide, JointKind
from bestman_bt.perception.affordance.fronts import FrontPlane, FrontSearch
from bestman_bt.perception.affordance.grooves import GrooveSearch
from bestman_bt.perception.affordance.protrusions import HandleOnFront, ProtrusionSearch
from bestman_bt.perception.affordance.rectified import BorderSearch, PanelBorders, RectifiedFront, Side, rectify, relief
from bestman_bt.perception.errors import PerceptionError
from bestman_bt.perception.segmentation.base import SupportPlane
from bestman_bt.perception.view import View

# How a panel is likely to open, by its form and by where its handle is.
# Furniture makers' rules: a drawer is pulled in its middle; a door is taken far from its hinge; a tall panel with a bar
# along its top folds down.


@dataclass(frozen=True)
class JointRules:
    """Suggests how a panel opens, from its shape and the position of its handle.

    ``centred``: a handle is centred if its offset is below this fraction of the panel's half width. ``drawer_height``:
    maximum height of drawers, metres. ``folding_place``: minimum offset of the handle of a folding panel, as a fraction
    of the half height; ``folding_slenderness``: maximum ratio of height to width of a folding panel.
    ``half_thickness``: half the thickness of doors, metres, by which their hinges are behind the front.
    ``hollow_half_thickness``: the same for doors with a recess.
    """

    centred: float = 0.2
    drawer_height: Annotated[float, "m"] = 0.55
    folding_place: float = 0.6
    folding_slenderness: float = 1.8
    half_thickness: Annotated[float, "m"] = 0.010
    hollow_half_thickness: Annotated[float, "m"] = 0.030

    def suggest(
        self,
        kind: HandleKind,
        upright: bool,
        centre: NDArray[np.float64],
        borders: PanelBorders,
        seen: tuple[NDArray[np.float64], NDArray[np.float64]],
    ) -> JointSuggestion:
        """Suggest the joint of the panel of a handle at ``centre`` (x, y, metres in the frame of its front).

        ``upright``: whether the axis of the handle is vertical. ``seen``: lowest and highest x and y of the visible
        front, used for borders that were not found.
        """
        low, high = seen
        left, right = _first(borders.left, low[0]), _first(borders.right, high[0])
        bottom, top = _first(borders.bottom, low[1]), _first(borders.top, high[1])
        width, height = right - left, top - bottom
        across, along = (2 * centre[0] - left - right) / width, (2 * centre[1] - bottom - top) / height
        sure = 0.9 if borders.rectangle is not None else 0.65
        if abs(across) >= self.centred:
            # Beside the middle: a door, hinged on the other side.
            return JointSuggestion("revolute", sure, "left" if across > 0 else "right")
        if upright and kind != "knob":
            return JointSuggestion("revolute", 0.6)
        if height > self.drawer_height:
            if abs(along) >= self.folding_place and height < self.folding_slenderness * width:
                return JointSuggestion("revolute", sure, "bottom" if along > 0 else "top")
            # A bar may take so much of a narrow door's width that it is hardly off its middle.
            return JointSuggestion("revolute", 0.55, "left" if across > 0 else "right")
        return JointSuggestion("prismatic", sure if height < 0.8 * self.drawer_height else 0.6)

    def hinge_line(
        self, side: HingeSide, kind: HandleKind, borders: PanelBorders
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None:
        """Return a point (3,) on the hinge's axis and its direction (3,), in the front's frame.

        None if its border is unknown.

        A positive rotation about the direction opens the door.
        """
        at = getattr(borders, side)
        if at is None:
            return None
        first, second = (borders.bottom, borders.top) if side in ("left", "right") else (borders.left, borders.right)
        middle = 0.0 if first is None or second is None else 0.5 * (first + second)
        behind = -self.hollow_half_thickness if kind == "edge" else -self.half_thickness
        if side in ("left", "right"):
            return np.array([at, middle, behind]), np.array([0.0, -1.0 if side == "left" else 1.0, 0.0])
        return np.array([middle, at, behind]), np.array([1.0 if side == "bottom" else -1.0, 0.0, 0.0])


@dataclass(frozen=True)
class JointSuggestion:
    """A suggested joint of a panel. ``confidence``: 0.5 (a guess) to 1. ``hinge_side``: as seen from the front, for a
    revolute joint.
    """

    joint: JointKind
    confidence: float
    hinge_side: HingeSide | None = None


def _first(border: float | None, otherwise: float) -> float:
    return float(otherwise) if border is None else border


@dataclass(frozen=True, eq=False)
class HandleScene:
    """The result of a handle search: ``handles``, most confident first, on ``fronts``: vertical planes, largest first.

    ``reason``: why no handle was found, as text; else empty.
    """

    handles: tuple[Handle, ...]
    fronts: tuple[SupportPlane, ...]
    reason: str = ""


class HandleDetector(ABC):
    """Finds handles on vertical furniture fronts."""

    @abstractmethod
    def detect(self, view: View, rng: np.random.Generator) -> HandleScene:
        """Return all handles in ``view``, in its frame (z up). Equal input and generator state give equal output.

        Raises PerceptionError for an unusable image: no depth at all, or wrong shapes.
        """


def clipped_at_handles(
    borders: PanelBorders, one: HandleOnFront, others: Iterable[HandleOnFront], beside: float = 0.15
) -> PanelBorders:
    """Return ``borders`` of the panel of ``one``, cut so that the panel does not reach ``others`` on the same front.

    A border found beyond another handle is set halfway to that handle, as in a chest of equal drawers. ``beside``:
    maximum offset, metres, of two handles in the same column or row.
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


@dataclass(frozen=True)
class FrontHandles(HandleDetector):
    """Finds fronts first, then protrusions (bars, knobs) and grooves (recessed edges) on each.

    The panel around a handle, and the handle's position on it, suggest how the panel opens.

    ``min_confidence``: of a reported handle. ``apart``: metres; closer detections count as one handle.
    ``max_distance``: metres from the camera; farther away, noise causes false handles. ``completed_std``: standard
    deviation of the position of a partly hidden handle, metres.
    """

    fronts: FrontSearch = field(default_factory=FrontSearch)
    protrusions: ProtrusionSearch = field(default_factory=ProtrusionSearch)
    grooves: GrooveSearch = field(default_factory=GrooveSearch)
    borders: BorderSearch = field(default_factory=BorderSearch)
    joint: JointRules = field(default_factory=JointRules)
    min_confidence: float = 0.4
    apart: Annotated[float, "m"] = 0.03
    max_distance: Annotated[float, "m"] = 2.05
    completed_std: Annotated[float, "m"] = 0.015

    def detect(self, view: View, rng: np.random.Generator) -> HandleScene:
        """Return the handles in ``view``; the result does not depend on ``rng``."""
        if not (np.isfinite(view.image.depth) & (view.image.depth > 0)).any():
            raise PerceptionError("the image has no depth at all; metres are expected, 0 where unknown")
        fronts = self.fronts.find(view)
        if not fronts:
            return HandleScene((), (), "no upright plane in view")
        found: list[tuple[FrontPlane, RectifiedFront, HandleOnFront]] = []
        for front in fronts:
            around = relief(view, front, self.fronts)
            rectified = rectify(view, front, around)
            on_front = self.protrusions.find(around) + self.grooves.find(rectified, around, self.borders)
            found += [(front, rectified, one) for one in on_front if one.confidence >= self.min_confidence]
        # A part of a bar may look like a shorter one: the longest first.
        found.sort(key=lambda entry: -entry[2].confidence * entry[2].length)
        kept: list[tuple[FrontPlane, RectifiedFront, HandleOnFront]] = []
        for front, rectified, one in found:
            position = front.frame_from_front.apply(one.centre[None])[0]
            near = np.linalg.norm(position - view.viewpoint) <= self.max_distance
            if near and all(_distance(position, on, other) > self.apart for on, _, other in kept):
                kept.append((front, rectified, one))
        handles = []
        for front, rectified, one in kept:
            others = [other for on, _, other in kept if on is front and other is not one]
            handles.append(self._handle(front, rectified, one, others))
        handles.sort(key=lambda handle: -handle.confidence)
        reason = "" if handles else f"no handle on the {len(fronts)} upright planes in view"
        return HandleScene(tuple(handles), tuple(_plane(front) for front in fronts), reason)

    def _handle(
        self, front: FrontPlane, rectified: RectifiedFront, one: HandleOnFront, others: list[HandleOnFront]
    ) -> Handle:
        frame_from_front = front.frame_from_front
        turn = frame_from_front.rotation
        borders = clipped_at_handles(self.borders.around(rectified, *one.rectangle, one.borders), one, others)
        one = one.completed(borders, self.completed_std)
        suggested = self.joint.suggest(one.kind, one.upright, one.centre, borders, (front.low, front.high))
        line = None if suggested.hinge_side is None else self.joint.hinge_line(suggested.hinge_side, one.kind, borders)
        opening = np.array([0.0, 0.0, 1.0])
        if line is not None:
            opening = np.cross(line[1], one.centre - line[0])
            opening /= np.linalg.norm(opening)
        panel, size = _panel(frame_from_front, borders)
        return Handle(
            kind=one.kind,
            pose=frame_from_front @ Pose.from_xyz_rpy(one.centre, (0.0, 0.0, one.angle)),
            radius=one.radius,
            length=one.length,
            standoff=float(one.centre[2]),
            opening_direction=turn @ opening,
            confidence=one.confidence,
            position_std=one.position_std,
            joint=suggested.joint,
            joint_confidence=suggested.confidence,
            hinge_side=suggested.hinge_side,
            hinge=None if line is None else frame_from_front.apply(line[0][None])[0],
            hinge_direction=None if line is None else turn @ line[1],
            panel=panel,
            panel_size=size,
        )


def _distance(point: NDArray[np.float64], front: FrontPlane, handle: HandleOnFront) -> float:
    """Return the distance from the line along a handle on ``front``, metres."""
    frame_from_handle = front.frame_from_front @ Pose.from_xyz_rpy(handle.centre, (0.0, 0.0, handle.angle))
    along, across, out = frame_from_handle.inverse().apply(point[None])[0]
    return math.hypot(max(0.0, abs(along) - handle.length / 2), across, out)


def _panel(frame_from_front: Pose, borders: PanelBorders) -> tuple[Pose | None, tuple[float, float] | None]:
    if borders.rectangle is None:
        return None, None
    left, right, bottom, top = borders.rectangle
    middle = Pose(np.array([(left + right) / 2, (bottom + top) / 2, 0.0]))
    return frame_from_front @ middle, (right - left, top - bottom)


def _plane(front: FrontPlane) -> SupportPlane:
    size = front.high - front.low
    centre = Pose(np.array([*(front.low + front.high) / 2, 0.0]))
    return SupportPlane(front.frame_from_front @ centre, (float(size[0]), float(size[1])), front.inliers, front.rms)
