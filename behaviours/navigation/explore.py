"""Exploration: mapping an unknown place."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from behaviours.computation import Until, passed
from behaviours.skill import Declaration, Skill, SkillCoroutine, SkillFailure
from bestman_bt.control import MotionStatus
from bestman_bt.engine import In, Out
from bestman_bt.messages import OccupancyGrid, Path2D, Pose2D, wrap_angle
from bestman_bt.messages.grids import FREE
from bestman_bt.messages.shapes import Positive
from bestman_bt.world_model.world_model import BasePose

if TYPE_CHECKING:
    from bestman_bt.navigation.global_planning.base import PlanningFailure
    from bestman_bt.navigation.global_planning.costmap import Costmap
    from bestman_bt.navigation.global_planning.footprint import Footprint
    from bestman_bt.navigation.localization.base import Localizer
    from bestman_bt.navigation.slam.frontiers import FrontierView
    from bestman_bt.navigation.slam.overhangs import Overhangs


AHEAD = (1.5, 0.0, 0.35)
"""Target of the camera while driving, metres in the base frame."""
PICTURE_DISTANCE, PICTURE_TURN = 0.5, math.radians(25.0)
"""Metres that the base moves, or radians that it turns, between two images of the way ahead."""
EVERY_POINT = 7
"""Subsampling of the points of a depth image."""

NO_ROOM = "too little known free space around the base to drive"


class ExploreAndMap(Skill):
    """Map the surroundings by lidar SLAM: drive to places with a view of unknown floor until the whole floor is known.

    The origin of the map is the believed base pose at the start. A camera, if any, looks for table tops and other
    obstacles above the lidar plane. Afterwards the base is localised as before.
    """

    REQUIRES = ("base", "lidar")
    USES = ("head", "camera")
    file = In(str, "file to save the map in, NAME.yaml; not saved without it", required=False)
    max_time = In[float](Positive, "time limit, seconds", default=900.0)
    grid = Out(OccupancyGrid, "the map")
    area = Out(float, "free floor found, m²")
    saved = Out(str, "the written file, if any")
    FAILS: ClassVar = {
        "timeout": "ExploreAndMap with more max_time",
        "start_blocked": "DriveOnHeading or BackUp, then ExploreAndMap again",
        "not_saved": "give a file in a writable folder",
    }
    DECLARATION = Declaration(effects=("mapped()",))

    def execute(self) -> SkillCoroutine[None]:
        """Explore, then save the map."""
        from bestman_bt.navigation.map_file import MapFileError, write_map
        from bestman_bt.navigation.slam.pose_graph_slam import SlamLocalizer

        skills = self.skills
        slam, given = skills.slam, skills.world.base
        before = skills.base.localise_by(SlamLocalizer(slam))
        try:
            finished = yield from self._explore()
            yield skills.base.park()
        finally:
            skills.base.stop()
            self._localise_by(before, given)
        grid = slam.grid
        area = float((grid.data == FREE).sum()) * grid.resolution**2
        self.grid = grid
        self.area = area
        if self.file:
            try:
                self.saved = str(write_map(grid, self.file))
            except MapFileError as error:
                raise SkillFailure("not_saved", str(error)) from error
        if not finished:
            text = f"{area:.0f} m² were mapped in {self.max_time:.0f} s, and there is more to see"
            raise SkillFailure("timeout", text)
        self.feedback_message = f"{area:.0f} m² of free floor, {slam.estimate.loop_closures} loop closures"

    def _localise_by(self, localizer: Localizer, given: BasePose) -> None:
        """Restore the previous localisation, with the uncertainty of the initial base pose."""
        base, now = self.skills.base, self.skills.world.base
        base.localise_by(localizer)
        far = given.pose.distance_to(now.pose)
        position_std = math.hypot(now.position_std, given.position_std + given.heading_std * far)
        base.believe(now.pose, position_std, math.hypot(now.heading_std, given.heading_std))

    def _explore(self) -> SkillCoroutine[bool]:
        """Explore; return True if nothing is left to see, False after the time limit."""
        from bestman_bt.navigation.global_planning.base import PlanningFailureReason
        from bestman_bt.navigation.slam.overhangs import Overhangs

        skills = self.skills
        end = skills.clock.now() + self.max_time
        slam, explorer = skills.slam, skills.exploration
        if skills.has("head"):
            yield skills.head.look_at(AHEAD)
        yield skills.base.park()
        overhangs = Overhangs(slam.grid.resolution)
        self._pictured: Pose2D | None = None
        self._outline = self._grown(skills.footprint())
        useless, moved = np.zeros((0, 2)), False
        while skills.clock.now() < end:
            grid, costmap = self._look(overhangs)
            views: list[FrontierView] = yield self.compute(
                "exploration", explorer.tour, grid, costmap, self._pose, useless
            )
            stuck = costmap.clearance_at(self._pose) <= 0.0
            if not views and not moved and stuck:
                raise SkillFailure("start_blocked", NO_ROOM)
            if not views:
                return True
            for view in views:
                path = yield self.compute("global_planning", self._plan, view.pose, costmap)
                if isinstance(path, Path2D):
                    self.feedback_message = f"{view.gain:.1f} m² unknown in view, {path.length:.1f} m away"
                    moved = True
                    if not (yield from self._drive(path, view, overhangs, end)):
                        useless = np.vstack([useless, view.pose.xy])
                    break
                if stuck and path.reason is PlanningFailureReason.START_BLOCKED:
                    raise SkillFailure("start_blocked", NO_ROOM)
                useless = np.vstack([useless, view.pose.xy])
        return False

    def _grown(self, footprint: Footprint) -> Footprint:
        """Return the outline of base and arm as one: how high something is that the lidar has seen is not known."""
        from bestman_bt.navigation.global_planning.footprint import Footprint

        clearance = self.skills.parameters.explore.clearance
        corners = footprint.corners * (1.0 + clearance / np.linalg.norm(footprint.corners, axis=1, keepdims=True))
        above = footprint.above.corners
        reaching = np.column_stack([above, np.zeros(len(above))])
        return Footprint(corners, footprint.turning_drift).carrying([reaching], margin=0.0).above

    def _drive(self, path: Path2D, view: FrontierView, overhangs: Overhangs, end: float) -> SkillCoroutine[bool]:
        """Drive until the goal offers no further view; return whether this is reached, on the way or at the goal."""
        skills, explorer, parameters = self.skills, self.skills.exploration, self.skills.parameters.explore
        handle = skills.base.follow(path)
        while True:
            yield Until(passed(skills.clock, parameters.look_period), handle)
            if handle.done and handle.status is not MotionStatus.SUCCEEDED:
                failure = handle.failure
                if failure is None or failure.code not in ("blocked", "tolerance"):
                    raise SkillFailure.of(failure)
                return False
            grid, costmap = self._look(overhangs)
            if not explorer.is_useful(grid, view.pose.xy):
                return True
            if handle.done or self._pose.distance_to(view.pose) < parameters.goal_tolerance:
                return False
            if skills.clock.now() >= end:
                return True
            if not self._is_free(path, costmap):
                skills.base.stop()
                return costmap.clearance_at(view.pose) > 0.0

    def _look(self, overhangs: Overhangs) -> tuple[OccupancyGrid, Costmap]:
        """Return the current map, and the obstacles to avoid."""
        skills = self.skills
        if skills.has("camera") and self._picture_due():
            self._pictured = self._pose
            view = skills.camera.capture().in_map
            overhangs.add(view.cloud().points[::EVERY_POINT], view.viewpoint)
        grid = skills.slam.grid
        if not grid.data.size:
            raise SkillFailure("start_blocked", "the lidar has not seen anything to map yet")
        return grid, skills.costmap.of_grid(overhangs.drawn_on(grid), self._outline)

    def _picture_due(self) -> bool:
        pictured, pose = self._pictured, self._pose
        if pictured is None or pose.distance_to(pictured) > PICTURE_DISTANCE:
            return True
        return abs(wrap_angle(pose.theta - pictured.theta)) > PICTURE_TURN

    @property
    def _pose(self) -> Pose2D:
        return self.skills.world.base.pose

    def _plan(self, goal: Pose2D, costmap: Costmap) -> Path2D | PlanningFailure:
        return self.skills.global_planning.plan(self._pose, goal, costmap)

    def _is_free(self, path: Path2D, costmap: Costmap) -> bool:
        """Return whether the next metres of the path are."""
        steps = np.diff(path.points, axis=0)
        lengths = np.linalg.norm(steps, axis=1)
        pieces = [
            start + step * np.arange(0.0, 1.0, 0.05 / max(float(length), 0.05))[:, None]
            for start, step, length in zip(path.points[:-1], steps, lengths, strict=True)
        ]
        points = np.concatenate([*pieces, path.points[-1:]])
        passed = int(np.argmin(np.linalg.norm(points - self._pose.xy, axis=1)))
        ahead = points[passed : passed + round(self.skills.parameters.explore.look_ahead / 0.05)]
        return bool((costmap.distance_at(ahead) > 0.9 * costmap.footprint.inscribed_radius).all())
