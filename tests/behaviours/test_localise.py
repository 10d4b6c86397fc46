"""A robot that does not know where it is finds itself on the map, or says why not."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import replace

import numpy as np
import pytest

from bestman_bt.configuration.run import load_run
from bestman_bt.messages import LaserScan, Pose2D, wrap_angle
from bestman_bt.navigation.localization.base import Place
from bestman_bt.runtime.robot_session import RobotSession
from bestman_bt.world_model.semantic_map import SemanticMap
from hal.api import Lidar
from hal.simulation.ground_truth import GroundTruth
from tests.behaviours.truth import audited, known_world, succeeds, why_not

pytestmark = pytest.mark.slow

FIND = "<Relocalise/>"


@pytest.fixture
def anywhere() -> Iterator[Callable[..., tuple[RobotSession, GroundTruth]]]:
    """Opens sessions of a robot in the kitchen that nobody has told where it is."""
    with ExitStack() as stack:

        def opened(*settings: str) -> tuple[RobotSession, GroundTruth]:
            config = load_run("navigate_from_anywhere", scene="kitchen", seed=1, settings=settings)
            return stack.enter_context(known_world(config))

        yield opened


def error(session: RobotSession, truth: GroundTruth) -> tuple[float, float]:
    """Metres and radians between where the base is and where it believes to be."""
    believed, actual = session.skills.world.base.pose, truth.base_pose().to_pose2d()
    return believed.distance_to(actual), abs(wrap_angle(believed.theta - actual.theta))


def look_out(
    session: RobotSession, monkeypatch: pytest.MonkeyPatch, change: Callable[[np.ndarray], np.ndarray]
) -> None:
    """Let the lidar see something else from now on."""
    lidar = session.robot.part("lidar", Lidar)
    scan = lidar.scan

    def changed() -> LaserScan:
        seen = scan()
        return replace(seen, ranges=change(seen.ranges))

    monkeypatch.setattr(lidar, "scan", changed)


def test_a_robot_without_a_start_pose_localises_itself_and_drives_on(anywhere) -> None:
    session, truth = anywhere()
    assert why_not(session, "<InitialPoseReceived/>")[0] == "no_pose"
    assert error(session, truth)[0] > 0.5
    begin = session.robot.clock.now()
    assert succeeds(session, FIND)
    assert session.robot.clock.now() - begin < 20.0
    position, heading = error(session, truth)
    assert position < 0.02
    assert heading < math.radians(0.5)
    assert succeeds(session, "<InitialPoseReceived/>")
    here = session.skills.world.base.pose
    assert succeeds(session, f'<NavigateTo goal="{here.x + 0.3};{here.y};{here.theta}"/>')
    assert audited(session).ground_truth_reads == 0


def test_without_a_pose_the_base_does_not_drive(anywhere) -> None:
    session, truth = anywhere()
    before = truth.base_pose().to_pose2d()
    assert why_not(session, '<NavigateTo goal="0.6;-1.0;0.0"/>')[0] in ("lost", "start_blocked", "start_outside")
    assert truth.base_pose().to_pose2d().distance_to(before) < 0.005


def test_a_believed_pose_that_is_wrong_is_given_up(anywhere) -> None:
    session, truth = anywhere()
    session.skills.base.believe(Pose2D(2.2, 1.0, 0.5), 0.03, 0.02)
    session.robot.clock.sleep(1.0)
    assert why_not(session, "<InitialPoseReceived/>")[0] == "lost"
    assert succeeds(session, FIND)
    assert error(session, truth)[0] < 0.02


def test_it_turns_until_there_is_one_place_and_gives_up_after_the_last_look(anywhere, monkeypatch) -> None:
    session, truth = anywhere()
    looks: list[int] = []

    class Undecided:
        def locate(self, planar_map, scans, base_from_lidar):
            looks.append(len(scans))
            return Place(Pose2D(), 0.5, 0.01, 0.01, 0.9), Place(Pose2D(1.0, 0.0, 0.0), 0.5, 0.01, 0.01, 0.9)

    monkeypatch.setattr(session.skills, "global_localization", Undecided())
    before = truth.base_pose().to_pose2d()
    code, words = why_not(session, '<Relocalise looks="3" turn="0.5"/>')
    turned = wrap_angle(truth.base_pose().to_pose2d().theta - before.theta)
    assert code == "ambiguous"
    assert "2 places" in words
    assert looks == [1, 2, 3]
    assert turned == pytest.approx(1.0, abs=0.1)


def test_it_does_not_turn_where_something_is_too_near(anywhere, monkeypatch) -> None:
    session, truth = anywhere()
    look_out(session, monkeypatch, lambda ranges: np.where(np.arange(len(ranges)) < 30, 0.38, ranges))
    before = truth.base_pose().to_pose2d()
    assert why_not(session, '<Relocalise certainty="0.9999999999999999"/>')[0] == "no_room"
    assert abs(wrap_angle(truth.base_pose().to_pose2d().theta - before.theta)) < 0.01


def test_a_building_that_is_not_on_the_map_is_reported(anywhere, monkeypatch) -> None:
    session, _ = anywhere()
    corners = 1.2 * np.array([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)])
    elsewhere = SemanticMap(np.hstack([corners, np.roll(corners, -1, axis=0)]), {})
    monkeypatch.setattr(session.skills.world, "map", elsewhere)
    assert why_not(session, '<Relocalise looks="1"/>')[0] == "not_on_map"
