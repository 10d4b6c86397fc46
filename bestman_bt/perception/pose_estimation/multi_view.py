"""One object seen in several views: their fits are fused, their evidence about its yaw multiplied.

In each view the object is registered as in MultiStart; the fits are fused by their information matrices (covariance
weighting as in Smith and Cheeseman, "On the Representation and Estimation of Spatial Uncertainty", 1986), after each
was widened by the error of its camera pose. A yaw remains plausible if the sum of the views' log-likelihoods permits
it.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from scipy.special import expit
from typing_extensions import override

from bestman_bt.messages import ObjectModel, Pose, YawSet
from bestman_bt.perception.errors import PerceptionError
from bestman_bt.perception.pose_estimation.base import PoseHypothesis
from bestman_bt.perception.pose_estimation.evidence import PoseEvidence, color_distance
from bestman_bt.perception.pose_estimation.model_surface import ModelSurface, model_palette
from bestman_bt.perception.pose_estimation.multi_start import MultiStart, SeenCluster, covariance_in_frame
from bestman_bt.perception.pose_estimation.registration import Fit
from bestman_bt.perception.pose_estimation.yaw_profile import YawProfile
from bestman_bt.perception.segmentation.base import Cluster, SupportPlane
from bestman_bt.perception.view import View


@dataclass(frozen=True, eq=False)
class ViewObservation:
    """The observation of an object in one view; cluster and view of all observations share a frame."""

    cluster: Cluster
    view: View


class MultiViewEstimator(ABC):
    """Combines several views of one object."""

    @abstractmethod
    def estimate(
        self, observations: Sequence[ViewObservation], models: Sequence[ObjectModel]
    ) -> tuple[PoseHypothesis, ...]:
        """Return the best pose of each model that could explain all ``observations``, most confident first.

        Equal input gives equal output. Raises PerceptionError without an observation.
        """


@dataclass(frozen=True)
class MultiView(MultiViewEstimator):
    """Combines several views of one upright object: fits are fused, evidence about the yaw is multiplied.

    ``single``: registration in each view. ``camera_position_std``, metres, and ``camera_yaw_std``, radians: uncertainty
    of the views' camera poses relative to each other.
    """

    single: MultiStart = field(default_factory=MultiStart)
    camera_position_std: Annotated[float, "m"] = 0.0015
    camera_yaw_std: Annotated[float, "rad"] = 0.005

    @override
    def estimate(
        self, observations: Sequence[ViewObservation], models: Sequence[ObjectModel]
    ) -> tuple[PoseHypothesis, ...]:
        if not observations:
            raise PerceptionError("MultiView needs at least one observation, got none")
        if len(observations) == 1:
            return self.single.estimate(observations[0].cluster, models, observations[0].view)
        # The plane that most was seen of is the common one.
        plane = max((o.cluster.plane for o in observations), key=lambda plane: len(plane.inliers))
        seen = [_seen_on(plane, observation, self.single) for observation in observations]
        found = [best for model in models if (best := self._fit_model(model, seen)) is not None]
        found.sort(key=lambda hypothesis: -hypothesis.confidence)
        return tuple(found)

    def _fit_model(self, model: ObjectModel, seen: Sequence[SeenCluster]) -> PoseHypothesis | None:
        p = self.single
        colors = np.concatenate([item.cluster.colors for item in seen])
        color = color_distance(colors, model.color)
        surface = self.single.surfaces.resting(model)[0]
        if color > p.color_limit or not all(item.may_be(surface, p.size_tolerance) for item in seen):
            return None
        turns = model.symmetry_order
        palette = model_palette(model)
        all_points = [
            p.strays.added_to(item.points, item.plane_view, palette) if turns == 1 else item.points for item in seen
        ]
        profile = self._profile(surface, seen, all_points, palette) if turns == 1 else None
        starts = self._starts(surface, seen, turns, profile)
        candidates = [self._fused(surface, seen, all_points, start, turns) for start in starts]
        if profile is None:
            logits = [p.confidence.logit(evidence, color) for _, evidence in candidates]
            best = int(np.argmax(logits))
        else:
            best = int(np.argmax([self._likelihood(surface, seen, all_points, palette, fit) for fit, _ in candidates]))
        fit, evidence = candidates[best]
        frame_from_plane = seen[0].cluster.plane.frame_from_plane
        pose = fit.frame_from_object(frame_from_plane, surface)
        return PoseHypothesis(
            model=model,
            pose=pose,
            confidence=float(expit(p.confidence.logit(evidence, color))),
            covariance=covariance_in_frame(fit.covariance, frame_from_plane),
            yaw_set=self._open_yaws(fit, profile, turns).turned(pose.yaw - float(fit.pose[2])),
            rmse=evidence.rmse,
            explained=evidence.explained,
            visible_fraction=evidence.visible_fraction,
            floating=evidence.floating,
            color_distance=color,
        )

    def _profile(
        self,
        surface: ModelSurface,
        seen: Sequence[SeenCluster],
        all_points: Sequence[NDArray[np.float64]],
        palette: NDArray[np.float64],
    ) -> YawProfile:
        """Return the product of the views' likelihoods, on the yaws of the first; positions: the means."""
        p = self.single
        turned = self.single.surfaces.turned(surface)
        start = p.coarse_poses(surface, seen[0].points, seen[0].eye, 1, 1)[0]
        profiles = [
            p.yaw.profile(turned, points, item.plane_view, start, palette, item.noise)
            for item, points in zip(seen, all_points, strict=True)
        ]
        return YawProfile(
            profiles[0].yaws,
            np.mean([profile.positions for profile in profiles], axis=0),
            np.sum([profile.log_likelihood for profile in profiles], axis=0),
        )

    def _starts(
        self, surface: ModelSurface, seen: Sequence[SeenCluster], turns: int, profile: YawProfile | None
    ) -> list[NDArray[np.float64]]:
        p = self.single
        if profile is not None:
            return profile.starts(p.yaw.margin, p.refined)
        return [start for item in seen for start in p.coarse_poses(surface, item.points, item.eye, turns, p.refined)]

    def _fused(
        self,
        surface: ModelSurface,
        seen: Sequence[SeenCluster],
        all_points: Sequence[NDArray[np.float64]],
        start: NDArray[np.float64],
        turns: int,
    ) -> tuple[Fit, PoseEvidence]:
        """Return the fits of all views in one, and the evidence for it, weighed by the views' points."""
        information, weighted = np.zeros((3, 3)), np.zeros(3)
        widening = np.diag([self.camera_position_std**2, self.camera_position_std**2, self.camera_yaw_std**2])
        for item, points in zip(seen, all_points, strict=True):
            fit = self.single.refined_fit(surface, points, item.eye, start, turns)
            own = np.linalg.inv(fit.covariance + widening)
            information += own
            weighted += own @ (fit.pose - start)
        pose = start + np.linalg.solve(information, weighted)
        fits = [self.single.fit_at(surface, item.points, item.eye, pose, turns) for item in seen]
        covariance = np.asarray(np.linalg.inv(information), dtype=np.float64)
        if not turns:
            covariance[2, 2] = math.pi**2
        evidence = [item.judge(surface, fit) for item, fit in zip(seen, fits, strict=True)]
        weights = np.array([len(item.points) for item in seen], dtype=np.float64)
        fused = Fit(pose, np.concatenate([fit.residuals for fit in fits]), covariance)
        return fused, pooled(evidence, weights / weights.sum())

    def _likelihood(
        self,
        surface: ModelSurface,
        seen: Sequence[SeenCluster],
        all_points: Sequence[NDArray[np.float64]],
        palette: NDArray[np.float64],
        fit: Fit,
    ) -> float:
        p = self.single
        turned = self.single.surfaces.turned(surface)
        values = [
            p.yaw.likelihood(turned, points, item.plane_view, fit.pose[None], palette, item.noise)[0]
            for item, points in zip(seen, all_points, strict=True)
        ]
        return float(sum(values))

    def _open_yaws(self, fit: Fit, profile: YawProfile | None, turns: int) -> YawSet:
        if turns == 0:
            return YawSet()
        if profile is None:
            return YawSet(((float(fit.pose[2]), 3.0 * fit.yaw_std),))
        return profile.plausible_yaws(self.single.yaw.margin, float(fit.pose[2]), fit.yaw_std)


def _seen_on(plane: SupportPlane, observation: ViewObservation, single: MultiStart) -> SeenCluster:
    """Cluster and view lifted or lowered until the plane under the cluster is ``plane``: camera heights err."""
    cluster, view = observation.cluster, observation.view
    x, y, _ = cluster.points.mean(axis=0)
    lift = np.array([0.0, 0.0, plane.height_at(x, y) - cluster.plane.height_at(x, y)])
    camera = Pose(view.frame_from_camera.position + lift, view.frame_from_camera.quaternion)
    moved = Cluster(cluster.points + lift, cluster.colors, plane, cluster.at_border)
    return SeenCluster.of(moved, View(view.image, camera), single)


def pooled(evidence: Sequence[PoseEvidence], weights: NDArray[np.float64]) -> PoseEvidence:
    """Return the mean of several views' evidence; ``weights``: their relative weights."""
    mean = {
        name: float(np.dot(weights, [getattr(item, name) for item in evidence]))
        for name in ("explained", "visible_fraction", "floating", "outside", "noise")
    }
    rmse = math.sqrt(float(np.dot(weights, [item.rmse**2 for item in evidence])))
    return PoseEvidence(rmse=rmse, **mean)
