"""What the robot believes after a scan, against the truth; and what it notices of a world that has changed."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from bestman_bt.configuration.run import RunRequest
from bestman_bt.engine import SUCCESS
from bestman_bt.messages import VOXEL_FREE, VOXEL_OCCUPIED
from bestman_bt.runtime.perception_preview import furniture_to_look_at, run_in_front_of
from bestman_bt.runtime.robot_session import RobotSession
from hal.simulation.ground_truth import GroundTruth
from hal.simulation.sensor_pipeline import SensorFault
from tests.behaviours.at_the_table import tick, tree_of
from tests.behaviours.truth import known_world, put, succeeds, table_with, why_not

pytestmark = pytest.mark.slow

ON_THE_SHELF = ("bottle", "soup_can", "cereal_box")
ALL_THERE = tuple(f"scene.objects.{name}.presence=1" for name in ON_THE_SHELF)
SCAN_TABLE = (
    '<Sequence><LookAt surface="table"/><ScanScene surface="table" objects="{seen}" changes="{changes}"/></Sequence>'
)
DETECT_CUP = '<Sequence><LookAt surface="table"/><DetectObject object="cup" surface="table"/></Sequence>'


@pytest.fixture(scope="module")
def at_shelf() -> Iterator[tuple[RobotSession, GroundTruth]]:
    """A robot before a shelf with things on two of its boards, which it has scanned."""
    asked = RunRequest(scene="kitchen_furnished", robot="diff_panda", seed=5, settings=ALL_THERE)
    shelf = furniture_to_look_at(asked)["shelf"]
    with known_world(run_in_front_of(shelf, asked)) as (session, truth):
        boards = [
            f'<LookAt surface="shelf/{b}"/><ScanScene surface="shelf/{b}" views="1"/>' for b in ("board_2", "board_3")
        ]
        assert succeeds(session, f'<Sequence><MoveArm posture="look"/>{"".join(boards)}</Sequence>')
        yield session, truth


@pytest.fixture(scope="module")
def table(tmp_path_factory) -> Iterator[tuple[RobotSession, GroundTruth]]:
    """A robot that has scanned a table with a cup, a can and a box."""
    config = table_with(
        tmp_path_factory.mktemp("scene"),
        heading=0.0,
        cup=("cup", -0.15, -0.1, 0.0),
        can=("can", -0.2, 0.15, 0.0),
        box=("box", 0.1, 0.05, 30.0),
    )
    with known_world(config) as (session, truth):
        assert succeeds(session, SCAN_TABLE)
        yield session, truth


def errors(session: RobotSession, truth: GroundTruth, names: tuple[str, ...]) -> dict[str, float]:
    """Metres between belief and truth, by name."""
    objects = session.skills.world.objects
    return {n: float(np.linalg.norm(objects[n].pose.position - truth.object_pose(n).position)) for n in names}


def test_everything_on_the_boards_of_a_shelf_is_found_where_it_is(at_shelf) -> None:
    session, truth = at_shelf
    objects = session.skills.world.objects
    assert set(objects) == set(ON_THE_SHELF)
    assert max(errors(session, truth, ON_THE_SHELF).values()) < 0.01
    assert {name: belief.surface for name, belief in objects.items()} == {
        "bottle": "shelf/board_3",
        "soup_can": "shelf/board_3",
        "cereal_box": "shelf/board_2",
    }


def test_a_scan_of_no_surface_in_particular_finds_the_same_on_the_same_boards(at_shelf) -> None:
    session, truth = at_shelf
    before = dict(session.skills.world.objects)
    assert succeeds(session, '<ScanScene views="1"/>')
    objects = session.skills.world.objects
    assert set(objects) == set(before)
    assert all(objects[name].stamp > before[name].stamp for name in ("bottle", "soup_can"))
    assert max(errors(session, truth, ON_THE_SHELF).values()) < 0.01
    assert {n: b.surface for n, b in objects.items()} == {n: b.surface for n, b in before.items()}


def test_a_scan_joins_its_views_and_finds_everything_and_nothing_else(table) -> None:
    session, truth = table
    assert set(session.skills.world.objects) == {"cup", "can", "box"}
    assert max(errors(session, truth, ("cup", "can", "box")).values()) < 0.005
    assert all(len(session.skills.observations[name]) == 3 for name in ("cup", "can", "box"))


def test_space_is_free_above_the_table_and_filled_where_things_stand(table) -> None:
    session, truth = table
    grid, cup = session.skills.world.occupancy, truth.object_pose("cup").position
    top = cup[2] - session.skills.world.models["cup"].size[2] / 2
    square = np.array([[x, y, 0.0] for x in (-0.04, 0.0, 0.04) for y in (-0.04, 0.0, 0.04)])
    beside = np.array([cup[0], cup[1] - 0.15, top])
    assert (grid.state_at(beside + square - [0.0, 0.0, 0.003]) == VOXEL_OCCUPIED).mean() > 0.8
    for height in (0.06, 0.1, 0.2, 0.3):
        assert (grid.state_at(beside + square + [0.0, 0.0, height]) == VOXEL_FREE).all()
    to_robot = truth.base_pose().position[:2] - cup[:2]
    front = cup + 0.035 * np.array([*to_robot, 0.0]) / np.linalg.norm(to_robot)
    for height in (-0.02, 0.0, 0.02):
        assert (grid.state_at(front + square / 4 + [0.0, 0.0, height]) == VOXEL_OCCUPIED).any()


def test_identities_stay_when_nothing_has_changed(table) -> None:
    session, _ = table
    before = {name: belief.since for name, belief in session.skills.world.objects.items()}
    tree = session.load(tree_of(SCAN_TABLE))
    assert tick(tree, 500) == SUCCESS
    assert (sorted(tree.blackboard.get("seen")), tree.blackboard.get("changes")) == (["box", "can", "cup"], [])
    assert {name: belief.since for name, belief in session.skills.world.objects.items()} == before


def test_what_was_moved_is_noticed_and_keeps_its_name(table) -> None:
    session, truth = table
    put(session, "can", [0.02, 0.09, 0.0])
    noticed = len(session.skills.world.changes)
    assert succeeds(session, SCAN_TABLE)
    assert [(c.kind, c.name) for c in session.skills.world.changes[noticed:]] == [("moved", "can")]
    assert max(errors(session, truth, ("cup", "can", "box")).values()) < 0.005


def test_what_was_taken_away_is_not_found_any_more(table) -> None:
    session, _ = table
    put(session, "cup", [-6.0, 0.0, 0.0])
    noticed = len(session.skills.world.changes)
    code, words = why_not(session, DETECT_CUP)
    assert code == "not_found"
    assert words.startswith("no cup on the table: seen ")
    assert "can (" in words
    assert [(c.kind, c.name) for c in session.skills.world.changes[noticed:]] == [("removed", "cup")]
    assert "cup" not in session.skills.world.objects
    assert why_not(session, '<EstimatePose object="cup"/>')[0] == "not_found"
    put(session, "cup", [6.0, 0.0, 0.0])


def test_a_scan_without_any_picture_fails_and_changes_no_belief(table) -> None:
    session, _ = table
    before = dict(session.skills.world.objects)
    camera = session.robot.parts["head_camera"]
    camera.fault = SensorFault.BLACK
    code, words = why_not(session, SCAN_TABLE)
    camera.fault = None
    assert code == "camera_black"
    assert words == "head_camera gave a black image"
    assert session.skills.world.objects == before


def test_a_scan_of_a_surface_that_is_not_there_reports_why(table) -> None:
    assert why_not(table[0], '<ScanScene surface="piano"/>')[0] == "unknown_surface"
