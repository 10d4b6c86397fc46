"""Drawers and doors that are believed to stand open take with them what belongs to them."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from bestman_bt.messages import Box, Handle, PlacedShape, PointCloud, Pose, Pose2D, YawSet, distance_to_shape
from bestman_bt.scene.draw import draw_world
from bestman_bt.scene.load import load_scene
from bestman_bt.scene.map_of_world import semantic_map
from bestman_bt.scene.scene_config import SceneConfig
from bestman_bt.world_model.openness import articulation_obstacles, containers_before, is_open, is_shut, openness_of
from bestman_bt.world_model.semantic_map import MapArticulation, MapFurniture, MapSurface, SemanticMap
from bestman_bt.world_model.world_model import (
    HandleBelief,
    HeldObject,
    ObjectBelief,
    ObjectChange,
    Obstacle,
    WorldModel,
)

DRAWER = "drawer_chest/drawer_3"
OPEN = 0.3


@pytest.fixture(scope="module")
def scene() -> SceneConfig:
    return load_scene("cup_in_drawer")


@pytest.fixture(scope="module")
def mapped(scene) -> SemanticMap:
    return semantic_map(draw_world(scene, 3))


@pytest.fixture(params=[0.0, 0.8, -2.4], ids="{:g} rad".format)
def believed(request, scene, mapped) -> WorldModel:
    """A chest of drawers that stands at several headings."""
    chest = mapped.furniture["drawer_chest"]
    turned = replace(chest, pose=Pose2D(chest.pose.x, chest.pose.y, request.param))
    return WorldModel(mapped.with_furniture(turned), models=dict(scene.models))


def drawn_out(world: WorldModel) -> np.ndarray:
    """How far things in the map go with a drawer that is opened."""
    heading = world.map.furniture["drawer_chest"].pose.theta
    return -OPEN * np.array([math.cos(heading), math.sin(heading), 0.0])


def cup_on(world: WorldModel, surface: str) -> ObjectBelief:
    furniture, mapped = world.surface(surface)
    pose = furniture.pose.to_pose() @ mapped.pose @ Pose([0.02, 0.05, 0.05])
    return ObjectBelief("cup", world.models["cup"], pose, 1.0, 0.001, 0.0, surface)


def handle_of(world: WorldModel, drawer: str) -> HandleBelief:
    piece = world.map.furniture["drawer_chest"]
    front = piece.pose.to_pose() @ piece.articulation(drawer).shapes[0].pose
    outwards = Pose.from_xyz_rpy((-0.05, 0.0, 0.0), (math.pi / 2, 0.0, -math.pi / 2))
    pose = front @ outwards
    handle = Handle("bar", pose, 0.007, 0.22, 0.04, pose.rotation[:, 2], 1.0, 0.001, "prismatic")
    return HandleBelief(f"drawer_chest/{drawer}_handle", handle, 0.0, "drawer_chest")


def test_the_surface_of_a_drawer_is_where_the_drawer_is(believed) -> None:
    _, closed = believed.surface(DRAWER)
    _, top = believed.surface("drawer_chest/top")
    believed.believe_articulation(DRAWER, OPEN)
    assert believed.surface(DRAWER)[1].pose.position == pytest.approx(closed.pose.position - [OPEN, 0.0, 0.0])
    assert believed.surface("drawer_chest/top")[1].pose.position == pytest.approx(top.pose.position)


def test_what_is_in_a_drawer_goes_with_it_and_what_is_not_stays(believed) -> None:
    inside, outside = cup_on(believed, DRAWER), cup_on(believed, "table/top")
    believed.objects |= {"cup": inside, "cup_2": outside}
    board = Obstacle(f"{DRAWER}/surface", (PlacedShape(Box((0.3, 0.6, 0.01)), inside.pose),), 0.0)
    believed.obstacles[board.name] = board
    assert believed.believe_articulation(DRAWER, OPEN) == ("cup",)
    assert believed.objects["cup"].pose.position == pytest.approx(inside.pose.position + drawn_out(believed))
    assert believed.objects["cup_2"].pose.position == pytest.approx(outside.pose.position)
    moved = believed.obstacles[board.name].shapes[0].pose.position
    assert moved == pytest.approx(inside.pose.position + drawn_out(believed))
    believed.believe_articulation(DRAWER, 0.0)
    assert believed.objects["cup"].pose.position == pytest.approx(inside.pose.position)


def test_a_handle_goes_with_its_own_drawer_only(believed) -> None:
    handles = [handle_of(believed, name) for name in ("drawer_2", "drawer_3")]
    believed.handles = {belief.name: belief for belief in handles}
    believed.believe_articulation(DRAWER, OPEN)
    shifts = [believed.handles[b.name].handle.pose.position - b.handle.pose.position for b in handles]
    assert shifts[0] == pytest.approx([0.0, 0.0, 0.0])
    assert shifts[1] == pytest.approx(drawn_out(believed))
    for belief in handles:  # of another piece, or away from the front, it stays
        believed.handles[belief.name] = replace(belief, furniture="table")
    believed.believe_articulation(DRAWER, 0.0)
    assert believed.handles[handles[1].name].handle.pose.position == pytest.approx(handles[1].handle.pose.position)


def test_only_what_stands_open_is_before_the_furniture_and_its_handle_with_it(believed) -> None:
    assert articulation_obstacles(believed) == ()
    belief = handle_of(believed, "drawer_3")
    believed.handles[belief.name] = belief
    believed.believe_articulation(DRAWER, OPEN)
    (drawer,) = articulation_obstacles(believed)
    assert drawer.name == DRAWER
    bar = belief.handle.pose.position + drawn_out(believed)
    front = believed.map.furniture["drawer_chest"].pose.to_pose().apply(np.array([[-0.24 - OPEN, 0.3, 0.7]]))
    free = bar + drawn_out(believed) * 0.05 / OPEN
    distances = [
        min(float(distance_to_shape(p[None], shape)[0]) for shape in drawer.shapes) for p in (bar, front[0], free)
    ]
    assert distances[0] <= 0.0
    assert distances[1] <= 1e-6
    assert distances[2] > 0.03


@pytest.mark.parametrize(("kind", "enough", "shut"), [("prismatic", 0.25, 0.02), ("revolute", 0.9 * 1.45, 0.035)])
def test_open_and_shut_hold_up_to_their_bounds(mapped, kind, enough, shut) -> None:
    chest = mapped.furniture["drawer_chest"]
    door = replace(chest.articulation("drawer_3"), kind=kind, upper=2.0)
    world = WorldModel(mapped.with_furniture(replace(chest, articulations=(door,))))
    assert is_shut(world, DRAWER)
    for position, opened, closed in (
        (shut, False, True),
        (shut + 1e-6, False, False),
        (enough - 1e-6, False, False),
        (enough, True, False),
    ):
        world.articulations[DRAWER] = position
        assert (is_open(world, DRAWER), is_shut(world, DRAWER)) == (opened, closed), position
    short = openness_of(replace(door, upper=0.2))
    assert (short.asked, short.enough) == pytest.approx((0.19, 0.171))
    assert openness_of(door).asked == {"prismatic": 0.28, "revolute": 1.45}[kind]


def test_what_stood_open_on_the_map_is_believed_to_until_it_moves(mapped) -> None:
    chest = mapped.furniture["drawer_chest"]
    ajar = replace(
        chest, articulations=tuple(replace(one, position=0.1 * i) for i, one in enumerate(chest.articulations))
    )
    world = WorldModel(mapped.with_furniture(ajar), articulations={DRAWER: 0.07})
    assert world.articulations == {"drawer_chest/drawer_2": 0.1, DRAWER: 0.07}
    world.blocked.add("table/top")
    world.believe_articulation(DRAWER, 0.071)
    assert world.blocked == {"table/top"}
    world.believe_articulation(DRAWER, 0.2)
    assert world.blocked == set()


def test_a_thing_may_be_where_it_was_not_looked_for_since_it_was_lost(mapped, scene) -> None:
    world = WorldModel(mapped, models=dict(scene.models))
    assert world.may_be_on("cup", "table/top")
    world.changes += [ObjectChange("removed", "cup", 5.0), ObjectChange("moved", "cup", 3.0)]
    world.changes.append(ObjectChange("removed", "can", 9.0))
    for stamp, may in ((4.9, True), (5.0, False), (8.0, False)):
        world.searched["cup", "table/top"] = stamp
        assert world.may_be_on("cup", "table/top") is may
    world.given_places["cup"] = DRAWER
    assert world.may_be_on("cup", DRAWER)
    assert not world.may_be_on("cup", "counter/top")
    world.searched["cup", DRAWER] = 4.0
    assert not world.may_be_on("cup", "counter/top")
    world.searched["cup", DRAWER] = 6.0
    assert world.may_be_on("cup", "counter/top")
    world.hands["arm"] = HeldObject("can", world.models["cup"], Pose(), 0.05)
    assert world.may_be_on("cup", "counter/top")
    world.hands["arm"] = HeldObject("cup", world.models["cup"], Pose(), 0.05)
    assert not world.may_be_on("cup", "counter/top")


def test_a_new_start_knows_what_was_known_at_the_first_and_shares_nothing(mapped, scene) -> None:
    world = WorldModel(mapped, models=dict(scene.models), given_places={"cup": DRAWER})
    world.locked.add(DRAWER)
    world.objects["cup"] = cup_on(world, "table/top")
    again = world.initial_beliefs()
    assert (again.objects, again.locked, again.given_places, again.base) == ({}, set(), {"cup": DRAWER}, world.base)
    again.given_places["cup"] = "table/top"
    again.models.clear()
    assert world.given_places == {"cup": DRAWER}
    assert world.models


@pytest.mark.parametrize(
    ("depth", "width", "place", "before"),
    [
        (0.6, 0.3, (0.25, 0.4), ["case/left"]),
        (0.6, 0.3, (-0.25, 0.4), ["case/right"]),
        (0.1, 0.6, (0.25, 0.4), ["case/left", "case/right"]),
        (0.1, 0.6, (-0.25, 0.4), ["case/left", "case/right"]),
        (0.6, 0.3, (0.25, 0.06), ["case/left"]),
        (0.6, 0.3, (0.25, 0.04), []),  # below the doors
    ],
)
def test_a_door_stands_before_a_board_behind_it_however_deep_that_is(depth, width, place, before) -> None:
    def door(name: str, y: float) -> MapArticulation:
        front = PlacedShape(Box((0.02, 0.4, 0.9)), Pose([-0.3, y, 0.5]))
        return MapArticulation(name, "revolute", (-0.3, 2 * y, 0.5), (0.0, 0.0, 1.0), 1.6, (front,))

    board = MapSurface("board", Pose([0.0, *place]), (depth, width))
    top = MapSurface("top", Pose([0.0, 0.0, 1.0]), (0.6, 0.8))
    case = MapFurniture(
        "case", Pose2D(), (0.6, 0.8), 1.0, (top, board), True, articulations=(door("left", 0.2), door("right", -0.2))
    )
    assert list(containers_before(case, board)) == before
    assert list(containers_before(case, top)) == []


def test_all_that_was_seen_of_an_object_turns_with_what_it_stands_on(scene) -> None:
    cloud = PointCloud(np.array([[1.0, 0.0, 0.5]]))
    belief = ObjectBelief(
        "cup",
        scene.models["cup"],
        Pose(),
        1.0,
        0.001,
        0.0,
        yaw_set=YawSet(((0.5, 0.1),)),
        cloud=cloud,
        viewpoint=np.array([0.0, 2.0, 1.0]),
    )
    moved = belief.moved(Pose.from_xyz_rpy((3.0, 0.0, 0.0), (0.0, 0.0, math.pi / 2)))
    assert moved.pose.yaw == pytest.approx(math.pi / 2)
    assert moved.yaw_set.arcs == (pytest.approx((0.5 + math.pi / 2, 0.1)),)
    assert moved.cloud is not None
    np.testing.assert_allclose(moved.cloud.points, [[3.0, 1.0, 0.5]], atol=1e-9)
    np.testing.assert_allclose(moved.viewpoint, [1.0, 0.0, 1.0], atol=1e-9)
