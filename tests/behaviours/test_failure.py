"""What a driver tells of a failure reaches the result of the run unchanged."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from behaviours.skill import Skill, SkillCoroutine
from bestman_bt.control.gripper import GripperController
from bestman_bt.control.motion import start_motion
from bestman_bt.engine import FAILURE
from bestman_bt.evaluation.result import Outcome, RunResult
from bestman_bt.messages import Failure, MotionErrorCode
from bestman_bt.robot_model.model import GripperModel
from hal.api import Motion, MotionStatus, NotConnectedError
from hal.parts.channels import GripperReading
from hal.parts.gripper import CommandedGripper
from hal.parts.stop_latch import StopLatch
from tests.behaviours.scripted import load, register, run, scripted_skills

STRUCK = Failure(MotionErrorCode.COLLISION, "the current is too high", "arm", "C31")


class MoveStruckArm(Skill):
    """Commands a motion that the controller's protective stop ends."""

    def execute(self) -> SkillCoroutine[None]:
        motion: Motion[None] = Motion()
        motion.end(MotionStatus.FAILED, STRUCK)
        yield start_motion("arm", lambda: motion)


class CloseStoppedHand(Skill):
    """Commands a gripper whose robot was stopped by a fault of the arm's controller."""

    def execute(self) -> SkillCoroutine[None]:
        channel: Any = SimpleNamespace(refresh=lambda: None, read=lambda: GripperReading(0.05))
        latch, model = StopLatch(), self.skills.robot.of(GripperModel)["gripper"]
        hand = CommandedGripper("hand", model, channel, latch)
        hand.attach()
        latch.set(STRUCK)
        yield GripperController(hand).close()


class LetGo(Skill):
    """Opens the hand a little, which it measures first."""

    def execute(self) -> SkillCoroutine[None]:
        yield self.skills.gripper.release()


@pytest.fixture
def skills() -> Any:
    return scripted_skills()


def failure_in_result_json(skills: Any, leaf: type[Skill]) -> dict[str, Any]:
    register(skills, leaf)
    assert run(skills, load(skills, f"<{leaf.__name__}/>")) == FAILURE
    (told,) = skills.failures
    result = RunResult("fetch_cup", 0, False, Outcome.FAILURE, "FAILURE", None, told, {}, {}, 1.0, 1.0)
    return result.to_document()["failure"]


def test_the_vendors_number_and_the_part_of_a_motion_arrive_in_result_json(skills: Any) -> None:
    failure = failure_in_result_json(skills, MoveStruckArm)
    assert (failure["error_code"], failure["part"], failure["vendor_code"]) == ("collision", "arm", "C31")
    assert failure["why"] == "arm: the current is too high (C31)"
    assert failure["stamp"] == skills.clock.now()


def test_so_do_those_of_a_command_that_is_refused(skills: Any) -> None:
    failure = failure_in_result_json(skills, CloseStoppedHand)
    assert (failure["error_code"], failure["part"], failure["vendor_code"]) == ("stopped", "hand", "C31")
    assert failure["why"] == (
        "hand refused move: the robot is stopped because arm: the current is too high (C31); "
        "clear_stop() makes it accept commands"
    )


def test_and_those_of_a_reading_that_does_not_come(skills: Any) -> None:
    def silent() -> None:
        raise NotConnectedError("hand delivers nothing: no message from it", "hand", "G9")

    skills.gripper.release = silent
    failure = failure_in_result_json(skills, LetGo)
    assert (failure["error_code"], failure["part"], failure["vendor_code"]) == ("disconnected", "hand", "G9")
