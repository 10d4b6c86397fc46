"""Docking: a pose is reached to a centimetre and a degree, by the map or by the front that the lidar sees."""

from __future__ import annotations

import math

import pytest

from bestman_bt.configuration.run import load_run
from bestman_bt.messages import Pose2D, wrap_angle
from bestman_bt.world_model.semantic_map import MapFurniture
from tests.behaviours.truth import audited, known_world, succeeds, why_not

pytestmark = pytest.mark.slow

BY_FRONT = (
    "scene.robot_start.x=[-1.9, -1.7]",
    "scene.robot_start.y=[-0.2, 0.0]",
    "scene.robot_start.yaw=[1.3, 1.7]",
)


def text(pose: Pose2D) -> str:
    return f"{pose.x};{pose.y};{pose.theta}"


def test_a_pose_on_the_map_is_reached(kitchen) -> None:
    session, truth = kitchen()
    goal = Pose2D(-1.0, 0.4, 0.6)
    assert succeeds(session, f'<DockAt goal="{text(goal)}"/>')
    session.robot.clock.sleep(0.5)
    pose = truth.base_pose().to_pose2d()
    assert pose.distance_to(goal) < 0.01
    assert abs(wrap_angle(pose.theta - goal.theta)) < math.radians(1.0)


@pytest.mark.parametrize("seed", [3, 4])
def test_before_a_counter_that_is_off_the_map_its_front_counts(seed) -> None:
    with known_world(load_run("navigate_kitchen", seed=seed, settings=BY_FRONT)) as (session, truth):
        counter = next(piece for piece in session.setup.world.furniture if piece.name == "counter")
        asked = counter.nominal @ Pose2D(-counter.model.footprint[0] / 2 - 0.4, 0.1, 0.0)
        assert succeeds(session, f'<DockAt goal="{text(asked)}" furniture="counter"/>')
        session.robot.clock.sleep(0.5)
        wanted = counter.actual @ counter.nominal.inverse() @ asked
        off = wanted.inverse() @ truth.base_pose().to_pose2d()
        assert abs(off.x) < 0.01
        assert abs(wrap_angle(off.theta)) < math.radians(1.0)
        audit = audited(session)
        assert not audit.collisions
        assert audit.ground_truth_reads == 0


@pytest.mark.parametrize("name", ["table", "sofa"])
def test_furniture_without_a_front_that_a_lidar_sees_is_refused(driver, name) -> None:
    assert why_not(driver, f'<DockAt goal="-1;0;0" furniture="{name}"/>')[0] == "bad_input"


def test_a_piece_that_is_gone_is_reported(driver, monkeypatch) -> None:
    here = driver.skills.world.base.pose
    gone = MapFurniture("gone", here @ Pose2D(1.0, 0.0, 0.0), (0.4, 1.0), 0.9, (), True)
    monkeypatch.setattr(driver.skills.world, "map", driver.skills.world.map.with_furniture(gone))
    goal = here @ Pose2D(0.5, 0.0, 0.0)
    code, words = why_not(driver, f'<DockAt goal="{text(goal)}" furniture="gone"/>')
    assert code == "not_found"
    assert "gone" in words
