"""A finger that touches an object on the way in: the arm stops, goes back, and takes it where it is seen next.

The handle of the mug is hidden, at first and later: its yaw is uncertain, and the hand keeps off where it may be.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from behaviours import arm_motion
from behaviours.arm_motion import approach_object
from behaviours.contacts import stopping_at
from behaviours.skill import Skill, SkillCoroutine
from bestman_bt.engine import FAILURE
from bestman_bt.messages import MotionErrorCode, MotionObstacle, MotionStage, Pose
from tests.behaviours.at_the_table import failures_of
from tests.behaviours.scripted import codes, load, register, run, scripted_skills
from tests.behaviours.truth import audited, known_world, succeeds, table_with

SEE = '<LookAt surface="table"/><DetectObject object="cup" surface="table"/>'
TAKE = '<PlanGrasp object="cup" grasps="{grasps}"/><Grasp object="cup" grasps="{grasps}"/>'


class Approach(Skill):
    """Three waypoints, to see which the arm takes."""

    def execute(self) -> SkillCoroutine[None]:
        path = self.skills.path
        yield from approach_object(self, path, None, on_contact=self.skills.touched)


@pytest.mark.parametrize(
    ("ends", "reached", "code", "back"),
    [
        ([MotionErrorCode.COLLISION, None], 1.2, "collision", [1.2, 0.0]),
        ([MotionErrorCode.COLLISION, None], 0.1, "collision", [0.1, 0.0]),
        ([MotionErrorCode.COLLISION, None], 1.9, "collision", [1.9, 1.0, 0.0]),
        ([MotionErrorCode.COLLISION, MotionErrorCode.STOPPED], 1.9, "collision", [1.9, 1.0, 0.0]),
        ([MotionErrorCode.DECLINED], 0.0, "declined", None),
    ],
)
def test_after_a_contact_the_arm_goes_back_as_it_came_and_the_contact_is_what_failed(
    monkeypatch: pytest.MonkeyPatch, ends: list[Any], reached: float, code: str, back: list[float] | None
) -> None:
    skills = scripted_skills()
    register(skills, Approach)
    at = [0.0]
    skills.path = np.array([[0.0], [1.0], [2.0]])
    skills.arm_positions, calls = lambda: np.array(at), []
    skills.touched = lambda: calls.append(len(skills.arm.asked))
    skills.met = lambda failure: failure.obstacle or MotionObstacle(MotionStage.EXECUTION, positions={"at": at[0]})

    def timed(skill: Any, path: Any, *_: Any) -> Iterator[Any]:
        yield from ()
        way, at[0] = [at[0], *path[1:, 0].tolist()], reached
        return way

    monkeypatch.setattr(arm_motion, "timed_path", timed)
    skills.arm.ends["follow"] = list(ends)
    assert run(skills, load(skills, "<Approach/>")) == FAILURE
    assert codes(skills) == [code]
    ways = [asked[1] for asked in skills.arm.asked]
    assert ways == [[0.0, 1.0, 2.0], *([back] if back else [])]
    assert calls == ([1] if back else []), "the grasps are dropped before the arm goes back"
    if back:
        assert skills.failures[-1].obstacle.positions == {"at": reached}, "where it touched, not where it went"


@pytest.mark.slow
@pytest.mark.parametrize(("model", "beside"), [("cup", 0.03), ("mug", -0.03)])
def test_a_finger_on_the_rim_ends_the_approach(tmp_path, model: str, beside: float) -> None:
    with known_world(table_with(tmp_path, heading=-120.0, cup=(model, -0.2, 0.0, 0.0))) as (session, truth):
        skills = session.skills
        assert succeeds(session, f"<Sequence>{SEE}</Sequence>")
        seen = skills.world.objects["cup"]
        wrong = seen.pose.position + skills.map_from_base.rotation @ [0.0, beside, 0.0]
        skills.world.objects["cup"] = replace(seen, pose=Pose(wrong, seen.pose.quaternion))
        stood = truth.object_pose("cup").position.copy()
        assert not succeeds(session, f"<Sequence>{TAKE}</Sequence>")
        assert failures_of(session)[-1][0] == "collision"
        assert skills.held is None
        rim = seen.pose.position[2] + seen.model.size[2] / 2
        assert skills.base_from_tool().position[2] > rim + 0.05, "it has gone back"
        assert np.linalg.norm(truth.object_pose("cup").position - stood) < 0.02
        (touched,) = audited(session).collisions  # without its declaration
        assert touched.first.endswith("finger")
        assert touched.second == "cup"
        assert touched.peak_force < stopping_at(skills.gripper_model.part.max_force)
        assert succeeds(session, f"<Sequence>{SEE}{TAKE}</Sequence>"), skills.failures
        assert skills.held is not None
