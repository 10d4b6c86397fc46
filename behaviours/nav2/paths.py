"""Operations on paths of the blackboard: cutting, smoothing, checks."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from behaviours.nav2.ports import FRAMES, SERVER, SERVICE, Nav2Errors, SmootherName, nothing_written, without_meaning
from behaviours.skill import InstantSkill, SkillCondition, SkillFailure
from bestman_bt.engine import In, Out
from bestman_bt.messages import Goals, Path2D, Pose2D, wrap_angle
from bestman_bt.messages.shapes import NonNegative, Positive

if TYPE_CHECKING:
    from bestman_bt.navigation.global_planning.costmap import Costmap

LEAVES = 1e-3
"""Tolerance of interpolation when leaving an obstacle, metres."""
NO_PATH = {"no_path": "ComputePathToPose first"}


def needed(path: Path2D | None) -> Path2D:
    """Return ``path`` unless it is None. Raises SkillFailure (``no_path``) otherwise."""
    if path is None:
        raise SkillFailure("no_path", "there is no path yet")
    return path


class TruncatePath(InstantSkill):
    """Cut a path at the last point ``distance`` metres (Euclidean) from its end; it then ends facing that end."""

    FAILS: ClassVar = NO_PATH
    input_path = In(Path2D, "the path", required=False)
    output_path = Out(Path2D, "the path")
    distance = In(float, "metres from the end", default=1.0)

    def act(self) -> None:
        """Cut the path at the given distance before its end."""
        from bestman_bt.navigation.path_pieces import before_goal

        path = needed(self.input_path)
        whole = len(path.points) < 2 or self.distance <= 0.0
        self.output_path = path if whole else before_goal(path, self.distance)


class TruncatePathLocal(InstantSkill):
    """Keep the part of a path from ``distance_backward`` behind the base to ``distance_forward`` ahead of it."""

    INPUT_PORTS: ClassVar = {**FRAMES, **without_meaning("transform_tolerance", "angular_distance_weight")}
    FAILS: ClassVar = NO_PATH
    input_path = In(Path2D, "the path", required=False)
    output_path = Out(Path2D, "the path")
    distance_forward = In(float, "metres ahead; below 0: to its end", default=8.0)
    distance_backward = In[float](NonNegative, "metres behind", default=4.0)
    pose = In(Pose2D, "x;y;theta, in place of the current base pose", required=False)
    max_robot_pose_search_dist = In(
        float, "metres of path beyond the last place to search for the next one", default=math.inf
    )

    def on_load(self) -> None:
        """Reset the place on the path."""
        self._progress = PlaceOnPath()

    def act(self) -> None:
        """Keep the part of the path around the base."""
        from bestman_bt.navigation.path_pieces import piece

        path = needed(self.input_path)
        pose = self.pose or self.skills.world.base.pose
        if len(path.points) > 1:
            at = self._progress.find(path, pose, self.max_robot_pose_search_dist)
            forward = self.distance_forward
            end = math.inf if forward < 0.0 else at + forward
            path = piece(path, at - self.distance_backward, end)
        self.output_path = path


class SmoothPath(Nav2Errors, InstantSkill):
    """Smooth the corners of a path; if the base would then touch an obstacle, the path is unchanged."""

    REQUIRES = ("base", "lidar")
    INPUT_PORTS: ClassVar = {**SERVER, **without_meaning("max_smoothing_duration")}
    FAILS: ClassVar = NO_PATH
    OUTPUT_PORTS: ClassVar = nothing_written("smoothing_duration")
    unsmoothed_path = In(Path2D, "the path", required=False)
    smoothed_path = Out(Path2D, "the path")
    check_for_collisions = In(bool, "keep the path if the smoothed one would collide", default=False)
    smoother_id = In[str](SmootherName, "simple_smoother", default="")
    was_completed = Out(bool, "false: the path is unchanged")

    def act(self) -> None:
        """Write the smoothed path to the port."""
        from bestman_bt.navigation.path_pieces import PathSmoother

        _ = self.smoother_id  # read to be checked where it is an entry: it must name what there is
        path = needed(self.unsmoothed_path)
        smoothed = PathSmoother().smooth(path)
        touches = self.check_for_collisions and first_contact(smoothed, self.skills.seen_costmap()) is not None
        self.smoothed_path = path if touches else smoothed
        self.was_completed = not touches


class ConcatenatePaths(InstantSkill):
    """Concatenate two paths; one of them may be missing."""

    input_path1 = In(Path2D, "the first", required=False)
    input_path2 = In(Path2D, "the second", required=False)
    output_path = Out(Path2D, "both")
    FAILS: ClassVar = NO_PATH

    def act(self) -> None:
        """Write the concatenated path to the port."""
        from bestman_bt.navigation.path_pieces import joined

        paths = [path for path in (self.input_path1, self.input_path2) if path is not None]
        if not paths:
            raise SkillFailure("no_path", "there is no path to join")
        self.output_path = joined(paths)


class GetPoseFromPath(InstantSkill):
    """Output a pose of a path by its index; the last one is the path's goal."""

    FAILS: ClassVar = NO_PATH
    path_ = In(Path2D, "the path", required=False, port="path")
    index = In(int, "from 0; below 0: from the end, -1 is the last", default=0)
    pose = Out(Pose2D, "the pose; it faces along the path")

    def act(self) -> None:
        """Write the pose at ``index`` of the path."""
        path = needed(self.path_)
        count = len(path.points)
        at = self.index + count if self.index < 0 else self.index
        if not 0 <= at < count:
            raise SkillFailure("bad_input", f"index is {self.index}; the path has {count} points")
        if at == count - 1:
            self.pose = path.goal
        else:
            (x, y), (dx, dy) = path.points[at], path.points[at + 1] - path.points[at]
            self.pose = Pose2D(float(x), float(y), math.atan2(dy, dx))


class PathExpiringTimer(SkillCondition):
    """True once ``seconds`` have passed since the path changed or the last success; false at the first check."""

    path_ = In(Path2D, "the path", required=False, port="path")
    seconds = In[float](Positive, "seconds", default=1.0)
    FAILS: ClassVar = {"not_expired": "nothing is wrong"}

    def on_load(self) -> None:
        """Start with the timer stopped."""
        self._since: float | None = None
        self._path: Path2D | None = None

    def check(self) -> tuple[str, str] | None:
        """Compare the time since the last success with the period."""
        now, path = self.clock.now(), self.path_
        if self._since is None or path is not self._path:
            self._since, self._path = now, path
        if now - self._since < self.seconds:
            return "not_expired", "the path has just changed"
        self._since = now
        return None


class IsWithinPathTrackingBounds(SkillCondition):
    """Check whether the base deviates from its current path by no more than the given metres and radians."""

    REQUIRES = ("base", "lidar")
    INPUT_PORTS: ClassVar = without_meaning("tracking_feedback")
    max_error_left = In[float](NonNegative, "metres", default=0.5)
    max_error_right = In[float](NonNegative, "metres", default=0.5)
    max_error_heading = In[float](NonNegative, "radians", default=3.14)
    FAILS: ClassVar = {"off_path": "ComputePathToPose again"}

    def check(self) -> tuple[str, str] | None:
        """Compare the base pose with the path; true if no path is being driven."""
        path, pose = self.skills.base.path, self.skills.world.base.pose
        if path is None or len(path.points) < 2:
            return None
        steps = np.diff(path.points, axis=0)
        length = np.maximum(np.linalg.norm(steps, axis=1), 1e-9)
        along = np.clip(np.einsum("ij,ij->i", pose.xy - path.points[:-1], steps) / length**2, 0.0, 1.0)
        off = pose.xy - (path.points[:-1] + along[:, None] * steps)
        nearest = int(np.argmin(np.linalg.norm(off, axis=1)))
        (dx, dy), (ox, oy) = steps[nearest], off[nearest]
        left = float(dx * oy - dy * ox) / float(length[nearest])
        turn = abs(wrap_angle(pose.theta - math.atan2(dy, dx)))
        if -self.max_error_right <= left <= self.max_error_left and turn <= self.max_error_heading:
            return None
        return "off_path", f"{left:+.2f} m to the left of the path, {math.degrees(turn):.0f}° from its heading"


class IsPathValid(SkillCondition):
    """Check whether the rest of a path is free, according to the map and the lidar."""

    REQUIRES = ("base", "lidar")
    INPUT_PORTS: ClassVar = {
        **SERVICE,
        **without_meaning("max_cost", "consider_unknown_as_obstacle", "layer_name", "footprint"),
        **without_meaning("stop_at_first_collision"),
    }
    path_ = In(Path2D, "the path", required=False, port="path")
    max_lookahead_distance = In(float, "metres ahead to check; below 0: all", default=-1.0)
    collision_poses = Out(Goals, "first colliding pose, if any")
    FAILS: ClassVar = {**NO_PATH, "path_blocked": "ComputePathToPose again"}

    def check(self) -> tuple[str, str] | None:
        """Check the footprint along the remaining path on the costmap."""
        from bestman_bt.navigation.path_pieces import nearest_along, piece

        path = needed(self.path_)
        ahead = self.max_lookahead_distance
        if len(path.points) > 1:
            at = nearest_along(path, self.skills.world.base.pose.xy)
            path = piece(path, at, math.inf if ahead < 0.0 else at + ahead)
        contact = first_contact(path, self.skills.seen_costmap())
        self.collision_poses = Goals(() if contact is None else (contact,))
        if contact is None:
            return None
        return "path_blocked", f"the base would touch something at ({contact.x:.2f}, {contact.y:.2f}) m on the path"


class ValidatePath(IsPathValid):
    """IsPathValid as an action, its name in newer releases of Nav2."""

    KIND: ClassVar = "Action"


class IsGoalNearby(SkillCondition):
    """Check whether less than ``proximity_threshold`` metres of a path remain."""

    INPUT_PORTS: ClassVar = {**FRAMES}
    path_ = In(Path2D, "the path; none is not near", required=False, port="path")
    proximity_threshold = In[float](Positive, "metres", default=1.0)
    max_robot_pose_search_dist = In(
        float,
        "metres of path beyond the last place to search for the next one; below 0: all",
        default=-1.0,
    )
    FAILS: ClassVar = {
        "no_path": "ComputePathToPose first",
        "not_near": "drive on: FollowPath",
    }

    def on_load(self) -> None:
        """Reset the place on the path."""
        self._progress = PlaceOnPath()

    def check(self) -> tuple[str, str] | None:
        """Compare the length of the remaining path with the threshold."""
        path: Path2D | None = self.path_
        if path is None:
            return "no_path", "there is no path yet"
        left = path.length
        if len(path.points) > 1:
            window = self.max_robot_pose_search_dist
            left -= self._progress.find(path, self.skills.world.base.pose, math.inf if window < 0.0 else window)
        if left < self.proximity_threshold:
            return None
        return "not_near", f"{left:.1f} m are left to drive"


class PlaceOnPath:
    """The place of the base on a path; it continues from the last place if only part of the path is searched."""

    def __init__(self) -> None:
        self._path: Path2D | None = None
        self._at = 0.0

    def find(self, path: Path2D, pose: Pose2D, window: float) -> float:
        """Return the metres along ``path``, at most ``window`` beyond the last place."""
        from bestman_bt.navigation.path_pieces import nearest_along

        if path is not self._path or math.isinf(window):
            self._path, self._at = path, 0.0
        self._at = nearest_along(path, pose.xy, self._at, self._at + window)
        return self._at


def first_contact(path: Path2D, costmap: Costmap) -> Pose2D | None:
    """Return the first pose on a path at which the base would touch an obstacle of the costmap, or None.

    A base that starts within a margin may leave it: until the first free pose it only has to avoid approaching the
    obstacle.
    """
    from bestman_bt.navigation.local_planning.swept_path import SweptPath

    poses = SweptPath(path).ahead
    clearance = costmap.footprint_clearance(poses)
    leaving = np.logical_and.accumulate((clearance <= 0.0) & (np.diff(clearance, prepend=-np.inf) > -LEAVES))
    touching = np.flatnonzero((clearance <= 0.0) & ~leaving)
    if not len(touching):
        return None
    x, y, theta = poses[touching[0]].tolist()
    return Pose2D(x, y, theta)
