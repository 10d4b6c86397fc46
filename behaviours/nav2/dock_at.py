"""DockAt, and Nav2's DockRobot and UndockRobot: the final approach to a pose, to a centimetre and a degree."""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from behaviours.nav2.ports import SERVER, Nav2Errors, without_meaning
from behaviours.navigation.navigate import DRIVING_FAILS
from behaviours.skill import Declaration, FurnitureName, Skill, SkillCoroutine, SkillFailure
from bestman_bt.engine import In, Out
from bestman_bt.messages import Path2D, Pose2D, wrap_angle
from bestman_bt.messages.shapes import Count, Positive
from bestman_bt.world_model.semantic_map import MapFurniture

STAGED, STAGED_HEADING = 0.05, math.radians(5.0)
"""Metres and radians from the staging pose within which the base need not drive there first."""
ATTEMPTS, UNDOCKING = 3, 0.5
"""Number of approaches, and distance of driving back in metres, of Nav2's docking leaves."""
LOOKS, LOOK_PERIOD = 5, 0.1
"""Number of scans of a front at rest, and the seconds between them; their noise is independent."""


class _Docking(Skill):
    """The approach, to the pose that the caller gives."""

    REQUIRES = ("base", "lidar")
    approach = In[float](Positive, "metres, driven straight", default=0.5)
    tolerance = In[float](Positive, "metres", default=0.006)
    heading_tolerance = In[float](Positive, "radians", default=math.radians(0.6))
    FAILS: ClassVar = {
        **DRIVING_FAILS,
        "not_docked": "BackUp, then DockAt again",
        "not_found": "DockAt without furniture",
    }

    def dock(self, pose: Pose2D, piece: MapFurniture | None, attempts: int) -> SkillCoroutine[tuple[Pose2D, int]]:
        """Dock; return the pose, by where ``piece`` was seen, and the number of approaches."""
        from bestman_bt.navigation.local_planning.pure_pursuit import PurePursuit

        # Slow, with a near steering point, which reduces lateral errors on the way.
        docking = PurePursuit(min_lookahead=0.12, max_lookahead=0.2, max_speed=0.2, position_tolerance=0.002)
        skills, goal = self.skills, pose
        why = ""
        for attempt in range(1, attempts + 1):
            yield from self._stage(goal @ Pose2D(-self.approach, 0.0, 0.0))
            if piece is not None:
                goal = yield from self._seen(piece, pose)
            begin = skills.world.base.pose
            axis = goal @ Pose2D(-self.approach / 2, 0.0, 0.0)
            path = Path2D(np.array([begin.xy, axis.xy, goal.xy]), goal)
            try:
                yield skills.base.follow(path, None, docking)
            except SkillFailure as failure:
                if failure.code != "tolerance":
                    raise
            why = yield from self._improve(goal)
            if not why:
                return goal, attempt
        raise SkillFailure("not_docked", f"after {attempts} approaches the base is {why}")

    def _stage(self, staging: Pose2D) -> SkillCoroutine[None]:
        """Drive to the staging pose, by the shortest way if the base stands before it."""
        from bestman_bt.navigation.global_planning.base import PlanningFailure

        skills, pose = self.skills, self.skills.world.base.pose
        back = staging.inverse() @ pose
        if abs(back.y) < STAGED and abs(wrap_angle(back.theta)) < STAGED_HEADING and back.x > STAGED:
            yield skills.base.drive(-back.x)
        elif math.hypot(back.x, back.y) > STAGED or abs(wrap_angle(back.theta)) > STAGED_HEADING:
            planner = skills.global_planning
            path = yield self.compute("global_planning", planner.plan, pose, staging, skills.seen_costmap())
            if isinstance(path, PlanningFailure):
                raise SkillFailure(path.reason.value, path.text)
            yield skills.base.follow(path, skills.known_costmap())

    def _seen(self, piece: MapFurniture, goal: Pose2D) -> SkillCoroutine[Pose2D]:
        """Return the goal, by where the front of ``piece`` is seen."""
        from bestman_bt.navigation.localization.front_edge import front_edge

        skills = self.skills
        hits: list[NDArray[np.float64]] = []
        for _ in range(LOOKS):
            yield skills.computation.submit(lambda: None, LOOK_PERIOD)
            map_from_lidar = skills.world.base.pose @ skills.base.lidar.base_from_lidar
            hits.append(map_from_lidar.apply(skills.base.scan().scan.points()))
        edge = front_edge(piece, np.vstack(hits))
        if edge is None:
            raise SkillFailure("not_found", f"too little is seen of the front of {piece.name}")
        return edge.corrected(piece, goal)

    def _improve(self, goal: Pose2D) -> SkillCoroutine[str]:
        """Correct the remaining error; return a text with the remaining deviation, empty if within tolerance."""
        base, tolerance, turning = self.skills.base, self.tolerance, self.heading_tolerance
        for last in (False, True):
            off = goal.inverse() @ self.skills.world.base.pose
            turn = abs(wrap_angle(off.theta))
            if math.hypot(off.x, off.y) <= tolerance and turn <= turning:
                return ""
            if last or abs(off.y) > tolerance:
                break
            if abs(off.x) > tolerance / 2:
                yield base.drive(-off.x)
            if turn > turning:
                yield base.rotate_to(goal.theta)
        return f"{1e3 * math.hypot(off.x, off.y):.0f} mm and {math.degrees(turn):.1f}° from its goal"


class DockAt(_Docking):
    """Drive to a pose as exactly as the base can: slowly, from a pose straight behind it, and again if necessary.

    The pose is in the map. If ``furniture`` names a piece that the lidar sees, the pose is corrected by the observed
    front of that piece: distance and angle to the front are then exact, whereas the position along the front comes from
    the map.
    """

    goal = In(Pose2D, "x;y;theta in the map frame, metres and radians")
    furniture = In[str](FurnitureName, "the furniture to dock at", default="")
    attempts = In[int](Count, "approaches at most", default=3)
    docked = Out(Pose2D, "the goal, corrected by the observed furniture")
    DECLARATION = Declaration(effects=("at({goal})",))

    def execute(self) -> SkillCoroutine[None]:
        """Move behind the goal, look, approach, check."""
        self.docked, _ = yield from self.dock(self.goal, self._piece(), self.attempts)

    def _piece(self) -> MapFurniture | None:
        name, known = self.furniture, self.skills.world.map.furniture
        if not name:
            return None
        if name not in known or not known[name].solid_at_lidar:
            seen = ", ".join(sorted(n for n, piece in known.items() if piece.solid_at_lidar)) or "none"
            raise SkillFailure("bad_input", f"furniture is {name!r}; a lidar sees the front of {seen}")
        return known[name]


class DockRobot(Nav2Errors, _Docking):
    """Dock at ``dock_pose``, the pose of the docked base; named docks are not supported."""

    INPUT_PORTS: ClassVar = {
        **SERVER, **without_meaning("dock_id", "dock_type", "max_staging_time", "navigate_to_staging_pose"),
    }  # fmt: skip
    use_dock_id = In(bool, "true is refused: named docks are not supported", default=True)
    dock_pose = In(Pose2D, "x;y;theta in the map frame, metres and radians", required=False)
    success = Out(bool, "whether the base is docked")
    num_retries = Out(int, "approaches beyond the first")
    FAILS: ClassVar = {"no_docks": 'use_dock_id="false" and a dock_pose'}

    def execute(self) -> SkillCoroutine[None]:
        """Dock as DockAt does."""
        self.success = False
        if self.use_dock_id or self.dock_pose is None:
            raise SkillFailure("no_docks", "named docks are not supported: give a dock_pose")
        _, attempts = yield from self.dock(self.dock_pose, None, ATTEMPTS)
        self.num_retries = attempts - 1
        self.success = True


class UndockRobot(Nav2Errors, Skill):
    """Drive straight back by half a metre, away from a dock."""

    REQUIRES = ("base", "lidar")
    INPUT_PORTS: ClassVar = {**SERVER, **without_meaning("dock_type", "max_undocking_time")}
    success = Out(bool, "whether it is undocked")
    FAILS: ClassVar = DRIVING_FAILS

    def execute(self) -> SkillCoroutine[None]:
        """Drive back from the dock."""
        self.success = False
        yield self.skills.base.drive(-UNDOCKING)
        self.success = True
