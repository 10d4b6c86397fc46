"""Handles on upright fronts in one depth image, without learned weights."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from bestman_bt.messages import Handle, Pose
from bestman_bt.perception.affordance.base import HandleDetector, HandleScene
from bestman_bt.perception.affordance.fronts import Front, FrontsParameters, find_fronts
from bestman_bt.perception.affordance.protrusions import Protrusion, ProtrusionsParameters, find_protrusions
from bestman_bt.perception.affordance.relief import relief
from bestman_bt.perception.errors import PerceptionError
from bestman_bt.perception.segmentation.base import SupportPlane
from bestman_bt.perception.view import View


@dataclass(frozen=True)
class FrontHandlesParameters:
    """The parameters of each step; ``min_confidence``: of a handle that is reported."""

    fronts: FrontsParameters = field(default_factory=FrontsParameters)
    protrusions: ProtrusionsParameters = field(default_factory=ProtrusionsParameters)
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
        found: list[tuple[Front, Protrusion]] = []
        for front in fronts:
            found += [(front, one) for one in find_protrusions(relief(view, front, p.fronts), p.protrusions)]
        found.sort(key=lambda pair: -pair[1].confidence)
        handles: list[Handle] = []
        for front, one in found:
            handle = _handle(front, one)
            if one.confidence >= p.min_confidence and all(
                np.linalg.norm(handle.pose.position - other.pose.position) > 0.03 for other in handles
            ):
                handles.append(handle)
        reason = "" if handles else f"no handle on the {len(fronts)} upright planes in view"
        return HandleScene(tuple(handles), planes, reason)


def _handle(front: Front, one: Protrusion) -> Handle:
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


def _plane(front: Front) -> SupportPlane:
    size = front.high - front.low
    centre = Pose(np.array([*(front.low + front.high) / 2, 0.0]))
    return SupportPlane(front.frame_from_front @ centre, (float(size[0]), float(size[1])), front.inliers, front.rms)
