"""Does a view contradict that an object still stands where it was seen?"""

from __future__ import annotations

from enum import Enum

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import ObjectModel, Pose
from bestman_bt.perception.pose_estimation.model_surface import sample_shape
from bestman_bt.perception.view import View

SPACING = 0.008
"""Metres between the samples of an object's surface."""


class Presence(Enum):
    """``GONE``: the camera looked through its place. ``HIDDEN``: its place was not seen. ``POSSIBLE``: neither."""

    POSSIBLE = "possible"
    HIDDEN = "hidden"
    GONE = "gone"


def presence(
    model: ObjectModel, frame_from_object: Pose, view: View, margin: float = 0.02, share: float = 0.5
) -> Presence:
    """Compare the depth that the object would have with the measured one.

    ``margin``: metres by which depths may differ. ``share``: of the surface towards the camera that must be seen, and
    of the seen surface that must be looked through for the object to be gone.
    """
    points, normals = _surface(model, frame_from_object)
    facing = ((view.viewpoint - points) * normals).sum(axis=1) > 0.0
    pixels, depth = view.project(points[facing])
    measured = view.measured_depth(pixels)
    seen = np.isfinite(measured) & (measured > depth - margin)
    if len(depth) == 0 or seen.mean() < share:
        return Presence.HIDDEN
    through = measured[seen] > depth[seen] + margin
    return Presence.GONE if through.mean() > share else Presence.POSSIBLE


def _surface(model: ObjectModel, frame_from_object: Pose) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    samples = [(placed.pose, *sample_shape(placed.shape, SPACING)) for placed in model.visual or model.collision]
    points = np.concatenate([(frame_from_object @ pose).apply(points) for pose, points, _ in samples])
    normals = np.concatenate([normals @ (frame_from_object @ pose).rotation.T for pose, _, normals in samples])
    return points, normals
