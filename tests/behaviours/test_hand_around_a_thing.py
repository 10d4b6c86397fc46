"""After a retreat that was interrupted, the open hand still encloses what it has placed; the next motion leaves it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.behaviours.truth import audited, known_world, succeeds, table_with

pytestmark = pytest.mark.slow

PUT_DOWN = """<Sequence>
  <LookAt surface="table"/>
  <DetectObject object="cup" surface="table"/>
  <PlanGrasp object="cup" grasps="{grasps}"/>
  <Grasp object="cup" grasps="{grasps}"/>
  <FindFreePlace object="cup" surface="table" goal="{goal}"/>
  <FindPlacePose object="cup" surface="table" goal="{goal}" pose="{pose}"/>
  <PlaceOn object="cup" pose="{pose}"/>
  <Release object="cup" surface="table"/>
</Sequence>"""


def test_the_arm_moves_straight_back_from_what_its_open_hand_encloses(tmp_path: Path) -> None:
    with known_world(table_with(tmp_path, heading=40.0, cup=("cup", -0.2, 0.0, 0.0))) as (session, truth):
        assert succeeds(session, PUT_DOWN), session.skills.failures
        skills = session.skills
        pairs = skills.arm_world(skills.planning_scene()).colliding_pairs(skills.arm_positions())
        assert any("cup" in pair for pair in pairs)
        stands, before = truth.object_pose("cup").position, session.skills.clock.now()
        assert succeeds(session, '<MoveArm posture="carry"/>'), session.skills.failures
        assert skills.arm_world(skills.planning_scene()).is_free(skills.arm_positions())
        assert np.linalg.norm(truth.object_pose("cup").position - stands) < 0.005
        touched = {(touch.first, touch.second) for touch in audited(session).collisions if touch.start > before}
        assert touched <= {("cup", "table")}
