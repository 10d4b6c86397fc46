"""What a session tells of a simulated robot: its map, its joints, its lidar, and what it saw before a failure."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from behaviours.manipulation.move_arm import MoveArm
from behaviours.skill import ErrorReporting
from bestman_bt.engine import Sequence, SyncAction
from bestman_bt.records.events import EndEvent, Event, ImageEvent, MapEvent, RobotEvent, RunEvent, ScanEvent
from bestman_bt.records.reader import read_events, read_log
from bestman_bt.runtime.robot_session import RobotSession, session


class LookAndGiveUp(ErrorReporting, SyncAction):
    """Takes a picture and fails."""

    def on_tick(self) -> int:
        self.skills.camera.capture()
        return self.explain("nothing_there", "nothing is there")


@pytest.fixture(scope="module")
def opened() -> RobotSession:
    with session(scene="kitchen", seed=3) as opened:
        yield opened


@pytest.fixture(scope="module")
def folder(opened: RobotSession, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("run")
    tree = opened.load(Sequence(MoveArm(posture="look"), LookAndGiveUp(name="look")))
    executor = opened.executor(tree)
    with opened.telemetry(executor, folder) as telemetry:
        telemetry.end_as(executor.run())
    return folder


@pytest.fixture(scope="module")
def events(folder: Path) -> list[Event]:
    return list(read_events(folder))


def test_the_run_is_reported_with_what_the_configuration_names(events: list[Event], folder: Path) -> None:
    run = events[0]
    assert isinstance(run, RunEvent)
    assert (run.task, run.scene, run.robot, run.seed) == ("session", "kitchen", "diff_panda", 3)
    assert (run.clock, run.tick_rate, run.folder) == ("simulated", 20.0, str(folder))
    assert isinstance(events[-1], EndEvent)
    assert events[-1].outcome == "failure"


def test_the_map_is_reported_once_with_walls_and_furniture(events: list[Event], opened: RobotSession) -> None:
    maps = [event for event in events if isinstance(event, MapEvent)]
    assert len(maps) == 1
    plan = opened.skills.world.map
    assert {piece.name for piece in maps[0].furniture} == set(plan.furniture)
    np.testing.assert_allclose(maps[0].walls, plan.walls, atol=1e-4)


def test_the_robot_is_told_five_times_a_second_with_its_belief_and_its_joints(
    events: list[Event], opened: RobotSession
) -> None:
    told = [event for event in events if isinstance(event, RobotEvent)]
    gaps = np.diff([event.time for event in told])
    assert gaps.min() == pytest.approx(0.2, abs=0.011)
    assert gaps.max() == pytest.approx(0.2, abs=0.051)
    believed = opened.skills.world.base.pose
    assert told[-1].base == pytest.approx((believed.x, believed.y, believed.theta), abs=0.02)
    joints = opened.skills.joints.positions()
    assert told[-1].joints.keys() == joints.keys()
    assert told[-1].joints["panda_joint4"] == pytest.approx(-1.26, abs=0.02)


def test_scans_lie_on_the_walls_and_furniture_of_the_map(events: list[Event], opened: RobotSession) -> None:
    scans = [event for event in events if isinstance(event, ScanEvent)]
    assert scans
    x_min, y_min, x_max, y_max = opened.skills.world.map.bounds(0.1)
    points = np.array(scans[-1].points)
    inside = (points > (x_min, y_min)).all(axis=1) & (points < (x_max, y_max)).all(axis=1)
    assert len(points) > 50
    assert inside.mean() > 0.95


def test_a_failure_is_reported_with_the_picture_of_that_moment(events: list[Event], folder: Path) -> None:
    failures = [line for line in read_log(folder) if line.level == "warning"]
    assert [(line.node, line.code, line.message) for line in failures] == [
        ("look", "nothing_there", "nothing is there")
    ]
    pictures = [event for event in events if isinstance(event, ImageEvent)]
    assert [(picture.node, picture.time) for picture in pictures] == [("look", failures[0].time)]
    with Image.open(folder / pictures[0].file) as image:
        assert image.size == (pictures[0].width, pictures[0].height)
        assert image.width <= 320
        assert np.asarray(image).std() > 5.0
