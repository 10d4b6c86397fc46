"""A hand that cannot lift what it has closed on: it lets go, leaves as it came, and the arm can go on from there."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from bestman_bt.manipulation.motion_planning.base import MotionPlanningError, PlanningErrorCode
from tests.behaviours.truth import known_world, succeeds, table_with

pytestmark = pytest.mark.slow

WHY = "the timed motion touches: shelf with panda_link5"
TAKE = """<Sequence>
  <LookAt surface="table"/>
  <DetectObject object="cup" surface="table"/>
  <PlanGrasp object="cup" grasps="{grasps}"/>
  <Grasp object="cup" grasps="{grasps}"/>
</Sequence>"""


def test_it_lets_go_and_leaves_as_it_came(tmp_path, monkeypatch: pytest.MonkeyPatch) -> None:
    with known_world(table_with(tmp_path, heading=-120.0, cup=("cup", -0.2, 0.0, 0.0))) as (session, truth):
        skills = session.skills
        planner = skills.motion_planning
        follow, asked = planner.follow_path, []

        def refuse_the_lift(*arguments: Any) -> Any:
            asked.append(skills.gripper.width())
            if len(asked) == 2:
                raise MotionPlanningError(PlanningErrorCode.TIMED_PATH_INVALID, WHY)
            return follow(*arguments)

        monkeypatch.setattr(planner, "follow_path", refuse_the_lift)
        stood = truth.object_pose("cup").position.copy()
        assert not succeeds(session, TAKE)
        assert skills.failures[-1].why == WHY
        assert skills.held is None
        assert asked[0] == pytest.approx(asked[2], abs=0.002), "the hand is open on its way back as on its way in"
        assert asked[1] < asked[0] - 0.005, "it had closed on the cup"
        assert np.linalg.norm(truth.object_pose("cup").position - stood) < 0.005
        assert "cup" in skills.world.objects
        assert succeeds(session, '<MoveArm posture="carry"/>'), skills.failures
