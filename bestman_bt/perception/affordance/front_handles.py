"""Handles on upright fronts in one depth image, without learned weights."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import Handle, Pose
from bestman_bt.perception.affordance.base import HandleDetector, HandleScene
from bestman_bt.perception.affordance.fronts import Front, FrontSearch
from bestman_bt.perception.affordance.grooves import GrooveSearch
from bestman_bt.perception.affordance.handle_on_front import HandleOnFront
from bestman_bt.perception.affordance.joint_suggestion import (
    JointRules,
)
from bestman_bt.perception.affordance.panel_borders import BorderSearch, PanelBorders
from bestman_bt.perception.affordance.protrusions import ProtrusionSearch
from bestman_bt.perception.affordance.rectified import RectifiedFront, rectify
from bestman_bt.perception.affordance.relief import relief
from bestman_bt.perception.affordance.shared_panels import parted
from bestman_bt.perception.errors import PerceptionError
from bestman_bt.perception.segmentation.base import SupportPlane
from bestman_bt.perception.view import View


@dataclass(frozen=True)
class FrontHandles(HandleDetector):
    """Fronts first; then what stands out of each (bars, knobs) and what is cut into it (recessed edges).

    The panel around a handle, and where on it the handle is, suggest how it opens.

    ``min_confidence``: of a handle that is reported. ``apart``: metres; nearer ones are the same handle.
    ``max_distance``: metres from the camera; farther away, noise makes handles. ``completed_std``: metres, of the
    position of a handle of which a part was hidden.
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
        """See HandleDetector; chance has no part in it."""
        if not (np.isfinite(view.image.depth) & (view.image.depth > 0)).any():
            raise PerceptionError("the image has no depth at all; metres are expected, 0 where unknown")
        fronts = self.fronts.find(view)
        if not fronts:
            return HandleScene((), (), "no upright plane in view")
        found: list[tuple[Front, RectifiedFront, HandleOnFront]] = []
        for front in fronts:
            around = relief(view, front, self.fronts)
            rectified = rectify(view, front, around)
            on_front = self.protrusions.find(around) + self.grooves.find(rectified, around, self.borders)
            found += [(front, rectified, one) for one in on_front if one.confidence >= self.min_confidence]
        # A part of a bar may look like a shorter one: the longest first.
        found.sort(key=lambda entry: -entry[2].confidence * entry[2].length)
        kept: list[tuple[Front, RectifiedFront, HandleOnFront]] = []
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
        self, front: Front, rectified: RectifiedFront, one: HandleOnFront, others: list[HandleOnFront]
    ) -> Handle:
        frame_from_front = front.frame_from_front
        turn = frame_from_front.rotation
        borders = parted(self.borders.around(rectified, *one.rectangle, one.borders), one, others)
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


def _distance(point: NDArray[np.float64], front: Front, handle: HandleOnFront) -> float:
    """From the line along a handle on ``front``."""
    frame_from_handle = front.frame_from_front @ Pose.from_xyz_rpy(handle.centre, (0.0, 0.0, handle.angle))
    along, across, out = frame_from_handle.inverse().apply(point[None])[0]
    return math.hypot(max(0.0, abs(along) - handle.length / 2), across, out)


def _panel(frame_from_front: Pose, borders: PanelBorders) -> tuple[Pose | None, tuple[float, float] | None]:
    if borders.rectangle is None:
        return None, None
    left, right, bottom, top = borders.rectangle
    middle = Pose(np.array([(left + right) / 2, (bottom + top) / 2, 0.0]))
    return frame_from_front @ middle, (right - left, top - bottom)


def _plane(front: Front) -> SupportPlane:
    size = front.high - front.low
    centre = Pose(np.array([*(front.low + front.high) / 2, 0.0]))
    return SupportPlane(front.frame_from_front @ centre, (float(size[0]), float(size[1])), front.inliers, front.rms)
