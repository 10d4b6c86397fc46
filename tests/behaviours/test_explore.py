"""Exploring a place that the robot knows nothing of: two rooms behind a doorway, with a table to keep clear of."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from bestman_bt.engine import RUNNING
from bestman_bt.messages.grids import FREE, OCCUPIED
from bestman_bt.navigation.map_file import read_map
from bestman_bt.navigation.slam.base import SlamEstimate
from bestman_bt.runtime.executor import Execution
from bestman_bt.runtime.robot_session import RobotSession, session
from bestman_bt.scene.map_of_world import semantic_map
from hal.api import MobileBase
from tests.behaviours.at_the_table import fastest, tick, tree_of

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("maps") / "kitchen.yaml"


@pytest.fixture(scope="module")
def explored(file: Path) -> Iterator[tuple[RobotSession, Execution]]:
    with session(seed=1) as opened:
        yield opened, opened.run(tree_of(f'<ExploreAndMap file="{file}" max_time="120"/>'))


def test_it_ends_when_nothing_is_left_to_see_and_has_touched_nothing(explored: tuple[RobotSession, Execution]) -> None:
    opened, execution = explored
    assert execution.tree_status == "SUCCESS", opened.skills.failures
    assert not opened.robot.audit_record().contacts
    assert fastest(opened) < 0.01


def test_the_saved_map_shows_both_rooms_with_their_walls(explored: tuple[RobotSession, Execution], file: Path) -> None:
    grid = read_map(file)
    walls = semantic_map(explored[0].setup.world).walls
    # The map begins where the robot was told to be, which is up to 3 cm and 1.2 degrees off.
    cells = grid.to_points(np.argwhere(grid.data == OCCUPIED))
    found = []
    for x1, y1, x2, y2 in walls:
        along = np.linspace(0.0, 1.0, 40)[:, None]
        points = (x1, y1) + along * np.array([x2 - x1, y2 - y1])
        found += [float(np.linalg.norm(cells - point, axis=1).min()) for point in points]
    assert np.mean(np.array(found) < 0.15) > 0.85  # a part of the walls stands behind the counter
    for room in ([-1.5, -0.5], [1.5, 1.0]):
        assert grid.data[tuple(grid.to_cells(room))] == FREE


def test_afterwards_the_base_drives_by_its_old_map_again(explored: tuple[RobotSession, Execution]) -> None:
    opened = explored[0]
    execution = opened.run(tree_of('<NavigateTo goal="-2.0;-0.8;0"/>'))
    assert execution.tree_status == "SUCCESS", opened.skills.failures


def test_halted_on_the_way_it_stops_and_gives_the_old_localisation_back() -> None:
    with session(seed=2) as opened:
        tree = opened.load(tree_of("<ExploreAndMap/>"))
        base = opened.robot.part("base", MobileBase)
        while base.velocity().vx < 0.2:
            assert tick(tree) == RUNNING, opened.skills.failures
        tree.halt()
        clock = opened.robot.clock
        clock.sleep(0.5)
        assert fastest(opened) < 0.01
        clock.sleep(0.3)
        assert opened.skills.base.localisation.estimate.match is not None
        assert opened.skills.base.localisation.estimate.match.accepted
        assert not isinstance(opened.skills.base.localisation.estimate, SlamEstimate)


def test_time_that_is_up_is_reported_and_the_map_is_saved_all_the_same(tmp_path: Path) -> None:
    with session(seed=2) as opened:
        file = tmp_path / "part.yaml"
        execution = opened.run(tree_of(f'<ExploreAndMap file="{file}" max_time="2"/>'))
        assert execution.tree_status == "FAILURE"
        assert opened.skills.failures[-1].error_code == "timeout"
        assert (read_map(file).data == FREE).sum() > 1000


@pytest.mark.parametrize(
    ("range_max", "words"), [("70 cm", "not seen anything"), ("1.5 m", "too little known free space")]
)
def test_a_lidar_that_sees_too_little_to_drive_is_reported_and_no_finished_map(range_max: str, words: str) -> None:
    with session(seed=2, settings=[f"robot.parts.lidar.set.range_max={range_max}"]) as opened:
        execution = opened.run(tree_of("<ExploreAndMap/>"))
        assert execution.tree_status == "FAILURE"
        failure = opened.skills.failures[-1]
        assert failure.error_code == "start_blocked"
        assert words in failure.why
