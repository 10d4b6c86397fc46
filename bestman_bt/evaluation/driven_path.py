"""How far a base has really driven."""

from __future__ import annotations

from bestman_bt.messages import Pose2D
from hal.simulation import GroundTruth


class DrivenPath:
    """Adds up the way of the true pose from tick to tick; to turn on the spot is no way."""

    def __init__(self, truth: GroundTruth) -> None:
        self._truth = truth
        self._before: Pose2D | None = None
        self.length = 0.0
        """Metres."""

    def after_tick(self) -> None:
        """Look where the base is."""
        pose = self._truth.base_pose().to_pose2d()
        if self._before is not None:
            self.length += pose.distance_to(self._before)
        self._before = pose
