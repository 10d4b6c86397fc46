"""Drawers and doors that are believed to stand open take with them what belongs to them."""

from __future__ import annotations

import math

import numpy as np
import pytest

from bestman_bt.messages import Box, Handle, PlacedShape, Pose, distance_to_shape
from bestman_bt.scene import draw_world, load_scene, semantic_map
from bestman_bt.world_model import HandleBelief, ObjectBelief, Obstacle, WorldModel, open_leaves

DRAWER = "drawer_chest/drawer_3"
OPEN = 0.3


@pytest.fixture
def believed() -> WorldModel:
    scene = load_scene("cup_in_drawer")
    return WorldModel(semantic_map(draw_world(scene, 3)), models=dict(scene.models))


def cup_on(world: WorldModel, surface: str) -> ObjectBelief:
    furniture, mapped = world.surface(surface)
    pose = furniture.pose.to_pose() @ mapped.pose @ Pose([0.02, 0.05, 0.05])
    return ObjectBelief("cup", world.models["cup"], pose, 1.0, 0.001, 0.0, surface)


def handle_of(world: WorldModel, drawer: str) -> HandleBelief:
    piece = world.map.furniture["drawer_chest"]
    front = piece.pose.to_pose() @ piece.leaf(drawer).shapes[0].pose
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
    assert believed.objects["cup"].pose.position == pytest.approx(inside.pose.position - [OPEN, 0.0, 0.0])
    assert believed.objects["cup_2"].pose.position == pytest.approx(outside.pose.position)
    moved = believed.obstacles[board.name].shapes[0].pose.position
    assert moved == pytest.approx(inside.pose.position - [OPEN, 0.0, 0.0])
    believed.believe_articulation(DRAWER, 0.0)
    assert believed.objects["cup"].pose.position == pytest.approx(inside.pose.position)


def test_a_handle_goes_with_its_own_drawer_only(believed) -> None:
    handles = [handle_of(believed, name) for name in ("drawer_2", "drawer_3")]
    believed.handles = {belief.name: belief for belief in handles}
    believed.believe_articulation(DRAWER, OPEN)
    shifts = [believed.handles[b.name].handle.pose.position - b.handle.pose.position for b in handles]
    assert shifts[0] == pytest.approx([0.0, 0.0, 0.0])
    assert shifts[1] == pytest.approx([-OPEN, 0.0, 0.0])


def test_only_what_stands_open_is_before_the_furniture_and_its_handle_with_it(believed) -> None:
    assert open_leaves(believed) == ()
    belief = handle_of(believed, "drawer_3")
    believed.handles[belief.name] = belief
    believed.believe_articulation(DRAWER, OPEN)
    (drawer,) = open_leaves(believed)
    assert drawer.name == DRAWER
    bar = belief.handle.pose.position - np.array([OPEN, 0.0, 0.0])
    front = believed.map.furniture["drawer_chest"].pose.to_pose().apply(np.array([[-0.24 - OPEN, 0.3, 0.7]]))
    free = bar + np.array([-0.05, 0.0, 0.0])
    distances = [
        min(float(distance_to_shape(p[None], shape)[0]) for shape in drawer.shapes) for p in (bar, front[0], free)
    ]
    assert distances[0] <= 0.0
    assert distances[1] <= 1e-6
    assert distances[2] > 0.03
