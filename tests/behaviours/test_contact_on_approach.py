"""A finger that touches an object on the way in: the arm stops, goes back, and takes it where it is seen next.

The handle of the mug is hidden, at first and later: its yaw is uncertain, and the hand keeps off where it may be.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from behaviours.contacts import stopping_at
from bestman_bt.messages import Pose
from tests.behaviours.at_the_table import failures_of
from tests.behaviours.truth import audited, known_world, succeeds, table_with

SEE = '<LookAt surface="table"/><DetectObject object="cup" surface="table"/>'
TAKE = '<PlanGrasp object="cup" grasps="{grasps}"/><Grasp object="cup" grasps="{grasps}"/>'


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
