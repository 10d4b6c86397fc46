"""What a base is doing: one driving action at a time."""

from __future__ import annotations

from dataclasses import dataclass

from bestman_bt.control.handle import ControlHandle
from bestman_bt.control.wheeled.progress import ProgressWatch
from bestman_bt.messages import Path2D, Pose2D
from bestman_bt.navigation.local_planning import PathFollower, SweptPath
from bestman_bt.world_model import BasePose


@dataclass(frozen=True, eq=False)
class DrivenPath:
    """``swept`` holds how far along ``path`` the base is. ``mapped``: it was planned on a map that is known."""

    path: Path2D
    swept: SweptPath
    mapped: bool


@dataclass
class BaseAction:
    """Driving by ``follower`` (None: coming to rest), towards ``goal`` (None: wherever).

    ``by_odometry``: in its frame, without the map. ``speed``: m/s, no faster than that.
    ``corrections``: of the heading, made so far. ``gave_way``: seconds
    when it last began to stand for somebody who walks, None while it does not.
    """

    handle: ControlHandle[BasePose]
    follower: PathFollower | None
    goal: Pose2D | None
    position_tolerance: float
    watch: ProgressWatch
    by_odometry: bool = False
    speed: float | None = None
    driven: DrivenPath | None = None
    corrections: int = 0
    gave_way: float | None = None
