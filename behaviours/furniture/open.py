"""Opening doors and drawers: grasp the handle, follow it, release it, retreat."""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from behaviours.arm_motion import approach_object, move_free, unreached
from behaviours.contacts import handle, stopping_at
from behaviours.furniture.articulation import world_at_opening
from behaviours.furniture.articulation_measurement import articulation_from_motion
from behaviours.furniture.articulation_motion import (
    LEAF_FAILS,
    error_code,
    followed,
    retreat,
    retreat_after_failure,
    tare_wrist,
)
from behaviours.furniture.opening import HandlePull, Opening, plan_opening, plan_pull, pull_grasps
from behaviours.skill import (
    ALGORITHM_ERRORS,
    ArmNode,
    ArticulationName,
    Declaration,
    PostureName,
    Skill,
    SkillCoroutine,
    SkillFailure,
)
from bestman_bt.control.gripper import HELD_WIDTH
from bestman_bt.engine import In, Out
from bestman_bt.messages import Pose
from bestman_bt.messages.shapes import NonNegative, Positive
from bestman_bt.world_model.world_model import Obstacle


class Open(ArmNode, Skill):
    """Open a door or drawer by a detected handle, without moving the base; the hand releases the handle at the end.

    The hand is compliant and estimates hinge or rail while it moves. The opening is measured by the path of the hand.
    If halted while holding the handle, it opens the fingers; a stopped robot keeps its hand unchanged.
    """

    REQUIRES = ("arm", "gripper")
    USES = ("force_torque",)
    articulation = In[str](ArticulationName, "furniture/name of the map")
    handle = In(str, "a believed handle")
    opening = In[float](NonNegative, "target opening: metres for a drawer, radians for a door")
    force = In[float](Positive, "closing force, newtons", default=40.0)
    max_pull = In[float](Positive, "newtons", default=45.0)
    posture = In[str](PostureName, "final posture of the arm", default="carry")
    opened = Out(float, "reached opening, metres or radians")
    FAILS: ClassVar = {
        **LEAF_FAILS,
        "collision": "it touched something on the way in: LookAt, DetectHandle; if the robot is stopped: ClearStop",
        "grip_lost": "look where the handle is now: FindLookStand, DetectHandle, then Open",
        "out_of_reach": "Open again, from another stand: FindOpenStand, NavigateTo",
        "handle_not_found": "DetectHandle first",
        "no_grasp": "stand elsewhere: FindOpenStand, NavigateTo",
        "grasp_failed": "look again from near by: LookAt, DetectHandle",
        "not_open": "Open again, from another stand: FindOpenStand, NavigateTo",
    }
    DECLARATION = Declaration(pre=("handle_known({handle})", "not holding(any)"), effects=("open({articulation})",))

    def execute(self) -> SkillCoroutine[None]:
        """Plan, grasp, follow, release, withdraw."""
        skills = self.skills
        name: str = self.handle
        if skills.held is not None:
            raise SkillFailure("hand_not_empty", f"the hand holds the {skills.held.name}")
        belief = skills.world.handles.get(name)
        if belief is None:
            raise SkillFailure("handle_not_found", f"the handle {name} has not been seen; detect it first")
        opening = plan_opening(skills, self.articulation, belief, self.opening)
        plan: HandlePull | None = yield self.compute("grasp_planning", plan_pull, skills, opening, belief)
        if plan is None:
            raise unreached(
                skills,
                SkillFailure("no_grasp", f"no grasp of {name} is free and within reach from here"),
                (candidate.grasp for candidate in pull_grasps(skills, opening, belief)),
                world_at_opening(skills, opening.door, opening.start, "fingers"),
            )
        door, posture = opening.door, self.posture
        yield skills.gripper.open(plan.fingers)
        yield from move_free(self, [plan.into[0]], world_at_opening(skills, door, opening.start, "free"))
        yield from tare_wrist(self)
        with self.touching(handle(door.name, stopping_at(self.force + self.max_pull))):
            opened = yield from self._pull_open(opening, plan, posture)
        self.opened = opened
        self.feedback_message = f"{door.name} open by {opened:.2f}"

    def _pull_open(self, opening: Opening, plan: HandlePull, posture: str) -> SkillCoroutine[float]:
        """Grasp the handle, follow the articulation, release, retreat; return the opening reached."""
        skills, door = self.skills, opening.door
        contact = world_at_opening(skills, door, opening.start, "hand")
        yield from approach_object(self, plan.into, contact, monitored=opening.touching == "nothing")
        self._felt: Obstacle | None = None
        try:
            yield skills.gripper.close(self.force)
            self._check_held()
            opened = yield from self._pull(opening, plan)
        except GeneratorExit:
            skills.gripper.open()
            raise
        except (SkillFailure, *ALGORITHM_ERRORS) as failure:
            yield skills.gripper.open()
            yield from retreat_after_failure(self, door, posture, failure, self._felt)
            raise
        yield skills.gripper.open()
        yield from retreat(self, door, posture, self._felt)
        return opened

    def _check_held(self) -> None:
        gripper = self.skills.gripper
        if not gripper.pressing() or gripper.width() < self.skills.gripper_model.part.min_width + HELD_WIDTH.shut:
            width = 1e3 * gripper.width()
            raise SkillFailure("grasp_failed", f"the hand closed to {width:.0f} mm and does not hold the handle")

    def _held(self, plan: HandlePull, base_from_tool: Pose) -> NDArray[np.float64]:
        """Return the position (3,) of the grasped point in the map frame."""
        held: NDArray[np.float64] = (self.skills.map_from_base @ base_from_tool).apply(plan.guide.held_at[None])[0]
        return held

    def _pull(self, opening: Opening, plan: HandlePull) -> SkillCoroutine[float]:
        """Follow the handle, no further than planned, because the arm's path was not checked beyond; return the
        opening.

        A following that ends early also reports its opening.
        """
        from bestman_bt.control.arm.constraint_following import FollowGoal

        skills, door, share = self.skills, opening.door, plan.planned
        held_before = self._held(plan, skills.base_from_tool())
        following = skills.arm.follow_constraint(
            skills.map_from_base.inverse().rotation @ opening.handle.opening_direction,
            FollowGoal(
                distance=share * opening.distance if opening.angle is None else math.inf,
                angle=math.inf if opening.angle is None else share * opening.angle,
                max_pull=self.max_pull,
                guide=plan.guide,
                axis=opening.axis(skills.map_from_base.inverse()),
            ),
            grip=skills.gripper.watch_slip(HELD_WIDTH.slip_turning if opening.bar_turns else HELD_WIDTH.slip),
            hint=door.articulation.kind,
        )
        motion, failure = yield from followed(following)
        held_after = self._held(plan, motion.tool)
        self._felt = articulation_from_motion(opening, held_before, held_after, motion.angle, skills.clock.now())
        opened = opening.start + (motion.angle if opening.angle is not None else motion.distance)
        # Where the grip was lost, too: the door is left about there, and the base has to keep clear of it.
        skills.world.believe_articulation(door.name, max(0.0, min(opened, door.articulation.upper)))
        if opened < opening.asked:
            why = f"{door.name} is open by {opened:.2f} of {opening.asked:.2f} only"
            if failure is None and share < 1.0:
                raise SkillFailure("out_of_reach", f"{why}: the arm cannot open it any further from this base pose")
            code = error_code(motion.end, reached="not_open")
            raise SkillFailure(code, f"{why}: {failure}" if failure else why, failure.failure if failure else None)
        return opened
