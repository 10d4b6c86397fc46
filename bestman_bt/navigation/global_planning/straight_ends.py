"""Straight ends of a path near furniture, where a base can neither turn nor choose a direction."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import Pose2D
from bestman_bt.messages.shapes import NonNegative, NotBelow, Positive
from bestman_bt.navigation.global_planning.base import PlanningFailure, PlanningFailureReason
from bestman_bt.navigation.global_planning.costmap import Costmap


@dataclass(frozen=True)
class StraightPieces:
    """Parameters of both ends of a path, metres.

    ``straight``: preferred length, ``max_straight``: longest straight piece at an end that needs one. ``step``: spacing
    of collision checks along it. ``max_overlap``: depth by which the base may be inside a margin at the start.
    """

    straight: Annotated[NonNegative, "m"] = 0.4
    max_straight: Annotated[NonNegative, NotBelow("straight"), "m"] = 1.2
    step: Annotated[Positive, "m"] = 0.02
    max_overlap: Annotated[NonNegative, "m"] = 0.06


class Ends(NamedTuple):
    """The ends of a path. ``leave``: first point after the start, ``approach``: last point before the goal, both (2,)
    metres.

    ``backwards``: whether the base drives to the first one backwards.
    """

    leave: NDArray[np.float64]
    backwards: bool
    approach: NDArray[np.float64]


@dataclass(frozen=True)
class StraightEnds:
    """Leaves starts straight, and enters goals straight along their heading.

    ``turning_distance``: metres from obstacles where the straight piece may end, for bases that turn there, minus
    ``slack`` in narrow places; None: anywhere with ``clearance`` metres around the footprint.
    """

    costmap: Costmap
    pieces: StraightPieces
    turning_distance: float | None = None
    slack: float = 0.0
    clearance: float = 0.0

    def between(self, start: Pose2D, goal: Pose2D) -> Ends | PlanningFailure:
        """Return both ends of a path, or a PlanningFailure."""
        fault = self._fault(start, goal)
        if fault is not None:
            return fault
        leave = self._leave(start)
        if isinstance(leave, PlanningFailure):
            return leave
        approach = self._approach(goal)
        return approach if isinstance(approach, PlanningFailure) else Ends(*leave, approach)

    def _fault(self, start: Pose2D, goal: Pose2D) -> PlanningFailure | None:
        """Return why there cannot be a path, as far as start and goal alone show."""
        for pose, what, reason in (
            (start, "start", PlanningFailureReason.START_OUTSIDE),
            (goal, "goal", PlanningFailureReason.GOAL_OUTSIDE),
        ):
            if not self.costmap.contains(pose.xy):
                return PlanningFailure(reason, f"the {what} ({pose.x:.2f}, {pose.y:.2f}) m is not on the map")
        if self.costmap.clearance_at(goal) <= 0.0:
            return PlanningFailure(
                PlanningFailureReason.GOAL_BLOCKED,
                f"the base would touch an obstacle at the goal ({goal.x:.2f}, {goal.y:.2f}) m, "
                f"{math.degrees(goal.theta):.0f}°",
            )
        return None

    def _leave(self, start: Pose2D) -> tuple[NDArray[np.float64], bool] | PlanningFailure:
        """Return the point (2,) that the base drives to first, and whether it drives there backwards."""
        best: tuple[int, NDArray[np.float64], bool] | None = None
        for direction in (-1.0, 1.0):
            poses = self._straight(start, direction)
            base, free = (
                self.costmap.without_overhang.footprint_clearance(poses),
                self.costmap.overhang_clearance(poses),
            )
            # A base that stands inside a margin may leave it as long as it does not come nearer to anything. An arm
            # came to where it is by shapes, not by outlines: it may be as deep inside one as it is, above its boards.
            passable = (base > 0.0) | _rising(base, bool(base[0] > -self.pieces.max_overlap))
            if self.costmap.above is not None:
                passable &= (free > 0.0) | _rising(self.costmap.above.footprint_clearance(poses), True)
            index = self._end(poses, np.minimum(base, free), passable)
            if index is not None and (best is None or index < best[0]):
                best = index, poses[index, :2], direction < 0.0
        if best is not None:
            return best[1:]
        return PlanningFailure(
            PlanningFailureReason.START_BLOCKED,
            f"the base cannot leave ({start.x:.2f}, {start.y:.2f}) m straight back or ahead without touching",
        )

    def _approach(self, goal: Pose2D) -> NDArray[np.float64] | PlanningFailure:
        """Return the point (2,) straight behind the goal from which it is entered."""
        poses = self._straight(goal, -1.0)
        clearance = self.costmap.footprint_clearance(poses)
        index = self._end(poses, clearance, clearance > 0.0)
        if index is not None:
            point: NDArray[np.float64] = poses[index, :2]
            return point
        return PlanningFailure(
            PlanningFailureReason.GOAL_BLOCKED,
            f"there is no free straight approach to ({goal.x:.2f}, {goal.y:.2f}) m, {math.degrees(goal.theta):.0f}°",
        )

    def _end(
        self, poses: NDArray[np.float64], clearance: NDArray[np.float64], passable: NDArray[np.bool_]
    ) -> int | None:
        """Return the index of the pose of a straight piece (N, 3) at which to end it; 0 if none is needed."""
        reached = np.logical_and.accumulate(passable)
        suits = reached & (clearance > self.clearance)
        if self.turning_distance is not None:
            room = self.costmap.for_turning.distance_at(poses[:, :2])
            suits = reached & (room >= self.turning_distance)
            if not suits.any():
                suits = reached & (room >= self.turning_distance - self.slack)
        if not suits.any():
            return None
        first = int(np.argmax(suits))
        wanted = round(self.pieces.straight / self.pieces.step)
        if first == 0 or first >= wanted:
            return first
        return int(np.flatnonzero(suits[: wanted + 1])[-1])

    def _straight(self, pose: Pose2D, direction: float) -> NDArray[np.float64]:
        """Return poses (N, 3) straight ahead of (1.0) or behind (-1.0) a pose, itself first."""
        along = direction * np.arange(0.0, self.pieces.max_straight, self.pieces.step)
        heading = np.full_like(along, pose.theta)
        return np.column_stack([pose.x + along * math.cos(pose.theta), pose.y + along * math.sin(pose.theta), heading])


def _rising(clearance: NDArray[np.float64], first: bool) -> NDArray[np.bool_]:
    """Return where along poses a clearance (N,) does not decrease; ``first``: the value for the first one."""
    return np.append(first, np.diff(clearance) > -1e-3)
