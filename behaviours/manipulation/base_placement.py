"""Base placement: base poses from which the arm reaches an object or a place."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from numpy.typing import NDArray

from behaviours.arm_motion import unreached
from behaviours.context import DRIVEN
from behaviours.manipulation.grasp_candidates import APPROACH, GraspApproach, grasp_candidates
from behaviours.manipulation.place import place_tool_poses
from behaviours.perception.surfaces import UNKNOWN_SURFACE, find_surface, with_open_drawers
from behaviours.skill import ArmNode, Declaration, ObjectName, Skill, SkillCoroutine, SkillFailure, SurfaceName
from bestman_bt.engine import In, Out
from bestman_bt.messages import Failure, MotionObstacle, MotionStage, Pose, Pose2D
from bestman_bt.world_model.semantic_map import MapFurniture, MapSurface
from bestman_bt.world_model.world_model import BasePose

if TYPE_CHECKING:
    from bestman_bt.manipulation.base_placement import BasePlacement, PathPlacement
    from bestman_bt.manipulation.collision.base import CollisionWorld


SAME_STAND = 0.05
"""Distance below which two base placements count as the same, metres."""
SAME_TARGET = 0.05
PRE_REACH = 0.1
"""Length of the straight approach of the hand into furniture, metres."""
PART = 0.25
"""Distance from the middle of a surface to the middle of a quarter, as a fraction of its size."""
HAND_ABOVE = 0.08
"""Working height of the hand above a surface for an object that has not been seen yet, metres."""


@dataclass(frozen=True, eq=False)
class StandTarget:
    """A target of a base placement. ``tool_poses``: in the map frame, each a sequence that must be reached completely.
    ``at``: (2,) metres, the target.
    """

    tool_poses: Sequence[Sequence[Pose]]
    at: NDArray[np.float64]


class FindBasePlacement(ArmNode, Skill, ABC):
    """Base class of skills that choose a base placement for the arm; each call returns another one."""

    REQUIRES: ClassVar[tuple[str, ...]] = ("base", "lidar", "arm", "gripper")
    stand = Out(Pose2D, "where to stand, in the map frame", required=True)

    def on_load(self) -> None:
        """Reset the tried placements."""
        self._tried: list[Pose2D] = []

    def execute(self) -> SkillCoroutine[None]:
        """Return the best placement that has not been returned yet."""
        best: Pose2D = (yield from self._ranked())[0].pose
        self._tried.append(best)
        self.stand = best
        self.feedback_message = f"stand at {best.x:.2f}, {best.y:.2f}, {np.degrees(best.theta):.0f}°"

    @abstractmethod
    def _ranked(self) -> SkillCoroutine[Sequence[BasePlacement | PathPlacement]]:
        """Return the placements that are new, best first. Raises SkillFailure (``no_stand``) if none is left."""

    def _is_new(self, stand: Pose2D) -> bool:
        return all(stand.distance_to(tried) > SAME_STAND for tried in self._tried)


class FindStandAtFurniture(FindBasePlacement):
    """Base class of skills that place the base at the furniture of a surface; subclasses define the poses to reach."""

    surface = In[str](SurfaceName, "the surface to stand at, such as table")
    object = In[str | None](ObjectName, "the object to reach, if it has been seen", required=False)
    goal = In(Pose, "the place to reach, in the map frame", required=False)
    FAILS: ClassVar = {
        **UNKNOWN_SURFACE,
        "no_stand": "the obstacle may have gone: ForgetBlocked, then retry",
    }
    DECLARATION = Declaration(effects=("stand_known({surface})",))

    @abstractmethod
    def _targets(self) -> list[StandTarget]:
        """Return the targets that would suffice, the best first."""

    def on_load(self) -> None:
        """Reset the tried placements and their target."""
        super().on_load()
        self._target = np.full(2, np.inf)

    def _ranked(self) -> SkillCoroutine[Sequence[BasePlacement]]:
        """Return the best placement along the furniture by the arm's reach; those tried before only once all have been
        tried.
        """
        furniture, _ = find_surface(self.skills, self.surface)
        targets = self._targets()
        if np.linalg.norm(targets[0].at - self._target) > SAME_TARGET:
            self._target, self._tried = targets[0].at, []
        stands = yield from self._first_reached(furniture, targets)
        if not stands and self._tried:
            self._tried = []
            stands = yield from self._first_reached(furniture, targets)
        if not stands:
            raise self._why_none(furniture, targets[0])
        return stands

    def _first_reached(
        self, furniture: MapFurniture, targets: Sequence[StandTarget]
    ) -> SkillCoroutine[tuple[BasePlacement, ...]]:
        """Return placements, best first, from which a target is reached: those of the first reachable target."""
        for target in targets:
            stands: tuple[BasePlacement, ...] = yield self.compute("stand_planning", self._rank, furniture, target)
            if stands:
                self._reached = target
                return stands
        return ()

    def _rank(self, furniture: MapFurniture, target: StandTarget) -> tuple[BasePlacement, ...]:
        skills = self.skills
        costmap = skills.seen_costmap(DRIVEN)
        return skills.base_placement.rank(
            self._beside(furniture, target),
            target.tool_poses,
            skills.reaching_arm(),
            is_base_free=lambda pose: costmap.clearance_at(pose) > 0.0,
            world_at=self._world_at,
            current=skills.world.base.pose,
        )

    def _beside(self, furniture: MapFurniture, target: StandTarget) -> list[Pose2D]:
        """Return placements at the furniture that have not been tried, free or not."""
        front = float(np.array(self.skills.base.model.footprint)[:, 0].max())
        beside = self.skills.base_placement.beside(with_open_drawers(self.skills, furniture), target.at, front)
        return [stand for stand in beside if self._is_new(stand)]

    def _why_none(self, furniture: MapFurniture, target: StandTarget) -> SkillFailure:
        """Return the failure: no room for the base, or the obstacle of the arm at the placement nearest to the
        target.
        """
        skills, costmap = self.skills, self.skills.seen_costmap(DRIVEN)
        text = f"no free base placement at the {furniture.name} lets the arm reach its target"
        free = [stand for stand in self._beside(furniture, target) if costmap.clearance_at(stand) > 0.0]
        if not free:
            at = MotionObstacle(MotionStage.STAND, (("base", furniture.name),))
            words = f"{text}: the base finds no room there"
            return SkillFailure("no_stand", words, Failure("no_stand", words, obstacle=at))
        nearest = min(free, key=lambda stand: float(np.hypot(stand.x - target.at[0], stand.y - target.at[1])))
        base_from_map = nearest.to_pose().inverse()
        poses = (base_from_map @ poses[-1] for poses in target.tool_poses)
        return unreached(skills, SkillFailure("no_stand", text), poses, self._world_at(nearest), MotionStage.STAND)

    def _world_at(self, stand: Pose2D) -> CollisionWorld:
        """Return the arm's collision world there, without what ``_ignored`` names."""
        from bestman_bt.manipulation.collision.scene_from_world_model import planning_scene_from_world_model

        skills = self.skills
        others = {arm: held for arm, held in skills.world.hands.items() if arm != skills.arm_name}
        there = replace(skills.world, base=BasePose(stand, 0.0, 0.0, skills.clock.now()), hands=others)
        scene = planning_scene_from_world_model(
            there, skills.robot, skills.joints.positions(), skills.arm.name, ignore=self._ignored()
        )
        return skills.arm_world(scene)

    def _ignored(self) -> list[str]:
        """Return the names that do not count as obstacles: the target, and at a goal the objects on the surface, which
        the skill that looks at the place takes into account.
        """
        world, name = self.skills.world, self.object or ""
        if self.goal is None and name in world.objects:
            return [name]
        return [name, *world.objects, *(n for n in world.obstacles if not n.endswith("/surface"))]


class FindStandPose(FindStandAtFurniture):
    """Choose a base placement to reach an object (where it was seen), a goal on a surface, or the surface itself.

    The middle of a surface is preferred; if it is out of reach, another part is used. Each further call for the same
    target gives another placement, until none is left.
    """

    USES = ("wrist_camera",)
    approach = In[str](GraspApproach, APPROACH, default="")

    def _targets(self) -> list[StandTarget]:
        skills = self.skills
        goal: Pose | None = self.goal
        name: str = self.object or ""
        belief = skills.world.objects.get(name)
        if goal is not None and skills.held is not None:
            on_surface = Pose(np.array([*goal.position[:2], self._object_height()]), goal.quaternion)
            place = skills.parameters.place
            poses = place_tool_poses(skills.held, on_surface, place.descent, place.drop_height)
            return [StandTarget(poses, goal.position[:2])]
        if belief is not None:
            candidates = grasp_candidates(self.skills, belief, self.approach)[:8]
            map_from_base = skills.map_from_base
            grasps = [(map_from_base @ c.pre_grasp, map_from_base @ c.grasp) for c in candidates]
            return [StandTarget(grasps, belief.pose.position[:2])]
        furniture, surface = find_surface(skills, self.surface)
        height = self._middle()[2] + HAND_ABOVE
        points = goal.position[None, :2] if goal is not None else self._parts(furniture, surface)
        within = furniture.is_inside(surface) and surface.drawer is None
        hands = partial(_from_front, heading=furniture.pose.theta) if within else _top_down
        return [StandTarget(hands(np.array([*point, height])), point) for point in points]

    def _parts(self, furniture: MapFurniture, surface: MapSurface) -> NDArray[np.float64]:
        """Return points (N, 2) of a surface in the map frame: the middle first, then others nearer to its front."""
        shares = np.array([(0.0, 0.0), *((-PART, share * PART) for share in (0.0, 1.0, -1.0))])
        points = np.column_stack([shares * np.array(surface.size), np.zeros(len(shares))])
        in_map: NDArray[np.float64] = (furniture.pose.to_pose() @ surface.pose).apply(points)[:, :2]
        return in_map

    def _middle(self) -> NDArray[np.float64]:
        furniture, surface = find_surface(self.skills, self.surface)
        return (furniture.pose.to_pose() @ surface.pose).position

    def _object_height(self) -> float:
        held = self.skills.held
        assert held is not None
        return float(self._middle()[2] - held.model.bounds()[0, 2])


def _top_down(position: NDArray[np.float64]) -> list[tuple[Pose, ...]]:
    """Return tool poses that point straight down, at six turns of the hand."""
    return [(Pose.from_xyz_rpy(position, (np.pi, 0.0, turn)),) for turn in np.arange(6) * np.pi / 3]


def _from_front(position: NDArray[np.float64], heading: float) -> list[tuple[Pose, ...]]:
    """Return level tool poses in the direction ``heading``, before the place and at it, at four turns of the hand."""
    level = Pose.from_xyz_rpy(position, (0.0, np.pi / 2, heading))
    turned = [level @ Pose.from_xyz_rpy((0.0, 0.0, 0.0), (0.0, 0.0, turn)) for turn in np.arange(4) * np.pi / 2]
    return [(pose @ Pose(np.array([0.0, 0.0, -PRE_REACH])), pose) for pose in turned]
