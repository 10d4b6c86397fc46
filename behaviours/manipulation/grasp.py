"""Grasping: selection of reachable grasps, and execution."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from behaviours.arm_motion import (
    ARM_PLANNING_FAILS,
    approach_object,
    follow_path,
    hand_contacts,
    move_free,
    timed_path,
    unreached,
)
from behaviours.contacts import grasp as grasp_contact
from behaviours.contacts import stopping_at, support, surface_below
from behaviours.manipulation.grasp_candidates import APPROACH, GraspApproach, grasp_candidates
from behaviours.skill import (
    ALGORITHM_ERRORS,
    ArmName,
    ArmNode,
    Declaration,
    ObjectName,
    Skill,
    SkillCondition,
    SkillCoroutine,
    SkillFailure,
)
from bestman_bt.control.gripper import HELD_WIDTH
from bestman_bt.engine import In, InOut, Out
from bestman_bt.messages import GRAVITY, Pose
from bestman_bt.messages.shapes import Count, Positive
from bestman_bt.perception.view import View
from bestman_bt.world_model.world_model import HeldObject, ObjectBelief

if TYPE_CHECKING:
    from bestman_bt.manipulation.motion_planning.approach import Approach
    from bestman_bt.perception.grasp_pose.base import GraspCandidate


class CheckHeld(ArmNode, Skill):
    """Verify that the hand holds an object: by gripper width, and tactile pads and wrist camera, if any.

    A lost object is removed from the believed hand.
    """

    REQUIRES = ("arm", "gripper")
    USES = ("wrist_camera", "tactile")
    object = In[str](ObjectName, "the object that the hand should hold")
    look = In(bool, "also use the wrist camera", default=True)
    width = Out(float, "metres between the fingers")
    evidence = Out(str, "evidence used: width, touch, sight")
    FAILS: ClassVar = {
        "not_holding": "take it: DetectObject, PlanGrasp, Grasp",
        "object_lost": "find it again: ScanScene, DetectObject",
    }
    DECLARATION = Declaration(pre=("holding({object})",), effects=("holding({object})",))

    def execute(self) -> SkillCoroutine[None]:
        """Check each sensor in turn, the cheapest first."""
        skills = self.skills
        name: str = self.object
        held = skills.held
        if held is None or held.name != name:
            raise SkillFailure("not_holding", f"the hand does not hold the {name}")
        width = skills.gripper.width()
        self.width = width
        evidence = ["width"]
        problem = HELD_WIDTH.problem(width, held.width)
        if not problem and skills.tactile:
            evidence.append("touch")
            problem = self._touch_problem()
        if not problem and skills.wrist_camera is not None and self.look:
            evidence.append("sight")
            problem = yield self.compute("hand_check", self._sight_problem, width)
        self.evidence = ", ".join(evidence)
        if problem:
            skills.held = None
            raise SkillFailure("object_lost", f"the {name} is no longer in the hand: {problem}")
        self.feedback_message = f"{name} in hand, by {' and '.join(evidence)}"

    def _touch_problem(self) -> str:
        loose = [pad.name for pad in self.skills.tactile if not pad.pressed()]
        return f"nothing presses on {', '.join(loose)}" if loose else ""

    def _sight_problem(self, width: float) -> str:
        from bestman_bt.perception.held_object import observe_finger_gap

        skills = self.skills
        assert skills.wrist_camera is not None
        seen = skills.wrist_camera.capture()
        with_own_body = View(seen.image, seen.base_from_camera)
        gap = observe_finger_gap(with_own_body, skills.base_from_tool(), skills.gripper_model, width)
        is_empty = gap.empty > skills.parameters.grasp.empty_gap
        return f"the camera sees through {gap.empty:.0%} of the gap" if is_empty else ""


@dataclass(frozen=True, eq=False)
class PlannedGrasp:
    """A grasp that the arm reaches from the current base pose; ``map_from_object``: the object pose that it was planned
    for.

    ``tool_from_object``: with the hand as planned.
    """

    candidate: GraspCandidate
    approach: Approach
    map_from_object: Pose
    tool_from_object: Pose


class PlanGrasp(ArmNode, Skill):
    """Choose grasps of a located object that the arm reaches without a collision, best first."""

    REQUIRES = ("arm", "gripper")
    USES = ("wrist_camera",)
    object = In[str](ObjectName, "a located object")
    count = In[int](Count, "number of grasps to keep", default=4)
    approach = In[str](GraspApproach, APPROACH, default="")
    grasps = Out(list, "planned grasps, best first", required=True)
    FAILS: ClassVar = {
        "not_found": "DetectObject first",
        "no_grasp": "stand elsewhere: FindStandPose, NavigateTo; or look again: DetectObject",
    }
    DECLARATION = Declaration(pre=("located({object})",), effects=("grasps_known({object})",))

    def execute(self) -> SkillCoroutine[None]:
        """Propose, check and rank grasps."""
        name: str = self.object
        belief = self.skills.world.objects.get(name)
        if belief is None:
            raise SkillFailure("not_found", f"the {name} has not been seen; detect it first")
        approach: str = self.approach
        grasps = yield self.compute("grasp_planning", self._plan, belief, self.count, approach)
        if not grasps:
            raise unreached(
                self.skills,
                SkillFailure("no_grasp", f"no grasp of the {name} is free and within reach from here"),
                (candidate.pre_grasp for candidate in grasp_candidates(self.skills, belief, approach)),
            )
        self.grasps = grasps
        self.feedback_message = f"{len(grasps)} grasps"

    def _plan(self, belief: ObjectBelief, count: int, kind: str) -> list[PlannedGrasp]:
        from bestman_bt.manipulation.motion_planning.approach import ApproachPoses, approaches
        from bestman_bt.perception.grasp_pose.ranking import GraspRanking

        skills = self.skills
        scene = skills.planning_scene()
        free = skills.arm_world(scene)
        contact = skills.arm_world(scene.allowing(*hand_contacts(skills, belief.name)))
        reference = skills.arm_positions()
        base_from_object = skills.map_from_base.inverse() @ belief.pose
        planned: list[tuple[float, PlannedGrasp]] = []
        for ranked in GraspRanking().rank(grasp_candidates(skills, belief, kind), self._reachability):
            candidate = ranked.candidate
            for approach in approaches(
                skills.kinematics,
                ApproachPoses(candidate.pre_grasp, candidate.grasp, candidate.lift),
                reference,
                free,
                contact,
                skills.rng,
            ):
                tool_from_object = candidate.grasp.inverse() @ base_from_object
                grasp = PlannedGrasp(candidate, approach, belief.pose, tool_from_object)
                planned.append((approach.cost + 4.0 * (1.0 - ranked.score), grasp))
            if len(planned) >= 3 * count:
                break
        planned.sort(key=lambda costed: costed[0])
        return [grasp for _, grasp in planned[:count]]

    def _reachability(self, base_from_tool: Pose) -> float:
        """Return 1 if inverse kinematics has a solution, ignoring obstacles, else 0."""
        skills = self.skills
        found = skills.kinematics.solve(base_from_tool, skills.arm_positions(), skills.rng, attempts=5).found
        return 1.0 if found else 0.0


class Grasp(ArmNode, Skill):
    """Grasp an object with the first of the planned grasps, and lift it; the remaining grasps are written to the port.

    If the hand touches something on the way in, closes on nothing, or cannot lift the object, it opens, retreats, and
    drops all grasps, because the object may have moved.
    """

    REQUIRES = ("arm", "gripper")
    object = In[str](ObjectName, "the object")
    grasps = InOut(list, "planned grasps, best first; used up one by one")
    force = In[float | None](Positive, "closing force, newtons; by default from the weight", required=False)
    FAILS: ClassVar = {
        **ARM_PLANNING_FAILS,
        "no_path": "Grasp again: the next planned grasp",
        "collision": "it touched something on the way in: DetectObject, PlanGrasp; if the robot is stopped: ClearStop",
        "grasp_failed": "the object has moved: DetectObject, PlanGrasp",
        "no_grasp": "PlanGrasp from another stand: FindStandPose, NavigateTo",
    }
    DECLARATION = Declaration(pre=("grasps_known({object})", "not holding(any)"), effects=("holding({object})",))

    def on_load(self) -> None:
        """Reset the last failure."""
        self._last_failure: Exception | None = None

    def execute(self) -> SkillCoroutine[None]:
        """Open the hand, approach, close and lift."""
        name: str = self.object
        grasps: list[PlannedGrasp] = self.grasps
        if not grasps:
            raise self._last_failure or SkillFailure("no_grasp", f"no planned grasp of the {name} is left")
        try:
            yield from self._take(name, grasps)
        except (SkillFailure, *ALGORITHM_ERRORS) as failure:
            self._last_failure = failure
            raise
        self._last_failure = None

    def _take(self, name: str, grasps: list[PlannedGrasp]) -> SkillCoroutine[None]:
        skills = self.skills
        grasp, rest = grasps[0], grasps[1:]
        belief = skills.world.objects[name]
        self.grasps = rest
        skills.held = None
        yield skills.gripper.open(grasp.candidate.opening)
        yield from move_free(self, [grasp.approach.pre])
        stands_on = belief.surface or surface_below(skills.world, belief.pose)
        gripped = stopping_at(self.force or skills.gripper_model.part.max_force)
        with self.touching(grasp_contact(name, gripped), support(name, stands_on)):
            yield from self._close_and_lift(name, grasp)

    def _close_and_lift(self, name: str, grasp: PlannedGrasp) -> SkillCoroutine[None]:
        skills = self.skills
        contact = skills.arm_world(skills.planning_scene(allowed_pairs=hand_contacts(skills, name)))
        arm_motion = skills.parameters.arm_motion
        yield from approach_object(self, grasp.approach.into, contact, on_contact=self._drop_grasps)
        self._drop_grasps()
        yield skills.gripper.close(self.force or self._force(grasp))
        belief = skills.world.objects[name]
        width = grasp.candidate.width if belief.recognised else None
        try:
            self._check_held(width)
            held = HeldObject(name, belief.model, self._tool_from_object(grasp), skills.gripper.width())
            lift = yield from timed_path(self, grasp.approach.out, contact, arm_motion.retreat_speed)
        except (SkillFailure, *ALGORITHM_ERRORS):
            yield skills.gripper.open(grasp.candidate.opening)
            yield from follow_path(self, grasp.approach.into[::-1], contact, arm_motion.retreat_speed)
            raise
        try:
            yield skills.arm.follow(lift)
        except SkillFailure:
            if not HELD_WIDTH.problem(skills.gripper.width(), held.width):
                self._believe(held)  # stopped on its way up, with the object in the hand
            raise
        self._check_held(held.width if width is None else width)
        self._believe(replace(held, width=skills.gripper.width()))
        self.feedback_message = f"{name} in hand, {1e3 * skills.gripper.width():.0f} mm wide"

    def _drop_grasps(self) -> None:
        """Clear the planned grasps, because the object may have moved."""
        self.grasps = []

    def _believe(self, held: HeldObject) -> None:
        """Believe that the object is in the hand and that its former place is free."""
        from bestman_bt.perception.occupancy import freed

        world = self.skills.world
        belief = world.objects.pop(held.name)
        self.skills.observations.pop(held.name, None)
        self.skills.held = held
        if world.occupancy is not None:
            taken = [replace(part, pose=belief.pose @ part.pose) for part in belief.model.collision]
            world.occupancy = freed(world.occupancy, taken)

    def _check_held(self, expected: float | None) -> None:
        """Check that the hand holds the object. ``expected``: metres between the fingers, or None if the object's far
        side is unknown.
        """
        width = self.skills.gripper.width()
        if expected is not None:
            problem = HELD_WIDTH.problem(width, expected)
        else:
            closed = width < self.skills.gripper_model.part.min_width + HELD_WIDTH.shut
            problem = f"it closed to {1e3 * width:.0f} mm" if closed else ""
        if not problem and not self.skills.gripper.pressing():
            problem = "the fingers do not press"
        if problem:
            raise SkillFailure("grasp_failed", f"the hand closed but does not hold the {self.object}: {problem}")

    def _force(self, grasp: PlannedGrasp) -> float:
        """Return the grip force, newtons, for the weight and its moment about the pads."""
        gripper = self.skills.gripper
        mass = self.skills.world.objects[self.object].model.mass
        lever = float(np.linalg.norm(grasp.tool_from_object.position[:2]))
        parameters = self.skills.parameters.grasp
        needed = parameters.torque_safety * mass * GRAVITY * lever / (self.skills.gripper_model.part.pad_size[1] / 2)
        return min(max(parameters.least_force, needed), gripper.model.part.max_force)

    def _tool_from_object(self, grasp: PlannedGrasp) -> Pose:
        """Return the observed pose, with the contacts centred between the fingers, which have moved the object."""
        skills = self.skills
        base_from_object = skills.map_from_base.inverse() @ grasp.map_from_object
        tool_from_object = skills.base_from_tool().inverse() @ base_from_object
        x, _, z = tool_from_object.position
        return Pose(np.array([x, grasp.tool_from_object.position[1], z]), tool_from_object.quaternion)


class Holding(SkillCondition):
    """Check by encoders whether a hand holds an object; a lost object is removed from the belief."""

    REQUIRES = ("gripper",)
    object = In[str](ObjectName, "the object")
    arm = In[str](ArmName, "the arm whose hand should hold it; by default any", default="")
    FAILS: ClassVar = {
        "not_holding": "take it: DetectObject, PlanGrasp, Grasp",
        "object_lost": "find it again: ScanScene, DetectObject",
    }

    def check(self) -> tuple[str, str] | None:
        """Check that the gripper's width is still that of the grasp."""
        name: str = self.object
        arm = self.arm or self.skills.world.arm_with(name)
        skills = self.skills if arm is None else self.skills_of(arm)
        held = skills.held
        if held is None or held.name != name:
            return "not_holding", f"the hand does not hold the {name}"
        problem = HELD_WIDTH.problem(skills.gripper.width(), held.width)
        if problem:
            skills.held = None
            return "object_lost", f"the {name} is no longer in the hand: {problem}"
        return None


class Reachable(ArmNode, SkillCondition):
    """Check whether the arm reaches a grasp of a seen object from the current base; collisions are ignored."""

    REQUIRES = ("arm", "gripper")
    USES = ("wrist_camera",)
    object = In[str](ObjectName, "a seen object")
    FAILS: ClassVar = {
        "not_found": "DetectObject first",
        "out_of_reach": "stand elsewhere: FindStandPose, NavigateTo",
    }

    def check(self) -> tuple[str, str] | None:
        """Solve inverse kinematics for some of the candidates."""
        skills = self.skills
        name: str = self.object
        belief = skills.world.objects.get(name)
        if belief is None:
            return "not_found", f"the {name} has not been seen"
        reference = skills.arm_positions()
        candidates = grasp_candidates(skills, belief)
        for candidate in candidates[:12]:
            if skills.kinematics.solve(candidate.grasp, reference, skills.rng, attempts=5).found:
                return None
        distance = float(np.linalg.norm((skills.map_from_base.inverse() @ belief.pose).position[:2]))
        return "out_of_reach", f"the {name} is out of reach, {distance:.2f} m from the base"
