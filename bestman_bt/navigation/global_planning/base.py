"""Global planners: from a start pose to a goal pose over a costmap."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum

from bestman_bt.messages import Path2D, Pose2D
from bestman_bt.navigation.global_planning.costmap import Costmap


class PlanningFailureReason(Enum):
    """Reasons for a missing path."""

    START_BLOCKED = "start_blocked"  # the robot touches an obstacle at the start or cannot leave it straight
    GOAL_BLOCKED = "goal_blocked"  # the footprint at the goal, or its straight approach, touches an obstacle
    START_OUTSIDE = "start_outside"  # the start is not on the costmap
    GOAL_OUTSIDE = "goal_outside"  # the goal is not on the costmap
    NO_PATH = "no_path"  # both ends are free, but nothing connects them
    ARM_IN_THE_WAY = "arm_in_the_way"  # one of these, and only because of what stands out above the base


@dataclass(frozen=True)
class PlanningFailure:
    """Why no path was found; ``reason``: for programs, ``text``: for people."""

    reason: PlanningFailureReason
    text: str

    @classmethod
    def no_path(cls, start: Pose2D, goal: Pose2D) -> PlanningFailure:
        """Return the failure for two free poses that no path connects."""
        return cls(
            PlanningFailureReason.NO_PATH,
            f"nothing wide enough for the base leads from ({start.x:.2f}, {start.y:.2f}) m "
            f"to ({goal.x:.2f}, {goal.y:.2f}) m",
        )


class GlobalPlanner(ABC):
    """Finds a path that the footprint can follow without touching an obstacle of the costmap."""

    @abstractmethod
    def plan(self, start: Pose2D, goal: Pose2D, costmap: Costmap) -> Path2D | PlanningFailure:
        """Return a path in the map frame from ``start`` to ``goal``, or a PlanningFailure.

        The path begins at the start and ends at the goal; its ``reverse`` marks the segments to drive backwards. Raises
        ValueError for a pose that is not finite.
        """


def with_overhang_reason(
    plan: Callable[[Pose2D, Pose2D, Costmap], Path2D | PlanningFailure], start: Pose2D, goal: Pose2D, costmap: Costmap
) -> Path2D | PlanningFailure:
    """Return the result of ``plan``; a failure that is caused only by the overhang above the base states this."""
    found = plan(start.checked("the start"), goal.checked("the goal"), costmap)
    overhang = costmap.footprint.overhang
    if isinstance(found, Path2D) or overhang is None:
        return found
    if isinstance(plan(start, goal, costmap.without_overhang), PlanningFailure):
        return found
    return PlanningFailure(PlanningFailureReason.ARM_IN_THE_WAY, f"{overhang}: {found.text}")
