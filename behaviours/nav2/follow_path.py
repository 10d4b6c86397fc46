"""FollowPath: drive along a path, and along the next one as soon as there is one."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np

from behaviours.nav2.ports import SERVER, FollowerName, without_meaning
from behaviours.skill import Skill, SkillFailure, Steps
from behaviours.waiting import Until
from bestman_bt.engine import In
from bestman_bt.messages import Path2D
from bestman_bt.world_model import BasePose

if TYPE_CHECKING:
    from bestman_bt.control import Motion


class FollowPath(Skill):
    """Drive along a path to its goal pose.

    Where another path is put on the port meanwhile, the base goes over to it without stopping; where it is cleared, the
    base goes on along the one that it has.
    """

    REQUIRES = ("base", "lidar")
    INPUT_PORTS: ClassVar = {**SERVER, **without_meaning("goal_checker_id", "progress_checker_id", "path_handler_id")}
    path_ = In(Path2D, "the path, in the map frame", required=False, port="path")
    controller_id = In[str](
        FollowerName, "a local planner, as pure_pursuit or file.py:Class; the configured one", default=""
    )
    FAILS: ClassVar = {"no_path": "ComputePathToPose first"}

    def execute(self) -> Steps:
        """Follow whatever path there is until the last one has ended."""
        path: Path2D | None = self.path_
        if path is None:
            raise SkillFailure("no_path", "there is no path to follow")
        driving = self._follow(path)
        try:
            while True:
                yield Until(self._has_new, driving)
                if driving.done:
                    yield driving
                    return
                driving = self._follow(self.path_ or path)
        finally:
            driving.cancel()

    def _follow(self, path: Path2D) -> Motion[BasePose]:
        skills, controller = self.skills, self.controller_id
        self._path, self._controller = path, controller
        self.feedback_message = f"driving {path.length:.1f} m"
        follower = skills.followers(controller, self.folders) if controller else None
        return skills.base.follow(path, skills.known_costmap(), follower)

    def _has_new(self) -> bool:
        """Whether there is a path, and it, or who is to follow it, is not what it was."""
        path: Path2D | None = self.path_
        if path is None:
            return False
        before = self._path
        if path is before:
            return bool(self.controller_id != self._controller)
        return path.goal != before.goal or not np.array_equal(path.points, before.points)
