"""Standing where an object can be pushed to its goal."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from behaviours.push import STANDOFF, push_tool_poses
from behaviours.skill import Declaration, SkillFailure
from behaviours.stand import FindStandPose, StandTarget
from bestman_bt.messages import Pose


class FindPushStand(FindStandPose):
    """Choose where to stand to push an object that was seen to a goal: the arm reaches behind it and all the way.

    Each time it is asked again for the same object and place it gives another stand, until all have been tried.
    """

    FAILS: ClassVar = {"not_found": "DetectObject first"}
    DECLARATION = Declaration(pre=("visible({object})",), effects=("stand_known({surface})",))

    def _targets(self) -> list[StandTarget]:
        name: str = self.object or ""
        goal: Pose | None = self.goal
        belief = self.skills.world.objects.get(name)
        if belief is None or goal is None:
            raise SkillFailure("not_found", f"the {name or 'object'} has not been seen, or no goal is given")
        way = goal.position - belief.pose.position
        way[2] = 0.0
        direction = way / max(float(np.linalg.norm(way)), 1e-6)
        ends = []
        for behind in push_tool_poses(belief.model, belief.pose, direction):
            last = Pose(behind.position + way + STANDOFF * direction, behind.quaternion)
            ends.append((behind, last))
        return [StandTarget(ends, belief.pose.position[:2])]
