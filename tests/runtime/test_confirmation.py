"""Motions that a person looks at first: what is told, who starts them, what a refusal comes to."""

from __future__ import annotations

import dataclasses
import json
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from behaviours.manipulation.move_arm import MoveArm
from behaviours.perception.look import LookAt
from behaviours.skill import Skill, SkillCoroutine
from bestman_bt.control.motion import PlannedMotion
from bestman_bt.engine import Fallback
from bestman_bt.runtime.confirmation import Confirmation
from bestman_bt.runtime.executor import TerminationReason
from bestman_bt.runtime.robot_session import RobotSession, open_session, session_config
from hal.api import Arm, Gripper, JointGroup

TREE = """<root BTCPP_format="4"><BehaviorTree ID="Main"><Sequence>
  <DriveOnHeading dist_to_travel="0.2" speed="0.1"/><MoveArm posture="home"/>
</Sequence></BehaviorTree></root>"""


class OpenHand(Skill):
    def execute(self) -> SkillCoroutine[None]:
        yield self.skills.gripper.open(0.03)


def asked(opened: RobotSession, answer: Callable[[Confirmation, PlannedMotion], None]) -> list[PlannedMotion]:
    """What was asked so far; a person answers each from another thread."""
    confirmation, seen = opened.confirmation, list[PlannedMotion]()
    assert confirmation is not None

    def show(planned: PlannedMotion) -> None:
        seen.append(planned)
        threading.Timer(0.05, answer, (confirmation, planned)).start()

    confirmation.asked.append(show)
    return seen


def until_taken(give: Callable[[], bool]) -> None:
    while not give():
        threading.Event().wait(0.01)


def test_motions_start_when_a_person_has_seen_them_and_one_that_is_declined_fails_with_its_code() -> None:
    config = dataclasses.replace(session_config(seed=3), confirm=True)
    with open_session(config) as opened:
        arm = opened.robot.part("arm", Arm)
        before, at = arm.positions(), list[float]()

        def start(confirmation: Confirmation, planned: PlannedMotion) -> None:
            at.append(opened.robot.clock.now())
            until_taken(confirmation.start)

        seen = asked(opened, start)
        execution = opened.run(TREE)
        assert execution.succeeded, opened.skills.failures
        assert [planned.part for planned in seen[:1]] == ["base"]
        assert seen[-1].part == "arm"
        base, moved = seen[0], seen[-1]
        assert "0.20 m to x" in base.words
        assert moved.duration is not None
        assert moved.heights is not None
        assert "passes through x" in str(moved)
        corners = np.concatenate(moved.swept)
        assert float(np.ptp(corners, axis=0).max()) < 2.0
        assert np.linalg.norm(corners.mean(axis=0) - opened.skills.world.base.pose.xy) < 1.0

        assert not np.allclose(arm.positions(), before, atol=0.01)


def test_a_declined_motion_moves_nothing_and_a_stop_ends_the_question() -> None:
    config = dataclasses.replace(session_config(seed=3), confirm=True)
    with open_session(config) as opened:
        arm = opened.robot.part("arm", Arm)
        head, hand = opened.robot.part("head", JointGroup), opened.robot.part("gripper", Gripper)
        before, width = np.concatenate([arm.positions(), head.positions()]), hand.width()
        seen = asked(opened, lambda confirmation, planned: until_taken(confirmation.decline))
        execution = opened.run(Fallback("all", [MoveArm(posture="home"), LookAt(surface="counter"), OpenHand()]))
        assert not execution.succeeded
        assert [planned.part for planned in seen] == ["arm", "head", "gripper"]
        assert [failure.error_code for failure in opened.skills.failures] == ["declined"] * 3
        assert np.concatenate([arm.positions(), head.positions()]) == pytest.approx(before, abs=0.01)
        assert hand.width() == pytest.approx(width, abs=1e-3)
        assert opened.confirmation is not None
        assert not opened.confirmation.start()  # nothing waits any more

        tree = opened.load(TREE)
        executor = opened.executor(tree)
        opened.confirmation.asked[:] = [lambda planned: threading.Timer(0.05, executor.cancel).start()]
        assert executor.run().ending is TerminationReason.CANCELLED
        assert opened.confirmation.pending is None


def test_what_was_declined_before_does_not_decline_a_motion_that_is_only_let_go_on() -> None:
    confirmation = Confirmation()
    answers = iter([confirmation.decline, lambda: None, confirmation.start, confirmation.decline])

    class Waiting:
        """An executor; ``resume`` of the control channel lets it go on without a word to the confirmation."""

        def hold(self, reason: object) -> None:
            next(answers)()

        def resume(self) -> None:
            pass

    confirmation.executor = Waiting()
    motion = PlannedMotion("arm", "home")
    assert [confirmation.confirm(motion) for _ in range(4)] == [False, True, True, False]


@pytest.mark.slow
def test_a_person_at_the_terminal_is_asked_and_answers(tmp_path: Path) -> None:
    ran = subprocess.run(
        [sys.executable, "-m", "bestman_bt.cli.main", "run", "fetch_cup", "--seed", "3", "--confirm", "--json"],
        input="\n\n" + "n\n" * 40,
        capture_output=True,
        text=True,
        cwd=tmp_path,
        timeout=200,
        check=False,
    )
    assert ran.returncode == 1, ran.stderr
    assert json.loads(ran.stdout)["failure"]["error_code"] == "declined"
    assert "Enter starts it, n refuses it: " in ran.stderr
    assert "base: " in ran.stderr
