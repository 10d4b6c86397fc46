"""What a part says when it fails reaches the report from skills that say more about it themselves."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from behaviours.furniture.articulation_motion import followed
from behaviours.furniture.close import Close
from behaviours.furniture.open import Open
from behaviours.parameters import SkillParameters
from behaviours.skill import SkillFailure
from bestman_bt.control.arm.constraint_following import FollowEnd
from bestman_bt.control.arm.joint_axis import JointAxis
from bestman_bt.messages import Failure, MotionErrorCode, Pose
from hal.api import Motion

STRUCK = Failure(MotionErrorCode.COLLISION, "the current is too high", "arm", "C31")


def test_a_following_that_ended_early_hands_on_part_and_vendor_code() -> None:
    steps = followed(Motion("arm"))
    following = next(steps)
    following.fail(MotionErrorCode.BLOCKED, "it does not move", SimpleNamespace(end="locked"))
    with pytest.raises(StopIteration) as stop:
        steps.throw(SkillFailure.of(STRUCK))
    motion, failure = stop.value.value
    assert motion.end == "locked"
    assert failure.failure == STRUCK


def test_a_failure_of_a_controller_names_its_part_once() -> None:
    handle: Motion[None] = Motion("arm")
    handle.fail(MotionErrorCode.GUARDED, "the cup has slipped")
    assert (handle.failure.part, str(handle.failure)) == ("arm", "arm: the cup has slipped")
    assert str(Failure(MotionErrorCode.REFUSED, "arm refused follow: beyond its limits", "arm")) == (
        "arm refused follow: beyond its limits"
    )


class Hand:
    """As much of a skill's context as going along with a leaf needs; ``following`` is what the arm gives back."""

    def __init__(self) -> None:
        self.following: Motion[SimpleNamespace] = Motion("arm")
        self.arm = SimpleNamespace(follow_constraint=lambda *_, **__: self.following, carry=lambda *_: None)
        self.gripper = SimpleNamespace(watch_slip=lambda _: None)
        self.map_from_base = Pose()
        self.clock = SimpleNamespace(now=lambda: 0.0)
        self.world = SimpleNamespace(believe_articulation=lambda *_: None)
        self.parameters = SkillParameters()

    def base_from_tool(self) -> Pose:
        return Pose()

    def fail(self, steps) -> SkillFailure:
        """What the skill fails with when the arm is struck on the way."""
        next(steps)
        ended = SimpleNamespace(end=FollowEnd.OBSTACLE, tool=Pose(), angle=0.1, distance=0.1)
        self.following.fail(MotionErrorCode.COLLISION, "struck", ended)
        with pytest.raises(SkillFailure) as error:
            steps.throw(SkillFailure.of(STRUCK))
        return error.value


def test_open_tells_part_and_vendor_code(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("behaviours.furniture.open.articulation_from_motion", lambda *_: None)
    door = SimpleNamespace(name="fridge/door", articulation=SimpleNamespace(kind="revolute", upper=1.5))
    opening = SimpleNamespace(
        door=door,
        handle=SimpleNamespace(opening_direction=np.array([1.0, 0.0, 0.0])),
        angle=1.2,
        distance=0.4,
        start=0.0,
        asked=1.2,
        bar_turns=False,
        axis=lambda _: None,
    )
    hand, plan = Hand(), SimpleNamespace(planned=1.0, guide=None)
    skill = SimpleNamespace(skills=hand, max_pull=40.0, _held=lambda *_: None)
    failure = hand.fail(Open._pull(skill, opening, plan))
    assert (failure.code, failure.failure) == ("obstacle", STRUCK)


def test_close_tells_part_and_vendor_code() -> None:
    door = SimpleNamespace(name="fridge/door", articulation=SimpleNamespace(upper=1.5))
    axis = JointAxis("revolute", np.zeros(3), np.array([0.0, 0.0, 1.0]), 0.4, 0.0)
    push = SimpleNamespace(door=door, axis=lambda: axis, lever=0.4, opening=lambda _: 0.8)
    hand = Hand()
    skill = SimpleNamespace(
        skills=hand,
        max_push=40.0,
        opening=0.1,
        set_output=lambda *_: None,
        _tip=lambda *_: Pose(np.array([0.4, 0.0, 0.0])),
        _uncertainty=lambda _: 0.05,
    )
    failure = hand.fail(Close._push(skill, SimpleNamespace(push=push, guide=None), 0.8))
    assert (failure.code, failure.failure) == ("obstacle", STRUCK)
