"""View planning: camera poses ranked by the expected information about an object."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from typing_extensions import override

from bestman_bt.messages import CameraIntrinsics, PlacedShape, Pose, YawSet
from bestman_bt.messages.shapes import bounding_corners
from bestman_bt.perception.pose_estimation.base import PoseHypothesis
from bestman_bt.perception.pose_estimation.point_to_plane import YawObservability, evenly, model_yaw_observability
from bestman_bt.perception.pose_estimation.yaw_profile import YawSearch

FACING = 0.15
"""Smallest cosine between normal and line of sight: at flatter angles there is no depth."""


def unobstructed(
    points: NDArray[np.float64],
    normals: NDArray[np.float64],
    eyes: NDArray[np.float64],
    cell: float,
    thickness: float = 0.010,
) -> NDArray[np.bool_]:
    """Return which samples (C, S) of one body each of the eyes (C, 3) sees: they face it and no other sample is in
    front.

    ``points``, ``normals``: (S, 3), metres. ``cell``: cell width of the depth buffer at the body's distance, metres:
    slightly more than the sample spacing. ``thickness``: minimum depth difference of a hiding sample, metres.
    """
    # Products of matrices throughout: (C, 3) by (3, S).
    squares = (eyes**2).sum(axis=1)[:, None] - 2.0 * eyes @ points.T + (points**2).sum(axis=1)
    towards_eye = eyes @ normals.T - (points * normals).sum(axis=1)
    facing = towards_eye > FACING * np.sqrt(np.maximum(0.0, squares))
    middle = points.mean(axis=0)
    ahead = middle - eyes
    ahead /= np.linalg.norm(ahead, axis=1, keepdims=True)
    side = np.cross(ahead, np.where(np.abs(ahead[:, 2:]) < 0.9, [[0.0, 0.0, 1.0]], [[1.0, 0.0, 0.0]]))
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    up = np.cross(side, ahead)
    depth = _along(ahead, points, eyes)
    scale = np.linalg.norm(middle - eyes, axis=1)[:, None] / np.maximum(depth, 1e-3) / cell
    u = np.floor(_along(side, points, eyes) * scale).astype(np.intp)
    v = np.floor(_along(up, points, eyes) * scale).astype(np.intp)
    u -= u.min()
    v -= v.min()
    width, height = int(u.max()) + 1, int(v.max()) + 1
    cells = (np.arange(len(eyes))[:, None] * height + v) * width + u
    nearest = np.full(len(eyes) * height * width, np.inf)
    np.minimum.at(nearest, cells.ravel(), depth.ravel())
    visible: NDArray[np.bool_] = facing & (depth < nearest[cells] + thickness) & (depth > 1e-3)
    return visible


def _along(
    directions: NDArray[np.float64], points: NDArray[np.float64], eyes: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return (C, S) the distance of each point from each eye along its direction (C, 3)."""
    along: NDArray[np.float64] = directions @ points.T - (directions * eyes).sum(axis=1, keepdims=True)
    return along


def hidden_by_shapes(
    points: NDArray[np.float64], eyes: NDArray[np.float64], shapes: Sequence[PlacedShape]
) -> NDArray[np.bool_]:
    """Return which points (S, 3) the boxes around ``shapes`` hide from each of the eyes (C, 3): (C, S); all in one
    frame.

    By slabs: Kay and Kajiya, "Ray Tracing Complex Scenes", 1986.
    """
    hidden = np.zeros((len(eyes), len(points)), dtype=bool)
    for placed in shapes:
        corners = bounding_corners(placed.shape)
        lower, upper = corners.min(axis=0), corners.max(axis=0)
        shape_from_frame = placed.pose.inverse()
        starts, ends = shape_from_frame.apply(eyes), shape_from_frame.apply(points)
        enters, leaves = np.full(hidden.shape, -np.inf), np.full(hidden.shape, np.inf)
        for axis in range(3):
            along = ends[None, :, axis] - starts[:, None, axis]
            along = np.where(np.abs(along) < 1e-9, 1e-9, along)
            one, other = ((side[axis] - starts[:, None, axis]) / along for side in (lower, upper))
            enters = np.maximum(enters, np.minimum(one, other))
            leaves = np.minimum(leaves, np.maximum(one, other))
        hidden |= (enters < leaves) & (leaves > 0.0) & (enters < 0.999)
    return hidden


@dataclass(frozen=True, eq=False)
class RankedView:
    """A candidate view and its expected gain: ``expected_yaw_width``: expected remaining width of the yaw set, radians;
    ``visible_fraction``: of the object's surface, averaged over its possible yaws. ``index``: among the given
    candidates.
    """

    index: int
    frame_from_camera: Pose
    expected_yaw_width: float
    visible_fraction: float


class ViewPlanner(ABC):
    """Ranks camera poses; the caller checks whether the robot can reach them."""

    @abstractmethod
    def candidates(self, hypothesis: PoseHypothesis, intrinsics: CameraIntrinsics) -> tuple[Pose, ...]:
        """Return camera poses (frame_from_camera) around the object from which it is fully visible and in focus."""

    @abstractmethod
    def rank(
        self,
        hypothesis: PoseHypothesis,
        candidates: Sequence[Pose],
        intrinsics: CameraIntrinsics,
        obstacles: Sequence[PlacedShape] = (),
    ) -> tuple[RankedView, ...]:
        """Return ``candidates`` (frame_from_camera) ranked by expected information, best first; ``obstacles`` may hide
        the object.
        """


# The view after which the fewest yaws stay open.
# For each yaw that an object may have, the model is looked at from each candidate: which part of its surface would be
# seen, and how far does that part lie from the model at the other yaws? Two yaws stay together where that is too little
# evidence to part them. The expected width of what stays ranks the views: a next-best-view planner in the sense of
# Connolly, "The Determination of Next Best Views", 1985, for yaw instead of coverage. No physics, no rendering: samples
# of the surface in a depth buffer, and rays against boxes around the obstacles.


@dataclass(frozen=True)
class ExpectedYaw(ViewPlanner):
    """Ranks views by the expected remaining ambiguity of the object's yaw.

    Lengths in metres, angles in radians.

    ``distances``, ``elevations``, ``azimuths``: of the candidates around the object's middle; the defaults suit a
    camera on the hand, a camera on a mast needs about (0.9, 1.2). ``filling``: maximum fraction of the image's smaller
    side that the object fills: closer candidates are moved away. ``spacing``: of surface samples. ``telling_samples``:
    maximum number of samples that change when the object rotates, and ``samples``: of all. ``yaw_samples``: maximum
    number of ambiguous yaws; ``min_step``: between them. ``noise_base``, ``noise_quadratic``: of depth. ``profile``:
    weighs the evidence of the predicted view; only the fraction ``caution`` of the predicted gain counts.
    """

    distances: Annotated[tuple[float, ...], "m"] = (0.30, 0.42)
    elevations: Annotated[tuple[float, ...], "rad"] = (math.radians(35.0), math.radians(52.0), math.radians(70.0))
    azimuths: int = 10
    filling: float = 0.7
    spacing: Annotated[float, "m"] = 0.003
    samples: int = 2000
    telling_samples: int = 250
    yaw_samples: int = 12
    min_step: Annotated[float, "rad"] = math.radians(5.0)
    noise_base: Annotated[float, "m"] = 0.0012
    noise_quadratic: Annotated[float, "1/m"] = 0.0019
    caution: float = 0.3
    profile: YawSearch = field(default_factory=YawSearch)

    @override
    def candidates(self, hypothesis: PoseHypothesis, intrinsics: CameraIntrinsics) -> tuple[Pose, ...]:
        lower, upper = hypothesis.model.bounds()
        centre = hypothesis.pose.apply((lower + upper) / 2)
        radius = float(np.linalg.norm(upper - lower)) / 2
        half_angle = math.atan(min(intrinsics.width / intrinsics.fx, intrinsics.height / intrinsics.fy) / 2)
        least = radius / math.sin(self.filling * half_angle)
        rings = sorted({max(distance, least) for distance in self.distances})
        return tuple(
            looking_at(centre, azimuth * 2 * math.pi / self.azimuths, elevation, distance)
            for distance in rings
            for elevation in self.elevations
            for azimuth in range(self.azimuths)
        )

    def rank(
        self,
        hypothesis: PoseHypothesis,
        candidates: Sequence[Pose],
        intrinsics: CameraIntrinsics,
        obstacles: Sequence[PlacedShape] = (),
    ) -> tuple[RankedView, ...]:
        """Return the ranked candidates; views with equal expected gain are ranked by the visible part of the object."""
        if not candidates:
            return ()
        turned = model_yaw_observability(hypothesis.model, self.spacing)
        yaws, step = self._yaws(hypothesis)
        telling, others = self._samples(turned)
        chosen = np.concatenate([telling, others])
        seen = self._visible(hypothesis, turned, yaws, chosen, candidates, intrinsics, obstacles)
        share = len(telling) / max(1, int((turned.largest_distances > self.profile.telling).sum()))
        ranked = []
        for index, frame_from_camera in enumerate(candidates):
            distance = float(np.linalg.norm(frame_from_camera.position - hypothesis.pose.position))
            width = self._expected_width(turned, yaws, step, telling, seen[index, :, : len(telling)], distance, share)
            ranked.append(RankedView(index, frame_from_camera, width, float(seen[index].mean())))
        return tuple(sorted(ranked, key=lambda view: (round(view.expected_yaw_width, 6), -view.visible_fraction)))

    def _samples(self, turned: YawObservability) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Return indices of samples that change when the object turns, and of others, which may hide those."""
        changes = turned.largest_distances > self.profile.telling
        changing, others = np.flatnonzero(changes), np.flatnonzero(~changes)
        changing = changing[evenly(len(changing), self.telling_samples)]
        return changing, others[evenly(len(others), self.samples - len(changing))]

    def _yaws(self, hypothesis: PoseHypothesis) -> tuple[NDArray[np.float64], float]:
        """Return the open turns (Y,) away from the likeliest yaw, and the width that each represents, radians."""
        plausible_yaws: YawSet = hypothesis.yaw_set
        if not hypothesis.upright or plausible_yaws.width == 0.0:
            return np.zeros(1), 0.0
        step = max(self.min_step, plausible_yaws.width / self.yaw_samples)
        turns: list[float] = []
        for middle, half in plausible_yaws.arcs:
            count = max(1, round(2 * half / step))
            offsets = (np.arange(count) + 0.5) / count * 2 * half - half
            turns.extend(middle + offsets - hypothesis.pose.yaw)
        return np.array(turns), plausible_yaws.width / len(turns)

    def _visible(
        self,
        hypothesis: PoseHypothesis,
        turned: YawObservability,
        yaws: NDArray[np.float64],
        chosen: NDArray[np.intp],
        candidates: Sequence[Pose],
        intrinsics: CameraIntrinsics,
        obstacles: Sequence[PlacedShape],
    ) -> NDArray[np.bool_]:
        """Return the samples that each candidate would see at each yaw (C, Y, S)."""
        frame_from_rest = hypothesis.pose @ turned.surface.rest_from_object.inverse()
        points, normals = turned.surface.points[chosen], turned.surface.normals[chosen]
        seen = np.zeros((len(candidates), len(yaws), len(chosen)), dtype=bool)
        eyes = np.array([candidate.position for candidate in candidates])
        # A little wider than the samples are apart: else one would look through between them.
        cell = 1.5 * self.spacing * math.sqrt(len(turned.surface.points) / len(chosen))
        for index, (yaw, shift) in enumerate(zip(yaws, turned.shift(yaws), strict=True)):
            frame_from_turned = frame_from_rest @ Pose.from_xyz_rpy((*shift, 0.0), (0.0, 0.0, yaw))
            placed = frame_from_turned.apply(points)
            seen[:, index] = unobstructed(points, normals, frame_from_turned.inverse().apply(eyes), cell)
            seen[:, index] &= ~hidden_by_shapes(placed, eyes, obstacles)
            seen[:, index] &= _in_images(placed, candidates, intrinsics)
        return seen

    def _expected_width(
        self,
        turned: YawObservability,
        yaws: NDArray[np.float64],
        step: float,
        telling: NDArray[np.intp],
        seen: NDArray[np.bool_],
        distance: float,
        share: float,
    ) -> float:
        """Return the expected width, radians; ``seen``: (Y, T) of the ``telling`` samples, the fraction ``share`` of
        all informative ones.
        """
        if step == 0.0:
            return 0.0
        noise = self.noise_base + self.noise_quadratic * max(0.0, distance - 0.4) ** 2
        variance = noise**2 + self.profile.model_error**2
        # Evidence that what is seen at yaw a does not belong to yaw b: (Y, Y).
        turns = turned.nearest_angle(yaws[None, :] - yaws[:, None])
        moved = np.maximum(0.0, turned.distances[:, telling] - turned.distances[0, telling])
        costs = np.minimum(moved**2 / (2 * variance), self.profile.cap)
        foreseen = np.take_along_axis(seen.astype(np.float64) @ costs.T, turns, axis=1)
        evidence = self.caution * self.profile.floating_weight / share * (foreseen + foreseen.T)
        return float(step * (evidence < self.profile.margin).sum(axis=1).mean())


def looking_at(centre: NDArray[np.float64], azimuth: float, elevation: float, distance: float) -> Pose:
    """Return an optical frame (z ahead, y down) at ``distance`` metres from ``centre``, which it looks at, upright."""
    back = np.array(
        [math.cos(elevation) * math.cos(azimuth), math.cos(elevation) * math.sin(azimuth), math.sin(elevation)]
    )
    right = np.array([-math.sin(azimuth), math.cos(azimuth), 0.0])
    matrix = np.eye(4)
    matrix[:3, :3] = np.stack([right, np.cross(-back, right), -back], axis=1)
    matrix[:3, 3] = np.asarray(centre) + distance * back
    return Pose.from_matrix(matrix)


def _in_images(points: NDArray[np.float64], candidates: Sequence[Pose], k: CameraIntrinsics) -> NDArray[np.bool_]:
    """Return which points (S, 3) each camera has in its image: (C, S)."""
    rotations = np.stack([candidate.rotation for candidate in candidates])
    eyes = np.stack([candidate.position for candidate in candidates])
    offsets = (rotations.swapaxes(1, 2) @ eyes[:, :, None])[..., 0]
    x, y, z = (rotations[:, :, axis] @ points.T - offsets[:, axis, None] for axis in range(3))
    ahead = z > 1e-3
    depth = np.where(ahead, z, 1.0)
    u, v = k.cx + k.fx * x / depth, k.cy + k.fy * y / depth
    inside: NDArray[np.bool_] = ahead & (u >= 0) & (u < k.width) & (v >= 0) & (v < k.height)
    return inside
