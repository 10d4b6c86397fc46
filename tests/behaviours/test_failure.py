"""What a driver tells of a failure reaches the result of the run unchanged."""

from __future__ import annotations

from typing import Any

import pytest

from behaviours.skill import Skill, Steps
from bestman_bt.control.handle import start_motion
from bestman_bt.engine import FAILURE
from bestman_bt.evaluation.result import Outcome, RunResult
from bestman_bt.messages import Failure, MotionErrorCode
from hal.api import MotionStatus
from hal.parts import PartMotion
from tests.behaviours.scripted import load, register, run, scripted_skills

STRUCK = Failure(MotionErrorCode.COLLISION, "the current is too high", "arm", "C31")


class Owner:
    def brake(self) -> None:
        """There is nothing to bring to rest."""


class MoveStruckArm(Skill):
    """Commands a motion that the controller's protective stop ends."""

    def execute(self) -> Steps:
        motion = PartMotion(Owner())
        motion.end(MotionStatus.FAILED, STRUCK)
        yield start_motion("arm", lambda: motion)


@pytest.fixture
def skills() -> Any:
    return scripted_skills()


def test_the_vendors_number_and_the_part_arrive_in_result_json(skills: Any) -> None:
    register(skills, MoveStruckArm)
    assert run(skills, load(skills, "<MoveStruckArm/>")) == FAILURE
    (told,) = skills.failures
    result = RunResult("fetch_cup", 0, False, Outcome.FAILURE, "FAILURE", None, told, {}, {}, 1.0, 1.0)
    failure = result.to_document()["failure"]
    assert (failure["error_code"], failure["part"], failure["vendor_code"]) == ("collision", "arm", "C31")
    assert failure["why"] == "arm: the current is too high (C31)"
    assert failure["stamp"] == skills.clock.now()
