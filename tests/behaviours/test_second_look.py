"""A mug whose handle the head camera cannot see: the wrist camera finds out how it is turned, and touches nothing."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from bestman_bt.messages import wrap_angle
from bestman_bt.runtime.robot_session import RobotSession
from hal.simulation.ground_truth import GroundTruth
from tests.behaviours.truth import audited, known_world, succeeds, table_with, why_not

pytestmark = pytest.mark.slow

DETECT = '<Sequence><LookAt surface="table"/><DetectObject object="mug" surface="table"/></Sequence>'
SECOND_LOOK = '<SecondLook object="mug"/>'


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    return tmp_path_factory.mktemp("scene")


@pytest.fixture(scope="module")
def crowded(folder: Path) -> Iterator[tuple[RobotSession, GroundTruth]]:
    """The handle points away from the robot; a can stands beside the mug, a tall box behind it."""
    config = table_with(
        folder,
        mug=("mug", -0.2, 0.0, 10.0),
        can=("can", -0.2, 0.1, 0.0),
        box=("cereal_box", 0.0, 0.0, 0.0),
    )
    with known_world(config) as (session, truth):
        yield session, truth


def yaw_error(session: RobotSession, truth: GroundTruth) -> float:
    """Radians."""
    return abs(wrap_angle(session.skills.world.objects["mug"].pose.yaw - truth.object_pose("mug").yaw))


def test_what_was_never_seen_cannot_be_looked_at_again(crowded) -> None:
    code, words = why_not(crowded[0], '<SecondLook object="duck"/>')
    assert (code, words) == ("not_found", "the duck has not been seen; detect it first")


def test_one_view_leaves_the_yaw_open_and_reports_it(crowded) -> None:
    session, truth = crowded
    session.skills.world.objects.clear()
    session.skills.observations.clear()
    assert succeeds(session, DETECT)
    belief = session.skills.world.objects["mug"]
    assert math.radians(40.0) < belief.yaw_set.width < math.radians(180.0)
    assert belief.yaw_set.contains(truth.object_pose("mug").yaw)


def test_the_second_look_finds_the_yaw_and_touches_nothing(crowded) -> None:
    session, truth = crowded
    pictures: list[object] = []
    assert session.skills.wrist_camera is not None
    session.skills.wrist_camera.subscribe(pictures.append)
    before = session.skills.arm_positions()
    stood = truth.object_pose("mug")
    assert succeeds(session, DETECT)
    assert succeeds(session, SECOND_LOOK)
    belief = session.skills.world.objects["mug"]
    assert len(pictures) == 1
    assert np.abs(session.skills.arm_positions() - before).max() > 0.3
    assert yaw_error(session, truth) < math.radians(10.0)
    assert belief.yaw_set.width < math.radians(20.0)
    assert belief.yaw_set.contains(stood.yaw)
    assert np.linalg.norm(belief.pose.position - stood.position) < 0.005
    assert np.linalg.norm(truth.object_pose("mug").position - stood.position) < 0.0005
    assert audited(session).collisions == ()
    assert audited(session).honest


def test_where_nothing_is_open_the_arm_stays_where_it_is(crowded) -> None:
    session, _ = crowded
    assert succeeds(session, f"<Sequence>{DETECT}{SECOND_LOOK}</Sequence>")
    before, yaw = session.skills.arm_positions(), session.skills.world.objects["mug"].pose.yaw
    assert succeeds(session, SECOND_LOOK)
    assert np.abs(session.skills.arm_positions() - before).max() < 1e-3
    assert session.skills.world.objects["mug"].pose.yaw == yaw


def test_what_the_second_look_found_is_kept_when_the_head_looks_again(crowded) -> None:
    session, truth = crowded
    assert succeeds(session, f"<Sequence>{DETECT}{SECOND_LOOK}<MoveArm posture='look'/>{DETECT}</Sequence>")
    assert session.skills.world.objects["mug"].yaw_set.width < math.radians(20.0)
    assert yaw_error(session, truth) < math.radians(10.0)


def test_without_a_camera_on_the_hand_there_is_no_second_look(crowded, monkeypatch) -> None:
    session, _ = crowded
    session.skills.world.objects.clear()
    session.skills.observations.clear()
    assert succeeds(session, DETECT)
    monkeypatch.setattr(session.skills, "wrist_camera", None)
    code, words = why_not(session, SECOND_LOOK)
    assert code == "no_camera"
    assert words == "the robot diff_panda has no camera on its hand to look with"


def test_a_mug_out_of_the_arms_reach_has_no_view_and_the_arm_stays(folder: Path) -> None:
    with known_world(table_with(folder, mug=("mug", 0.33, 0.5, 0.0))) as (session, _):
        assert succeeds(session, DETECT)
        before = session.skills.arm_positions()
        assert why_not(session, SECOND_LOOK) == (
            "no_view",
            "no informative view of the mug is free and within reach from here",
        )
        assert np.abs(session.skills.arm_positions() - before).max() < 1e-3
