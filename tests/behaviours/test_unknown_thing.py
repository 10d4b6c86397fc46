"""A thing of which the robot has no model: it is seen, named, grasped by its points, and lifted."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from bestman_bt.runtime.robot_session import RobotSession
from hal.simulation.ground_truth import GroundTruth
from tests.behaviours.truth import audited, known_world, succeeds, table_with, why_not

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def scanned(tmp_path_factory) -> Iterator[tuple[RobotSession, GroundTruth]]:
    """A scan of a table with a duck that the robot knows nothing of, and a can."""
    config = table_with(
        tmp_path_factory.mktemp("scene"), heading=-70.0, duck=("duck", -0.2, 0.0, 90.0), can=("can", -0.15, 0.2, 0.0)
    )
    with known_world(config) as (session, truth):
        del session.skills.world.models["duck"]
        assert succeeds(session, '<Sequence><LookAt surface="table"/><ScanScene surface="table"/></Sequence>')
        yield session, truth


def test_what_no_model_explains_is_a_thing_with_a_measured_box(scanned) -> None:
    session, truth = scanned
    assert set(session.skills.world.objects) == {"thing_1", "can"}
    thing, duck = session.skills.world.objects["thing_1"], truth.object_pose("duck")
    assert not thing.recognised
    assert np.linalg.norm(thing.pose.position[:2] - duck.position[:2]) < 0.03
    assert thing.cloud is not None
    assert len(thing.cloud.points) > 100
    assert np.linalg.norm(thing.cloud.points - duck.position, axis=1).max() < 0.15


def test_a_thing_keeps_its_name_when_it_is_detected_again(scanned) -> None:
    session, _ = scanned
    before = session.skills.world.objects["thing_1"]
    assert succeeds(session, '<DetectObject object="thing_1" surface="table"/>')
    again = session.skills.world.objects["thing_1"]
    assert again.stamp > before.stamp
    assert again.since == before.since
    assert set(session.skills.world.objects) == {"thing_1", "can"}


def test_the_name_of_its_model_means_nothing_to_the_robot(scanned) -> None:
    assert why_not(scanned[0], '<DetectObject object="duck" surface="table"/>')[0] == "unknown_object"


def test_a_thing_is_grasped_by_its_points_and_lifted(scanned) -> None:
    session, truth = scanned
    stood = truth.object_pose("duck").position[2]
    body = """<Sequence><DetectObject object="thing_1" surface="table"/>
      <PlanGrasp object="thing_1" grasps="{grasps}"/>
      <Grasp object="thing_1" grasps="{grasps}"/>
      <CheckHeld object="thing_1"/></Sequence>"""
    assert succeeds(session, body), session.skills.failures[-1]
    assert truth.object_pose("duck").position[2] > stood + 0.05
    held = session.skills.held
    assert held is not None
    assert held.name == "thing_1"
    assert "thing_1" not in session.skills.world.objects
    assert audited(session).honest
    assert {
        frozenset((c.first, c.second)) for c in audited(session).collisions if "duck" not in (c.first, c.second)
    } == set()
