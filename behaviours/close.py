"""Closing doors and drawers: push at the front with closed fingers until the end stop is felt."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from behaviours.arm_motion import ARM_PLANNING_FAILS, move_free
from behaviours.closing import BEFORE, Push, pushes
from behaviours.contacts import handle
from behaviours.following import FOLLOWING_FAILS, error_code, followed
from behaviours.leaf import UNKNOWN_ARTICULATION, Leaf, find_leaf, free_along, world_at_leaf
from behaviours.names import ArticulationName, PostureName
from behaviours.skill import ALGORITHM_ERRORS, Declaration, OnArm, Skill, SkillFailure, Steps, StepsTo
from behaviours.taring import tare_wrist
from behaviours.withdraw import withdraw, withdraw_after
from bestman_bt.engine import In, Out
from bestman_bt.messages import Pose

if TYPE_CHECKING:
    from bestman_bt.control.arm import FollowGuide, GuardedOutcome
    from bestman_bt.manipulation.motion_planning import Approach

FINGER_FORCE = 10.0
"""Newtons with which the fingers are held together."""
TOUCH = 8.0
"""Newtons at which the front counts as touched: less than any door or drawer takes to move."""
SEARCH = 0.08
"""Metres beyond where the front is believed to be in which it is looked for."""
BEYOND = 0.06
"""Metres beyond closed, by the map, until which resistance is waited for."""
FELT = 0.02
"""Metres by which the finger tips may be off, beside the piece's own error, when the end stop is felt."""


@dataclass(frozen=True, eq=False)
class _Plan:
    push: Push
    approach: Approach
    guide: FollowGuide
    score: float


class Close(OnArm, Skill):
    """Push a door or drawer shut from where the base stands, with closed fingers at its front.

    It starts from where the leaf is believed to be, feels for the front, goes along with the map's joint, and ends when
    something resists. Near closed that is the end stop; before, it is a jam, which is told with how far it is open.
    """

    REQUIRES = ("arm", "gripper")
    USES = ("force_torque",)
    articulation = In[str](ArticulationName, "furniture/leaf of the map")
    opening = In(float, "how far it may stay open: metres or radians", default=0.02)
    max_push = In(float, "newtons", default=40.0)
    posture = In[str](PostureName, "of the arm at the end", default="carry")
    left = Out(float, "how far it may still be open, metres or radians")
    FAILS: ClassVar = {
        **UNKNOWN_ARTICULATION,
        **ARM_PLANNING_FAILS,
        **FOLLOWING_FAILS,
        "hand_not_empty": "put down what is held: FindPlacePose, PlaceOn, Release",
        "no_push": "stand elsewhere: FindCloseStand, NavigateTo",
        "not_found": "it is open less, or farther, than believed: FindLookStand, DetectHandle",
        "jammed": "push from elsewhere: FindCloseStand, NavigateTo; or pull what jams out again: Open",
        "lost_contact": "it is not where it is believed to be: FindLookStand, DetectHandle, then Close",
        "not_withdrawn": "Retreat",
    }
    DECLARATION = Declaration(pre=("not holding(any)",), effects=("not open({articulation})",))

    def execute(self) -> Steps:
        """Plan, close the fingers, touch, push, withdraw."""
        skills = self.skills
        if skills.held is not None:
            raise SkillFailure("hand_not_empty", f"the hand holds the {skills.held.name}")
        leaf, posture = find_leaf(skills, self.articulation), self.posture
        leaf.check_opening("opening", self.opening)
        plan: _Plan | None = yield self.compute("grasp_planning", self._plan, leaf)
        if plan is None:
            raise SkillFailure("no_push", f"the arm cannot push {leaf.articulation} shut from here")
        yield skills.gripper.close(FINGER_FORCE)
        yield from move_free(self, [plan.approach.pre], world_at_leaf(skills, leaf, plan.push.start, "free"))
        yield from tare_wrist(self)
        with self.touching(handle(leaf.articulation)):
            try:
                start = yield from self._touch(plan.push)
                left = yield from self._push(plan, start)
            except (SkillFailure, *ALGORITHM_ERRORS) as failure:
                yield from withdraw_after(self, leaf, posture, failure)
                raise
            yield from withdraw(self, leaf, posture)
        self.left = left
        self.feedback_message = f"{leaf.articulation} closed, to {left:.3f} by the map"

    def _plan(self, leaf: Leaf) -> _Plan | None:
        from bestman_bt.manipulation.kinematics import ArcSearch
        from bestman_bt.manipulation.motion_planning import approaches

        skills = self.skills
        kinematics, base_from_map = skills.kinematics, skills.map_from_base.inverse()
        plans: list[_Plan] = []
        for push in pushes(skills, leaf):
            positions = push.positions()
            free = world_at_leaf(skills, leaf, push.start, "free")
            contact = world_at_leaf(skills, leaf, push.start, "fingers")
            way = [[base_from_map @ pose for pose in poses] for poses in push.stations()]
            for option, before in enumerate(push.stations(BEFORE)[0]):
                for approach in approaches(
                    kinematics,
                    base_from_map @ before,
                    way[0][option],
                    way[0][option],
                    skills.arm_positions(),
                    free,
                    contact,
                    skills.rng,
                ):
                    is_free = free_along(skills, leaf, positions, "fingers")
                    arc = ArcSearch().path_through(
                        kinematics, way, 0, option, approach.into[-1], skills.arm_model, is_free
                    )
                    if arc.complete:
                        score = arc.margin - 0.2 * abs(push.tilts[option])
                        plans.append(_Plan(push, approach, push.guide(arc), score))
            if plans:
                return max(plans, key=lambda plan: plan.score)
        return None

    def _tip(self, push: Push, base_from_tool: Pose) -> Pose:
        return self.skills.map_from_base @ base_from_tool @ Pose(np.array([0.0, 0.0, push.tip]))

    def _touch(self, push: Push) -> StepsTo[float]:
        """Go on straight until the front is felt; how far the leaf is open there."""
        skills = self.skills
        tool = skills.base_from_tool()
        touch: GuardedOutcome = yield skills.arm.move_until(tool.rotation[:, 2], 0.05, BEFORE + SEARCH, TOUCH)
        position = push.opening(self._tip(push, touch.tool).position)
        if not touch.touched:
            why = f"the front of {push.leaf.articulation} is not where it is believed to be, open by {push.start:.2f}"
            raise SkillFailure("not_found", f"{why}: nothing is there up to {position:.2f}")
        return position

    def _push(self, plan: _Plan, start: float) -> StepsTo[float]:
        """Push until something resists; how far it may be open then."""
        from bestman_bt.control.arm import FollowEnd

        skills, push, leaf = self.skills, plan.push, plan.push.leaf
        base_from_map = skills.map_from_base.inverse()
        axis, base = push.axis(), base_from_map.rotation
        tip = self._tip(push, skills.base_from_tool()).position
        beyond = max(0.0, start) + BEYOND / push.lever
        following = skills.arm.follow_constraint(
            base @ axis.tangent(tip),
            distance=beyond if axis.kind == "prismatic" else math.inf,
            angle=beyond if axis.kind == "revolute" else math.inf,
            max_pull=self.max_push,
            guide=plan.guide,
            axis=replace(axis, point=base_from_map.apply(axis.point[None])[0], direction=base @ axis.direction),
            learns=False,
        )
        motion, failure = yield from followed(following)
        left = max(0.0, push.opening(self._tip(push, motion.tool).position))
        resisted = motion.end in (FollowEnd.JAMMED, FollowEnd.LOCKED)
        if resisted and left <= self._uncertainty(push):
            skills.world.believe_articulation(leaf.articulation, 0.0)
            return left
        if failure is None:
            raise SkillFailure("lost_contact", f"nothing resisted up to where {leaf.articulation} should be shut")
        skills.world.believe_articulation(leaf.articulation, min(left, leaf.leaf.upper))
        if left > self.opening:
            self.left = left
            code = "jammed" if resisted else error_code(motion.end)
            raise SkillFailure(code, f"{leaf.articulation} is still open by {left:.2f}: {failure}", failure.failure)
        return left

    def _uncertainty(self, push: Push) -> float:
        """How far from shut, by the map, the end stop may be felt, metres or radians."""
        piece = push.leaf.furniture
        turned = piece.heading_error * (1.0 if push.leaf.leaf.kind == "revolute" else 0.0)
        return (FELT + 1.5 * piece.position_error) / push.lever + turned
