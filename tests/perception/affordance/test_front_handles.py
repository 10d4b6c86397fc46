from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from benchmarks.perception_measures.distractors import Parts, block, bookshelf, chair, moved, plain_sideboard
from benchmarks.rendering import intrinsics, render_view
from bestman_bt.messages import Cylinder, Handle, PlacedShape, Pose, RGBDImage
from bestman_bt.perception.affordance.front_handles import FrontHandles, HandleScene
from bestman_bt.perception.errors import PerceptionError
from bestman_bt.perception.view import View
from bestman_bt.scene.furniture_generator.handle_design import HandleOptions

BAR, KNOB, EDGE = HandleOptions(kind="bar"), HandleOptions(kind="knob"), HandleOptions(kind="edge", length=0.2)
UPRIGHT = HandleOptions(kind="bar", direction="vertical")


def detect(view: View) -> HandleScene:
    return FrontHandles().detect(view, np.random.default_rng(0))


def nearest(true: Handle, found: tuple[Handle, ...]) -> Handle:
    return min(found, key=lambda one: float(np.linalg.norm(one.pose.position - true.pose.position)))


def with_depth(view: View, depth: np.ndarray) -> View:
    return View(RGBDImage(view.image.rgb, depth, view.image.intrinsics, 0.0), view.frame_from_camera)


FrontView = Callable[..., tuple[View, tuple[Handle, ...]]]
CameraBefore = Callable[[np.ndarray, float, float, float], Pose]


@pytest.mark.parametrize(
    ("kind", "handle", "distance", "aside"),
    [
        ("drawer_chest", BAR, 1.1, 25.0),
        pytest.param("drawer_chest", BAR, 1.7, -38.0, marks=pytest.mark.slow),
        ("drawer_chest", KNOB, 1.2, -20.0),
        ("drawer_chest", EDGE, 1.3, 15.0),
        ("cupboard", UPRIGHT, 1.5, 30.0),
        pytest.param("cupboard", KNOB, 1.0, -30.0, marks=pytest.mark.slow),
    ],
)
def test_each_handle_is_found_once_and_measured(
    front_view: FrontView, kind: str, handle: HandleOptions, distance: float, aside: float
) -> None:
    view, true = front_view(kind, distance=distance, aside=aside, handle=handle)
    found = detect(view).handles
    assert len(found) == len(true)
    for one in true:
        got = nearest(one, found)
        assert got.kind == one.kind
        assert np.linalg.norm(got.pose.position - one.pose.position) < 0.010
        assert got.standoff == pytest.approx(one.standoff, abs=0.006)
        assert got.radius == pytest.approx(one.radius, abs=0.004)
        assert got.outward @ one.outward > math.cos(math.radians(1.0))
        if one.kind != "knob":
            assert abs(float(got.axis @ one.axis)) > math.cos(math.radians(2.0))
            assert got.length == pytest.approx(one.length, abs=0.02)


@pytest.mark.slow
def test_a_drawer_is_pulled_straight_out_by_the_bar_in_its_middle(front_view: FrontView) -> None:
    view, true = front_view("drawer_chest", handle=BAR)
    for one in true:
        got = nearest(one, detect(view).handles)
        assert got.joint == "prismatic"
        assert got.joint_confidence >= 0.8
        assert got.hinge is None
        np.testing.assert_allclose(got.opening_direction, one.opening_direction, atol=0.02)
        assert got.panel is not None
        assert got.panel_size is not None
        np.testing.assert_allclose(got.panel_size, one.panel_size, atol=0.015)
        np.testing.assert_allclose(got.panel.position, one.panel.position, atol=0.012)


@pytest.mark.quick_cases(1)
@pytest.mark.parametrize("hinge", ["left", "right"])
def test_a_door_turns_about_the_border_opposite_to_its_handle(front_view: FrontView, hinge: str) -> None:
    view, (true,) = front_view("cupboard", doors=1, hinge=hinge, handle=UPRIGHT)
    (got,) = detect(view).handles
    assert (got.joint, got.hinge_side) == ("revolute", hinge)
    assert got.hinge is not None
    assert got.hinge_direction is not None
    assert got.hinge_direction @ true.hinge_direction > 0.999
    assert np.linalg.norm(np.cross(got.hinge - true.hinge, true.hinge_direction)) < 0.02
    assert got.opening_direction @ true.opening_direction > 0.99


def test_a_tall_panel_with_a_bar_along_its_top_folds_down(front_view: FrontView) -> None:
    view, (true,) = front_view("dishwasher", distance=1.4, handle=BAR)
    (got,) = detect(view).handles
    assert (got.joint, got.hinge_side) == ("revolute", "bottom")
    assert got.opening_direction @ true.opening_direction > 0.99


def test_handles_are_given_in_the_frame_of_the_view(front_view: FrontView) -> None:
    view, true = front_view("drawer_chest", handle=BAR)
    map_from_room = Pose.from_xyz_rpy((2.0, -1.0, 0.1), (0.0, 0.0, 2.2))
    found = detect(view.seen_from(map_from_room)).handles
    for one in true:
        expected = one.seen_from(map_from_room)
        assert np.linalg.norm(nearest(expected, found).pose.position - expected.pose.position) < 0.010


@pytest.mark.slow
def test_equal_input_gives_equal_output(front_view: FrontView) -> None:
    view, _ = front_view("cupboard", handle=KNOB)
    first, second = detect(view).handles, FrontHandles().detect(view, np.random.default_rng(7)).handles
    assert [one.pose.position.tolist() for one in first] == [one.pose.position.tolist() for one in second]


def test_bars_are_found_where_a_third_of_their_depth_drops_out(front_view: FrontView) -> None:
    view, true = front_view("drawer_chest", handle=BAR)
    depth = np.array(view.image.depth)
    rng = np.random.default_rng(3)
    for one in true:
        local = np.abs(one.pose.inverse().apply(view.frame_from_camera.apply(view.image.points())))
        on_bar = (local < np.array([one.length / 2, 0.012, 0.012])).all(axis=-1)
        depth[on_bar & (rng.random(depth.shape) < 0.33)] = 0.0
    found = detect(with_depth(view, depth)).handles
    assert len(found) == len(true)
    for one in true:
        assert np.linalg.norm(nearest(one, found).pose.position - one.pose.position) < 0.010


@pytest.mark.slow
def test_furniture_whose_handles_are_taken_away_has_none(front_view: FrontView) -> None:
    view, _ = front_view("drawer_chest", handle=BAR, handles=False)
    scene = detect(view)
    assert scene.handles == ()
    assert len(scene.fronts) >= 1
    assert "no handle on the" in scene.reason


@pytest.mark.slow
def test_the_setting_knobs_of_a_microwave_open_nothing(front_view: FrontView) -> None:
    view, (true,) = front_view("microwave", seed=4, distance=0.9, handle=UPRIGHT)
    (got,) = detect(view).handles
    assert np.linalg.norm(got.pose.position - true.pose.position) < 0.010


@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (1, 2))])
@pytest.mark.parametrize("scene", [bookshelf, plain_sideboard], ids=["bookshelf", "sideboard"])
def test_shelves_and_fronts_without_handles_show_none(
    camera: CameraBefore, scene: Callable[..., Parts], seed: int
) -> None:
    rng = np.random.default_rng(seed)
    parts = scene(rng) + block((-4.0, -4.0, -0.02), (4.0, 4.0, 0.0), (0.5, 0.5, 0.45))
    view = render_view(parts, camera(np.array([0.0, 0.0, 0.6]), 1.3, 25.0 - 20.0 * seed, 15.0), rng)
    assert detect(view).handles == ()


def test_a_can_and_a_chair_before_a_wall_are_no_handles(camera: CameraBefore) -> None:
    rng = np.random.default_rng(2)
    parts = block((0.0, -3.0, 0.0), (0.1, 3.0, 2.6), (0.7, 0.7, 0.6))
    parts += block((-0.3, -0.6, 0.0), (0.0, 0.6, 0.7), (0.4, 0.3, 0.3))
    parts += [(PlacedShape(Cylinder(0.02, 0.12), Pose(np.array([-0.04, 0.2, 0.76]))), (0.8, 0.2, 0.2))]
    parts += moved(chair(rng), Pose(np.array([-0.55, -0.2, 0.0])))
    view = render_view(parts, camera(np.array([0.0, 0.1, 0.7]), 1.4, 10.0, 20.0), rng)
    assert detect(view).handles == ()


@pytest.mark.parametrize("value", [0.0, math.nan])
def test_an_image_without_depth_is_refused(value: float) -> None:
    size = (480, 640)
    image = RGBDImage(np.zeros((*size, 3), np.uint8), np.full(size, value, np.float32), intrinsics(), 0.0)
    with pytest.raises(PerceptionError, match="no depth"):
        detect(View(image, Pose()))


def test_where_no_upright_plane_is_in_view_the_reason_reports_it(camera: CameraBefore) -> None:
    rng = np.random.default_rng(0)
    floor = block((-4.0, -4.0, -0.02), (4.0, 4.0, 0.0), (0.5, 0.5, 0.45))
    view = render_view(floor, camera(np.array([0.0, 0.0, 0.0]), 1.5, 0.0, 50.0), rng)
    scene = detect(view)
    assert (scene.handles, scene.fronts) == ((), ())
    assert scene.reason == "no upright plane in view"


def test_a_handle_that_is_cut_off_by_the_image_is_not_reported_with_a_wrong_middle(front_view: FrontView) -> None:
    view, (true,) = front_view("cupboard", doors=1, hinge="left", handle=UPRIGHT)
    pixels, _ = view.project(true.pose.position[None])
    row = int(pixels[0, 1])
    k = view.image.intrinsics
    cut = type(k)(k.width, row, k.fx, k.fy, k.cx, k.cy)
    upper = RGBDImage(view.image.rgb[:row], view.image.depth[:row], cut, 0.0)
    assert detect(View(upper, view.frame_from_camera)).handles == ()
