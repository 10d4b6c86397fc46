"""What a policy has set in motion is watched, and nothing of it goes on after it was cancelled."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from behaviours.manipulation.policy import PolicyMotion
from behaviours.skill import SkillFailure
from bestman_bt.manipulation.policy.specification import Workspace
from bestman_bt.messages import MotionErrorCode, Pose
from tests.behaviours.scripted import UNDER_WAY, scripted_skills

BOX = Workspace(np.array([0.0, -0.5, 0.5]), np.array([1.0, 0.5, 1.5]))
DEADLINE = 10.0


@pytest.fixture
def skills() -> Any:
    skills = scripted_skills()
    skills.position = np.array([0.5, 0.0, 1.0])
    skills.base_from_tool = lambda: Pose(skills.position)
    return skills


@pytest.fixture
def motion(skills: Any) -> PolicyMotion:
    """The arm follows a chunk, and nothing has moved the fingers yet."""
    made = PolicyMotion(skills, BOX, skills.clock.now() + DEADLINE)
    made.stream = SimpleNamespace(accept=lambda spliced, now: spliced, motion=None)
    skills.arm.ends["follow"] = [UNDER_WAY]
    made.follow("a checked motion")
    return made


def chunk(*widths: float, dt: float = 0.1) -> Any:
    return SimpleNamespace(gripper_widths=np.array(widths), dt=dt)


def go_on(skills: Any, steps: Any, seconds: float) -> None:
    """Let time pass while a skill waits for ``steps``."""
    for _ in range(round(seconds / 0.05)):
        next(steps)
        skills.clock.advance(0.05)


def test_cancelled_neither_the_arm_nor_the_fingers_go_on(skills: Any, motion: PolicyMotion) -> None:
    skills.gripper.ends["close"] = [UNDER_WAY]
    go_on(skills, motion.carry_out(chunk(0.0, 0.0), skills.clock.now(), 2), 0.1)
    assert (len(skills.arm.under_way), len(skills.gripper.under_way)) == (1, 1)
    motion.cancel()
    assert (skills.arm.under_way, skills.gripper.under_way) == ([], [])


def test_the_gripper_is_reported_each_width_at_its_time_and_only_where_it_is_another_one(
    skills: Any, motion: PolicyMotion
) -> None:
    """It is open by 80 mm at first; widths beyond what it can open to are cut."""
    widths = (0.2, 0.0785, 0.05, 0.051, 0.0, 0.0)
    begin, told = skills.clock.now(), []
    steps = motion.carry_out(chunk(*widths), begin, len(widths))
    for _ in range(11):
        next(steps)
        told += [(skills.clock.now() - begin, *asked) for asked in skills.gripper.asked[len(told) :]]
        skills.clock.advance(0.05)
    assert [asked for _, *asked in told] == [["open", 0.05], ["close"]]
    assert [stamp for stamp, *_ in told] == pytest.approx([0.2, 0.4], abs=0.051)
    assert motion.asked_width == 0.0
    assert motion.closed_at is not None
    np.testing.assert_allclose(motion.closed_at.position, skills.position)


@pytest.mark.parametrize("part", ["arm", "gripper"])
def test_a_part_that_fails_ends_it(skills: Any, motion: PolicyMotion, part: str) -> None:
    skills.gripper.ends["close"] = [UNDER_WAY]
    steps = motion.carry_out(chunk(0.0, 0.0, 0.0), skills.clock.now(), 3)
    go_on(skills, steps, 0.1)
    getattr(skills, part).handles[-1].fail(MotionErrorCode.BLOCKED, "it does not get on")
    with pytest.raises(SkillFailure, match="it does not get on") as failed:
        go_on(skills, steps, 0.1)
    assert failed.value.code == "blocked"


@pytest.mark.parametrize(
    ("position", "after", "words"),
    [
        ((0.5, 0.0, 1.0), 9.9, None),
        ((0.5, 0.0, 1.0), 10.1, "time is up"),
        ((1.019, 0.0, 1.0), 0.0, None),
        ((1.021, 0.0, 1.0), 0.0, "left the workspace"),
        ((0.5, -0.521, 1.0), 0.0, "left the workspace"),
        ((0.5, 0.0, 0.479), 0.0, "left the workspace"),
    ],
)
def test_the_arm_is_watched_by_the_clock_and_by_the_box(
    skills: Any, motion: PolicyMotion, position: tuple[float, ...], after: float, words: str | None
) -> None:
    assert motion.box is BOX
    guard = skills.arm.asked[-1][-1]
    skills.clock.advance(after)
    skills.position = np.array(position)
    objection = guard()
    assert (objection is None) is (words is None)
    assert words is None or words in objection


def test_an_arm_that_the_clock_has_stopped_is_reported_as_time_that_is_up(skills: Any, motion: PolicyMotion) -> None:
    steps = motion.carry_out(chunk(0.08), skills.clock.now(), 1)
    next(steps)
    skills.clock.advance(DEADLINE + 0.05)
    skills.arm.handles[-1].fail(MotionErrorCode.GUARDED, "time is up")
    with pytest.raises(SkillFailure) as failed:
        next(steps)
    assert failed.value.code == "timeout"
