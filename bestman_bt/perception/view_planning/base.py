"""View planning: from where would another look tell most about an object?"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass

from bestman_bt.messages import CameraIntrinsics, PlacedShape, Pose
from bestman_bt.perception.pose_estimation.base import PoseHypothesis


@dataclass(frozen=True, eq=False)
class RankedView:
    """A candidate and what it promises: ``expected_yaw_width``: radians that the yaw set would keep on average;
    ``visible_fraction``: share of the object's surface in view, averaged over its possible yaws. ``index``: among the
    candidates that were given.
    """

    index: int
    frame_from_camera: Pose
    expected_yaw_width: float
    visible_fraction: float


class ViewPlanner(ABC):
    """Ranks camera poses; whether the robot can take them is for the caller to check."""

    @abstractmethod
    def candidates(self, hypothesis: PoseHypothesis, intrinsics: CameraIntrinsics) -> tuple[Pose, ...]:
        """Camera poses (frame_from_camera) around the object from which it is well in view and in focus."""

    @abstractmethod
    def rank(
        self,
        hypothesis: PoseHypothesis,
        candidates: Sequence[Pose],
        intrinsics: CameraIntrinsics,
        obstacles: Sequence[PlacedShape] = (),
    ) -> tuple[RankedView, ...]:
        """``candidates`` (frame_from_camera), the most telling first; ``obstacles`` may hide the object."""
