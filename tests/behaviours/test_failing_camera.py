"""A camera that stops delivering makes the skill fail, in words; nothing is invented, and the next look works again."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from bestman_bt.configuration.run import load_run
from bestman_bt.engine import FAILURE, SUCCESS
from bestman_bt.runtime.robot_session import RobotSession, open_session
from hal.simulation.sensor_pipeline import SensorFault
from tests.behaviours.at_the_table import failures_of, standing_at_a_table, tick, tree_of

DETECT = '<Sequence><LookAt surface="table"/><DetectObject object="cup" surface="table"/></Sequence>'


@pytest.fixture(scope="module")
def session() -> Iterator[RobotSession]:
    with open_session(load_run("fetch_cup", seed=3, settings=standing_at_a_table(-100.0))) as opened:
        yield opened


@pytest.mark.parametrize(
    ("fault", "code"),
    [
        (SensorFault.SILENT, "camera_no_image"),
        pytest.param(SensorFault.BLACK, "camera_black", marks=pytest.mark.slow),
        pytest.param(SensorFault.NO_DEPTH, "camera_no_depth", marks=pytest.mark.slow),
        (SensorFault.FROZEN, "camera_stale"),
    ],
)
def test_detection_fails_with_the_camera_and_works_when_it_works(session: RobotSession, fault, code: str) -> None:
    camera = session.robot.parts["head_camera"]
    assert tick(session.load(tree_of(DETECT)), 200) == SUCCESS
    before = dict(session.skills.world.objects)
    session.robot.clock.sleep(0.6)
    camera.fault = fault
    assert tick(session.load(tree_of(DETECT)), 200) == FAILURE
    assert failures_of(session)[0][0] == code
    assert "head_camera gave" in failures_of(session)[0][1]
    assert session.skills.world.objects == before
    camera.fault = None
    assert tick(session.load(tree_of(DETECT)), 200) == SUCCESS
