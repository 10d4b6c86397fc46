"""Handles on upright fronts in one depth image, without learned weights."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from bestman_bt.messages import Handle, Pose
from bestman_bt.perception.affordance.base import HandleDetector, HandleScene
from bestman_bt.perception.affordance.fronts import Front, FrontsParameters, find_fronts
from bestman_bt.perception.affordance.grooves import Groove, GroovesParameters, find_grooves
from bestman_bt.perception.affordance.protrusions import Protrusion, ProtrusionsParameters, find_protrusions
from bestman_bt.perception.affordance.rectified import rectify
from bestman_bt.perception.affordance.relief import relief
from bestman_bt.perception.errors import PerceptionError
from bestman_bt.perception.segmentation.base import SupportPlane
from bestman_bt.perception.view import View


@dataclass(frozen=True)
class FrontHandlesParameters:
    """The parameters of each step; ``min_confidence``: of a handle that is reported."""

    fronts: FrontsParameters = field(default_factory=FrontsParameters)
    protrusions: ProtrusionsParameters = field(default_factory=ProtrusionsParameters)
    grooves: GroovesParameters = field(default_factory=GroovesParameters)
    min_confidence: float = 0.4


class FrontHandles(HandleDetector):
    """Fronts first; then what stands out of each, and what is cut into it."""

    def __init__(self, parameters: FrontHandlesParameters | None = None) -> None:
        self.parameters = parameters or FrontHandlesParameters()

    def detect(self, view: View, rng: np.random.Generator) -> HandleScene:
        """See HandleDetector; chance has no part in it."""
        p = self.parameters
        if not (np.isfinite(view.image.depth) & (view.image.depth > 0)).any():
            raise PerceptionError("the image has no depth at all; metres are expected, 0 where unknown")
        fronts = find_fronts(view, p.fronts)
        planes = tuple(_plane(front) for front in fronts)
        if not fronts:
            return HandleScene((), (), "no upright plane in view")
        found: list[Handle] = []
        for front in fronts:
            around = relief(view, front, p.fronts)
            found += [_protruding(front, one) for one in find_protrusions(around, p.protrusions)]
            found += [_recessed(front, one, p.grooves) for one in find_grooves(rectify(view, front, around), around, p.grooves)]
        found.sort(key=lambda handle: -handle.confidence)
        handles: list[Handle] = []
        for handle in found:
            if handle.confidence >= p.min_confidence and all(
                np.linalg.norm(handle.pose.position - other.pose.position) > 0.03 for other in handles
            ):
                handles.append(handle)
        reason = "" if handles else f"no handle on the {len(fronts)} upright planes in view"
        return HandleScene(tuple(handles), planes, reason)


def _protruding(front: Front, one: Protrusion) -> Handle:
    pose = front.frame_from_front @ Pose.from_xyz_rpy(one.centre, (0.0, 0.0, one.angle))
    return Handle(
        one.kind,
        pose,
        one.radius,
        one.length,
        float(one.centre[2]),
        front.frame_from_front.rotation[:, 2],
        one.confidence,
        one.position_std,
    )


def _recessed(front: Front, groove: Groove, p: GroovesParameters) -> Handle:
    x, y = groove.centre
    grip = groove.inward * p.grip
    middle = (x + grip, y, -p.lip / 2) if groove.upright else (x, y + grip, -p.lip / 2)
    pose = front.frame_from_front @ Pose.from_xyz_rpy(middle, (0.0, 0.0, np.pi / 2 if groove.upright else 0.0))
    out = front.frame_from_front.rotation[:, 2]
    return Handle("edge", pose, p.lip / 2, groove.length, -p.lip / 2, out, groove.confidence, 0.005)


def _plane(front: Front) -> SupportPlane:
    size = front.high - front.low
    centre = Pose(np.array([*(front.low + front.high) / 2, 0.0]))
    return SupportPlane(front.frame_from_front @ centre, (float(size[0]), float(size[1])), front.inliers, front.rms)
