"""Checking what the hand holds: by its width, by touch, by sight."""

from __future__ import annotations

from typing import ClassVar

from behaviours.names import ObjectName
from behaviours.skill import Declaration, OnArm, Skill, SkillFailure, Steps
from bestman_bt.control.gripper import HELD_WIDTH
from bestman_bt.engine import In, Out
from bestman_bt.perception import View

EMPTY = 0.6
"""Share of the gap between the fingers that the camera must look through for the hand to be empty."""


class CheckHeld(OnArm, Skill):
    """Make sure that the hand holds an object: gripper width, tactile pads and wrist camera, where there are any.

    An object that has been lost is no longer believed to be in the hand.
    """

    REQUIRES = ("arm", "gripper")
    USES = ("wrist_camera", "tactile")
    object = In[str](ObjectName, "the object that the hand should hold")
    look = In(bool, "also use the wrist camera", default=True)
    width = Out(float, "metres between the fingers")
    evidence = Out(str, "what was asked: width, touch, sight")
    FAILS: ClassVar = {
        "not_holding": "take it: DetectObject, PlanGrasp, Grasp",
        "object_lost": "find it again: ScanScene, DetectObject",
    }
    DECLARATION = Declaration(pre=("holding({object})",), effects=("holding({object})",))

    def execute(self) -> Steps:
        """Ask each sensor in turn, the cheapest first."""
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
        from bestman_bt.perception.held_object import look_between_fingers

        skills = self.skills
        assert skills.wrist_camera is not None
        seen = skills.wrist_camera.capture()
        with_own_body = View(seen.image, seen.base_from_camera)
        gap = look_between_fingers(with_own_body, skills.base_from_tool(), skills.gripper_model, width)
        return f"the camera looks through {gap.empty:.0%} of the gap" if gap.empty > EMPTY else ""
