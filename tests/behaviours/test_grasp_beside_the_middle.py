"""A plate is taken by its rim: it hangs beside the hand, and the robot knows how."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from bestman_bt.runtime.robot_session import RobotSession
from hal.simulation.ground_truth import GroundTruth
from tests.behaviours.truth import audited, known_world, succeeds, table_with

pytestmark = pytest.mark.slow

TAKE = """<Sequence>
  <LookAt surface="table"/>
  <DetectObject object="plate" surface="table"/>
  <PlanGrasp object="plate" grasps="{grasps}"/>
  <Grasp object="plate" grasps="{grasps}"/>
  <Retreat posture="carry"/>
</Sequence>"""


@pytest.fixture(scope="module")
def carrying(tmp_path_factory) -> Iterator[tuple[RobotSession, GroundTruth]]:
    """A robot that has taken a plate and is ready to drive."""
    config = table_with(tmp_path_factory.mktemp("scene"), heading=150.0, plate=("plate", -0.2, 0.0, 0.0))
    with known_world(config) as (session, truth):
        assert succeeds(session, TAKE)
        yield session, truth


def test_the_plate_hangs_in_the_hand_as_the_robot_believes(carrying) -> None:
    session, truth = carrying
    skills = session.skills
    held = skills.held
    assert held is not None
    assert np.linalg.norm(held.tool_from_object.position[:2]) > 0.06
    believed = skills.map_from_base @ skills.base_from_tool() @ held.tool_from_object
    true = truth.object_pose("plate")
    assert np.linalg.norm(believed.position - true.position) < 0.015
    assert np.degrees(np.arccos(believed.rotation[:, 2] @ true.rotation[:, 2])) < 5.0


def test_the_plate_touches_nothing_but_the_fingers_on_the_way(carrying) -> None:
    session, _ = carrying
    record = audited(session)
    fingers = {"panda_leftfinger", "panda_rightfinger", "table"}
    assert {touch.first for touch in record.collisions} | {touch.second for touch in record.collisions} <= {
        "plate"
    } | fingers
    assert record.max_penetration_mm < 2.0


def test_what_was_seen_of_the_plate_where_it_stood_is_forgotten(carrying) -> None:
    assert "plate" not in carrying[0].skills.observations
