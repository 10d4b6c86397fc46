"""A front that is seen tells where the piece stands, if it may be that front and is shut."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from behaviours.furniture.articulation_measurement import (
    HEADING_ERROR,
    POSITION_ERROR,
    believe_place,
    believe_shut_fronts,
)
from bestman_bt.messages import Handle, Pose, Pose2D
from bestman_bt.scene.draw import draw_world
from bestman_bt.scene.load import load_scene
from bestman_bt.scene.map_of_world import semantic_map
from bestman_bt.world_model.world_model import WorldModel

OFF = Pose2D(0.025, -0.02, math.radians(1.5))
FRONT = (-0.24, 0.0, 0.7033)
SIZE = (0.796, 0.253)


@pytest.fixture
def believed() -> WorldModel:
    return WorldModel(semantic_map(draw_world(load_scene("chest_room"), 3)))


def handle_on(chest: Pose2D, height: float = FRONT[2], size: tuple[float, float] | None = SIZE) -> Handle:
    """A handle on a front at ``height`` of a chest that really stands at ``chest``."""
    outwards = Pose.from_xyz_rpy((FRONT[0], FRONT[1], height), (math.pi / 2, 0.0, -math.pi / 2))
    panel = chest.to_pose() @ outwards
    bar = panel @ Pose([0.0, 0.0, 0.04])
    none = size is None
    return Handle(
        "bar",
        bar,
        0.007,
        0.22,
        0.04,
        bar.rotation[:, 2],
        1.0,
        0.001,
        panel=None if none else panel,
        panel_size=size,
    )


def test_the_piece_is_believed_to_stand_where_its_front_was_seen(believed) -> None:
    true = believed.map.furniture["drawer_chest"].pose @ OFF
    believe_place(believed, "drawer_chest", handle_on(true))
    piece = believed.map.furniture["drawer_chest"]
    assert piece.pose.distance_to(true) < 1e-6
    assert piece.pose.theta == pytest.approx(true.theta)
    assert (piece.position_error, piece.heading_error) == (POSITION_ERROR, HEADING_ERROR)
    assert believed.surface("drawer_chest/top")[0] is piece


@pytest.mark.parametrize(
    "change",
    [
        {"size": None},
        {"size": (0.60, 0.253)},
        {"height": 0.58},
    ],
    ids=["no borders seen", "another size", "another height"],
)
def test_a_handle_that_fits_no_mapped_front_leaves_the_belief_unchanged(believed, change) -> None:
    before = believed.map.furniture["drawer_chest"]
    believe_place(believed, "drawer_chest", handle_on(before.pose @ OFF, **change))
    assert believed.map.furniture["drawer_chest"] is before


def test_a_front_that_is_farther_out_than_the_map_can_be_wrong_is_not_shut(believed) -> None:
    before = believed.map.furniture["drawer_chest"]
    believe_place(believed, "drawer_chest", handle_on(before.pose @ Pose2D(-0.15, 0.0, 0.0)))
    assert believed.map.furniture["drawer_chest"] is before


def test_the_front_of_a_drawer_that_is_believed_open_tells_nothing(believed) -> None:
    believed.believe_articulation("drawer_chest/drawer_3", 0.2)
    before = believed.map.furniture["drawer_chest"]
    believe_place(believed, "drawer_chest", handle_on(before.pose @ OFF))
    assert believed.map.furniture["drawer_chest"] is before


def test_what_was_measured_once_is_kept(believed) -> None:
    true = believed.map.furniture["drawer_chest"].pose @ OFF
    believe_place(believed, "drawer_chest", handle_on(true))
    measured = believed.map.furniture["drawer_chest"]
    worse = replace(handle_on(true @ Pose2D(0.005, 0.0, 0.0)))
    believe_place(believed, "drawer_chest", worse)
    assert believed.map.furniture["drawer_chest"] is measured
    assert np.allclose(measured.pose.xy, true.xy)


LOWER = FRONT[2] - 0.261


@pytest.mark.parametrize("off", [(0.10, 0.0), (-0.10, 0.0), (0.0, 0.10), (0.0, -0.10), (-0.10, 0.09)])
def test_two_fronts_in_one_plane_report_where_a_piece_stands_however_wrong_the_map_is(believed, off) -> None:
    true = believed.map.furniture["drawer_chest"].pose @ Pose2D(*off, 0.02)
    believe_shut_fronts(believed, "drawer_chest", [handle_on(true), handle_on(true, LOWER)])
    piece = believed.map.furniture["drawer_chest"]
    assert piece.pose.distance_to(true) < 1e-6
    assert (piece.position_error, piece.heading_error) == (POSITION_ERROR, HEADING_ERROR)


def test_the_fronts_in_one_plane_count_and_not_the_one_that_stands_out(believed) -> None:
    true = believed.map.furniture["drawer_chest"].pose @ Pose2D(-0.10, 0.0, 0.0)
    out = true @ Pose2D(-0.05, 0.0, 0.0)
    lowest = LOWER - 0.261
    believe_shut_fronts(believed, "drawer_chest", [handle_on(out), handle_on(true, LOWER), handle_on(true, lowest)])
    assert believed.map.furniture["drawer_chest"].pose.distance_to(true) < 1e-6


@pytest.mark.parametrize(
    ("places", "heights"),
    [
        ([(-0.10, 0.0)], [FRONT[2]]),
        ([(-0.10, 0.0), (-0.10, 0.0)], [FRONT[2], FRONT[2]]),
        ([(-0.10, 0.0), (-0.13, 0.0)], [FRONT[2], LOWER]),
        ([(-0.22, 0.0), (-0.22, 0.0)], [FRONT[2], LOWER]),
        ([(0.02, 0.01), (0.02, 0.01)], [FRONT[2], LOWER]),
    ],
    ids=["one front", "one front twice", "not in one plane", "too far off", "within the map's error"],
)
def test_what_does_not_show_that_the_map_is_wrong_leaves_it_as_it_is(believed, places, heights) -> None:
    before = believed.map.furniture["drawer_chest"]
    seen = [handle_on(before.pose @ Pose2D(*off, 0.0), height) for off, height in zip(places, heights, strict=True)]
    believe_shut_fronts(believed, "drawer_chest", seen)
    assert believed.map.furniture["drawer_chest"] is before


@pytest.mark.parametrize("off", [0.0, -0.02, 0.03])
def test_of_two_fronts_the_one_farther_back_reports_the_place_that_the_maps_error_explains(believed, off) -> None:
    true = believed.map.furniture["drawer_chest"].pose @ Pose2D(off, 0.01, 0.0)
    out = true @ Pose2D(-0.09, 0.0, 0.0)
    believe_shut_fronts(believed, "drawer_chest", [handle_on(out), handle_on(true, LOWER)], explained_too=True)
    assert believed.map.furniture["drawer_chest"].pose.distance_to(true) < 1e-6


@pytest.mark.parametrize("openings", [(0.06, 0.09), (0.10, 0.14), (0.15, 0.20)])
def test_two_drawers_that_stand_open_unlike_do_not_move_the_piece_towards_them(believed, openings) -> None:
    before = believed.map.furniture["drawer_chest"]
    heights = (FRONT[2], LOWER)
    seen = [
        handle_on(before.pose @ Pose2D(-opening, 0.0, 0.0), height)
        for opening, height in zip(openings, heights, strict=True)
    ]
    believe_shut_fronts(believed, "drawer_chest", seen, explained_too=True)
    assert believed.map.furniture["drawer_chest"] is before


def test_shut_fronts_of_a_piece_that_is_far_off_count_beside_one_that_stands_out_after_closing(believed) -> None:
    true = believed.map.furniture["drawer_chest"].pose @ Pose2D(-0.10, 0.0, 0.0)
    seen = [handle_on(true @ Pose2D(-0.05, 0.0, 0.0)), handle_on(true, LOWER), handle_on(true, LOWER - 0.261)]
    believe_shut_fronts(believed, "drawer_chest", seen, explained_too=True)
    assert believed.map.furniture["drawer_chest"].pose.distance_to(true) < 1e-6
