"""Where skills look before they have seen anything: at furniture that stands askew, from a base that does, too."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from behaviours.computation import Computation
from bestman_bt.control import Motion
from bestman_bt.engine import FAILURE, RUNNING, SUCCESS
from bestman_bt.messages import Box, PlacedShape, Pose, Pose2D
from bestman_bt.perception.affordance.front_handles import HandleScene
from bestman_bt.perception.occupancy import VoxelRegion
from bestman_bt.robot_model.model import BaseModel
from bestman_bt.scene.furniture_file import read_furniture
from bestman_bt.world_model.semantic_map import MapArticulation, MapFurniture
from tests.behaviours.scripted import codes, load, run, scripted_skills
from tests.perception.seen_boxes import looking_at, view_of

TURNED = Pose2D(1.3, 0.4, 2.5)
DRAWER = "drawer_chest/drawer_3"


def beside(task: str, furniture: str) -> Any:
    """Skills on whose map the piece stands at TURNED."""
    skills = scripted_skills(task)
    piece = skills.world.map.furniture[furniture]
    skills.world.map = skills.world.map.with_furniture(replace(piece, pose=TURNED))
    return skills


@pytest.fixture
def views() -> Callable[..., list[Pose]]:
    """What a hand that reaches nothing was asked for: poses of its camera in the map frame."""

    def asked(skills: Any, ports: str = "", **entries: Any) -> list[Pose]:
        poses: list[Pose] = []

        def solve(base_from_tool: Pose, *_: Any) -> SimpleNamespace:
            poses.append(skills.map_from_base @ base_from_tool)
            return SimpleNamespace(solutions=[])

        skills.kinematics = SimpleNamespace(solve=solve)
        skills.planning_scene, skills.arm_world = lambda: None, lambda _: SimpleNamespace(is_free=None)
        skills.base_from_tool = Pose  # the camera is where the tool is
        skills.wrist_camera = SimpleNamespace(base_from_camera=Pose)
        assert run(skills, load(skills, f'<LookInto surface="{DRAWER}" {ports}/>', **entries)) == FAILURE
        assert codes(skills) == ["no_view"]
        return poses

    return asked


@pytest.mark.parametrize("opening", [0.15, 0.3])
def test_of_a_drawer_the_part_that_is_out_is_looked_at_from_straight_above(
    views: Callable[..., list[Pose]], opening: float
) -> None:
    skills = beside("fetch_from_drawer", "drawer_chest")
    chest, closed = skills.world.map.surface(DRAWER)
    skills.world.believe_articulation(DRAWER, opening)
    first = views(skills)[0]
    edge = closed.pose.position[0] - closed.size[0] / 2 - opening
    middle = (edge - chest.footprint[0] / 2) / 2
    at = TURNED.to_pose().apply(np.array([[middle, *closed.pose.position[1:]]]))[0]
    np.testing.assert_allclose(first.position, (at[0], at[1], at[2] + 0.48), atol=1e-9)
    np.testing.assert_allclose(first.rotation[:, 2], [0.0, 0.0, -1.0], atol=1e-9)


def test_the_picture_lies_along_the_longer_side_and_may_lean_across_it(views: Callable[..., list[Pose]]) -> None:
    poses = views(beside("fetch_from_drawer", "drawer_chest"))
    wide, deep = TURNED.to_pose().rotation[:, 1], TURNED.to_pose().rotation[:, 0]
    for pose in poses:
        assert abs(float(pose.rotation[:, 0] @ wide)) == pytest.approx(1.0)
    # The second ones lean so that they look away from who stands before the chest, whose front faces -x.
    assert [float(pose.rotation[:, 2] @ deep) for pose in poses[2:4]] == pytest.approx([np.sin(np.radians(12.0))] * 2)


def test_a_point_goes_before_a_thing_and_a_thing_before_the_drawer(views: Callable[..., list[Pose]]) -> None:
    point = Pose(np.array([0.9, 0.2, 0.6]))
    poses = views(beside("fetch_from_drawer", "drawer_chest"), 'point="{point}"', point=point)
    np.testing.assert_allclose(poses[0].position, [0.9, 0.2, 0.6 + 0.48], atol=1e-9)


@pytest.fixture
def scanned(monkeypatch: pytest.MonkeyPatch) -> Callable[..., tuple[np.ndarray, VoxelRegion]]:
    """Where the head looked in a scan, (N, 3) in the map frame, and the box that was mapped."""

    def scan(skills: Any, ports: str) -> tuple[np.ndarray, VoxelRegion]:
        regions: list[VoxelRegion] = []
        scene = SimpleNamespace(detections=(), unknown=(), plane=None)
        monkeypatch.setattr("behaviours.perception.scan.surface_region", lambda *_: None)
        monkeypatch.setattr("behaviours.perception.scan.believe_surface", lambda *_: ())
        skills.camera = SimpleNamespace(capture=lambda: SimpleNamespace(in_base=None, in_map=None))
        skills.detection = SimpleNamespace(detect=lambda *_: scene)
        skills.surfaces = SimpleNamespace(find=lambda *_: ())
        skills.occupancy = SimpleNamespace(fuse=lambda views, region: regions.append(region))
        assert run(skills, load(skills, f"<ScanScene {ports}/>")) == SUCCESS
        points = np.array([point for _, point in skills.head.asked])
        return skills.map_from_base.apply(points), regions[0]

    return scan


def test_views_of_a_surface_are_spread_along_its_longer_side_the_middle_first(
    scanned: Callable[..., tuple[np.ndarray, VoxelRegion]],
) -> None:
    skills = beside("fetch_cup", "table")
    _, top = skills.world.map.surface("table")
    points, region = scanned(skills, 'surface="table" views="3"')
    across = 0.3 * top.size[1]  # to each side, of a table that is 0.8 m deep and 1.2 m wide
    local = TURNED.to_pose().inverse().apply(points)
    np.testing.assert_allclose(local[0, :2], [0.0, 0.0], atol=1e-9)
    assert sorted(local[1:, 1]) == pytest.approx([-across, across])
    assert local[:, 2] == pytest.approx([top.pose.position[2]] * 3)
    assert region.size[:2] == pytest.approx((top.size[0] + 0.6, top.size[1] + 0.6))
    assert region.frame_from_region.yaw == pytest.approx(TURNED.theta)
    np.testing.assert_allclose(region.frame_from_region.position[:2], TURNED.xy, atol=1e-9)


def test_a_scan_of_no_surface_turns_the_head_about_what_is_ahead(
    scanned: Callable[..., tuple[np.ndarray, VoxelRegion]],
) -> None:
    skills = beside("fetch_cup", "table")
    points, region = scanned(skills, 'views="3"')
    base = skills.world.base.pose
    bearings = [float(np.arctan2(*(point[:2] - base.xy)[::-1])) - base.theta for point in points]
    assert bearings[0] == pytest.approx(0.0)
    assert sorted(bearings) == pytest.approx([-0.6, 0.0, 0.6])
    assert region.frame_from_region.yaw == pytest.approx(base.theta)


def test_a_door_that_is_seen_to_stand_open_is_looked_at_from_before_its_front_again() -> None:
    skills, door = scripted_skills("close_fridge"), "fridge/upper_door"
    skills.base.model = skills.robot.of(BaseModel)["base"]
    tree = load(skills, f'<FindLookStand articulation="{door}" stand="{{stand}}" front="{{front}}"/>')

    def beside_the_front() -> float:
        """Degrees from straight before the front, as it is believed, to the stand."""
        assert run(skills, tree) == SUCCESS
        stand, front = tree.blackboard.get("stand"), tree.blackboard.get("front")
        x, y, _ = front.inverse().apply(np.array([[stand.x, stand.y, front.position[2]]]))[0]
        return float(np.degrees(np.arctan2(-y, -x)))

    assert beside_the_front() == pytest.approx(0.0, abs=1e-6)
    assert beside_the_front() == pytest.approx(50.0)
    skills.world.believe_articulation(door, 0.96)
    assert beside_the_front() == pytest.approx(0.0, abs=1e-6)
    assert beside_the_front() == pytest.approx(50.0)


UPPER_DOOR = "fridge/upper_door"
BOARD = Box((2.0, 0.1, 2.2))
"""Stands beside the fridge, where its door could be open."""


def before_the_open_fridge(*beside: PlacedShape) -> Any:
    """Skills whose camera sees the edge of the upper door, which is open by 40 degrees, and no handle.

    ``beside``: what else there is, in the fridge's frame.
    """
    skills = scripted_skills("close_fridge")
    piece = skills.world.map.furniture["fridge"]
    frame, leaf, model = piece.pose.to_pose(), piece.articulation("upper_door"), read_furniture("fridge")
    moved = {"upper_door": frame @ leaf.moved(math.radians(40.0))}
    boards = [PlacedShape(part.shape, frame @ part.pose) for part in (*model.parts, *beside)]
    boards += [
        PlacedShape(part.shape, moved.get(one.name, frame) @ part.pose)
        for one in model.articulations
        for part in one.parts
        if isinstance(part.shape, Box)
    ]
    eye, target = frame.apply(np.array([[-2.4, 1.3, 1.3], [-0.4, -0.1, 1.2]]))
    seen = SimpleNamespace(
        in_base=None, in_map=view_of(boards, looking_at(eye, target)), map_from_base=Pose(), stamp=1.0
    )
    skills.camera = SimpleNamespace(capture=lambda: seen)
    skills.affordance = SimpleNamespace(detect=lambda *_: HandleScene((), (), "no upright plane in view"))
    return skills


def detect_upper_door(skills: Any) -> float:
    """The believed opening of the door after its handle was looked for in vain, radians."""
    assert run(skills, load(skills, f'<DetectHandle articulation="{UPPER_DOOR}"/>')) == FAILURE
    assert codes(skills) == ["handle_not_found"]
    return float(skills.world.articulations[UPPER_DOOR])


def test_a_door_whose_edge_alone_is_seen_is_believed_to_be_open_though_its_handle_is_not_found() -> None:
    assert detect_upper_door(before_the_open_fridge()) == pytest.approx(math.radians(40.0), abs=0.06)


@pytest.mark.parametrize("solid_at_lidar", [True, False])
def test_other_furniture_where_a_door_could_be_is_not_taken_for_it(solid_at_lidar: bool) -> None:
    skills = before_the_open_fridge(PlacedShape(BOARD, Pose(np.array([-0.6, -0.39, 1.1]))))
    place = skills.world.map.furniture["fridge"].pose @ Pose2D(-0.6, -0.39, 0.0)
    cupboard = MapFurniture("cupboard", place, BOARD.size[:2], 2.2, (), solid_at_lidar)
    skills.world.map = skills.world.map.with_furniture(cupboard)
    assert detect_upper_door(skills) == pytest.approx(math.radians(40.0), abs=0.06)


def test_the_open_door_of_other_furniture_is_not_taken_for_the_one_that_is_looked_at() -> None:
    skills = before_the_open_fridge(PlacedShape(BOARD, Pose(np.array([-0.6, -0.39, 1.1]))))
    door = MapArticulation(
        "door",
        "prismatic",
        (0.0, 0.0, 0.0),
        (-1.0, 0.0, 0.0),
        2.5,
        (PlacedShape(BOARD, Pose.from_xyz_rpy((0, 0, 1.1))),),
    )
    place = skills.world.map.furniture["fridge"].pose @ Pose2D(1.4, -0.39, 0.0)
    cupboard = MapFurniture("cupboard", place, BOARD.size[:2], 2.2, (), False, articulations=(door,))
    skills.world.map = skills.world.map.with_furniture(cupboard)
    skills.world.believe_articulation("cupboard/door", 2.0)
    assert detect_upper_door(skills) == pytest.approx(math.radians(40.0), abs=0.06)


def test_the_opening_of_a_door_is_computed_beside_the_ticks() -> None:
    works: list[tuple[Motion[Any], Callable[[], Any]]] = []

    class Asked(Computation):
        def submit(self, work: Callable[[], Any], cost: float) -> Motion[Any]:
            """Leave the work to the test."""
            works.append((Motion(), work))
            return works[-1][0]

    skills = before_the_open_fridge()
    skills.computation = Asked()
    tree = load(skills, f'<DetectHandle articulation="{UPPER_DOOR}"/>')
    for _ in ("detection of handles", "opening by rays"):
        assert tree.tick_once() == RUNNING
        assert UPPER_DOOR not in skills.world.articulations
        motion, work = works.pop()
        motion.succeed(work())
    assert tree.tick_once() == FAILURE
    assert skills.world.articulations[UPPER_DOOR] == pytest.approx(math.radians(40.0), abs=0.06)
