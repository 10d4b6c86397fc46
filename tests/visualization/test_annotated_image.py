"""Marks are drawn where what they stand for appears in the picture, and only where it is in sight."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from bestman_bt.messages import (
    Box,
    CameraIntrinsics,
    Cylinder,
    Handle,
    ObjectModel,
    PlacedShape,
    Pose,
    RGBDImage,
    YawSet,
)
from bestman_bt.visualization.annotated_image import annotated_image
from bestman_bt.visualization.marks import (
    AXES,
    GRASP_COLOR,
    HANDLE_COLOR,
    OPENING_COLOR,
    SURFACE_COLOR,
    GraspMark,
    HandleMark,
    ObjectMark,
    SceneMarks,
    SurfaceMark,
    box_edges,
    grasp_lines,
    object_color,
)

K = CameraIntrinsics(320, 240, 300.0, 300.0, 159.5, 119.5)
GREY = 128
AHEAD = Pose.from_matrix([[0.0, 0.0, 1.0, 0.0], [-1.0, 0.0, 0.0, 0.0], [0.0, -1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
"""A camera at the origin that looks along x; y is to its left, z up."""
BOX = ObjectModel("box", (0.2, 0.3, 0.8), 0.3, 0.6, (PlacedShape(Box((0.1, 0.1, 0.2)), Pose()),), symmetry_order=2)
CAN = ObjectModel("can", (0.8, 0.2, 0.2), 0.3, 0.6, (PlacedShape(Cylinder(0.05, 0.2), Pose()),), symmetry_order=0)


def grey_image(depth: float = 3.0) -> RGBDImage:
    """Nothing but a grey wall ``depth`` metres ahead."""
    return RGBDImage(np.full((240, 320, 3), GREY, np.uint8), np.full((240, 320), depth, np.float32), K, 0.0)


def drawn(marks: SceneMarks, depth: float = 3.0) -> NDArray[np.uint8]:
    return annotated_image(grey_image(depth), AHEAD, marks, scale=2)


def pixel(x: float, y: float, z: float) -> tuple[int, int]:
    """Row and column at which a point of the frame appears in a picture of twice the size."""
    return round((119.5 + 0.5 - 300.0 * z / x) * 2 - 0.5), round((159.5 + 0.5 - 300.0 * y / x) * 2 - 0.5)


def near(picture: NDArray[np.uint8], point: tuple[float, float, float], color: tuple[int, int, int]) -> bool:
    """Whether a colour appears within two pixels of a point."""
    row, column = pixel(*point)
    around = picture[row - 2 : row + 3, column - 2 : column + 3].reshape(-1, 3).astype(int)
    return bool((np.abs(around - color).max(axis=1) < 40).any())


def an_object(model: ObjectModel = BOX, place: Pose | None = None, name: str = "box", **changes) -> ObjectMark:
    pose = place or Pose.from_xyz_rpy((1.5, 0.0, 0.0))
    points = pose.apply(
        np.array([[-0.05, y, z] for y in np.linspace(-0.04, 0.04, 9) for z in np.linspace(-0.09, 0.0, 9)])
    )
    return ObjectMark(name, model, pose, 0.9, 0.002, YawSet(), changes.pop("points", points), **changes)


def a_handle(x: float = 1.5) -> Handle:
    """An upright bar 30 cm long on a front that faces the camera; it pulls towards the camera."""
    pose = Pose.from_matrix([[0.0, 0.0, -1.0, x], [0.0, -1.0, 0.0, 0.0], [-1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
    return Handle("bar", pose, 0.006, 0.3, 0.04, np.array([0.0, 1.0, 0.0]), 0.9, 0.002, "revolute", 0.8)


def test_without_marks_the_picture_is_the_image_twice_as_large() -> None:
    picture = drawn(SceneMarks())
    assert picture.shape == (480, 640, 3)
    assert (picture == GREY).all()


def test_measured_points_are_tinted_and_nothing_far_from_the_object_changes() -> None:
    picture = drawn(SceneMarks(objects=(an_object(),)))
    row, column = pixel(1.45, 0.02, -0.05)
    assert picture[row, column].tolist() != [GREY] * 3
    assert (picture[:, :100] == GREY).all()


def test_the_edges_of_the_box_are_drawn_where_they_project() -> None:
    picture = drawn(SceneMarks(objects=(an_object(points=np.array([[1.45, 0.0, 0.0]])),)))
    for corner in [(1.45, 0.05, -0.1), (1.45, -0.05, -0.1), (1.55, -0.05, -0.1)]:
        assert near(picture, corner, object_color(0))


def test_axes_show_the_pose_and_a_body_of_revolution_has_only_one() -> None:
    turned = Pose.from_xyz_rpy((1.5, 0.0, 0.0), (0.0, 0.0, math.pi / 2))  # x to the left, y towards the wall
    box = drawn(SceneMarks(objects=(an_object(place=turned, points=np.empty((0, 3))),)))
    assert near(box, (1.5, 0.06, 0.0), AXES[0])
    assert near(box, (1.5, 0.0, 0.05), AXES[2])
    can = drawn(SceneMarks(objects=(an_object(CAN, turned, points=np.empty((0, 3))),)))
    assert near(can, (1.5, 0.0, 0.05), AXES[2])
    assert not near(can, (1.5, 0.06, 0.0), AXES[0])


def test_open_yaws_are_an_arc_around_the_foot() -> None:
    mark = an_object(points=np.empty((0, 3)))
    open_to_the_left = ObjectMark(mark.name, BOX, mark.pose, 0.9, 0.002, YawSet(((math.pi / 2, 0.5),)), mark.points)
    radius = 0.75 * math.hypot(0.1, 0.1)
    picture = drawn(SceneMarks(objects=(open_to_the_left,)))
    assert near(picture, (1.5, radius, -0.1), object_color(0))
    assert not near(picture, (1.5, -radius, -0.1), object_color(0))


def test_each_object_has_the_colour_of_its_place_in_the_list() -> None:
    left, right = (an_object(place=Pose.from_xyz_rpy((1.5, y, 0.0)), name=f"box {y}") for y in (0.3, -0.3))
    picture = drawn(SceneMarks(objects=(left, right)))
    assert near(picture, (1.45, 0.35, -0.1), object_color(0))
    assert near(picture, (1.45, -0.35, -0.1), object_color(1))


def test_what_something_else_hides_is_not_drawn() -> None:
    marks = SceneMarks(
        objects=(an_object(),),
        handles=(HandleMark("handle", a_handle()),),
        grasps=(GraspMark("box", Pose.from_xyz_rpy((1.5, 0.0, 0.2)), 0.06, 0.05, 1.0),),
        surfaces=(SurfaceMark("table", Pose.from_xyz_rpy((1.5, 0.0, -0.1)), (0.4, 0.4)),),
    )
    assert (drawn(marks) != GREY).any()
    assert (drawn(marks, depth=1.0) == GREY).all()


def test_a_handle_is_a_line_along_its_axis_with_the_direction_in_which_it_opens() -> None:
    picture = drawn(SceneMarks(handles=(HandleMark("handle", a_handle()),)))
    for z in (-0.14, -0.08, 0.08, 0.14):
        assert near(picture, (1.5, 0.0, z), HANDLE_COLOR)
    assert not near(picture, (1.5, 0.0, 0.2), HANDLE_COLOR)
    assert near(picture, (1.5, 0.06, 0.0), OPENING_COLOR)


def test_a_grasp_is_a_hand_whose_fingers_are_as_far_apart_as_it_says() -> None:
    grasp = GraspMark("box", Pose.from_xyz_rpy((1.5, 0.0, 0.0), (math.pi, 0.0, 0.0)), 0.1, 0.05, 1.0)
    fingers = grasp_lines(grasp)[:2]
    assert fingers[:, 0] == pytest.approx(np.array([[1.5, 0.05, 0.0], [1.5, -0.05, 0.0]]))
    assert fingers[:, 1, 2] == pytest.approx(0.05)  # the hand is above: its z points down
    picture = drawn(SceneMarks(grasps=(grasp,)))
    for y in (0.05, -0.05):
        assert near(picture, (1.5, y, 0.025), GRASP_COLOR)


def test_a_surface_is_outlined_where_it_is() -> None:
    picture = drawn(SceneMarks(surfaces=(SurfaceMark("table", Pose.from_xyz_rpy((1.5, 0.0, -0.2)), (0.6, 0.4)),)))
    for point in [(1.2, 0.1, -0.2), (1.5, 0.2, -0.2), (1.8, -0.1, -0.2)]:
        assert near(picture, point, SURFACE_COLOR)


def test_what_is_behind_the_camera_is_not_drawn() -> None:
    behind = Pose.from_xyz_rpy((-1.5, 0.0, 0.0))
    marks = SceneMarks(
        objects=(an_object(place=behind),),
        surfaces=(SurfaceMark("table", behind, (0.6, 0.4)),),
        grasps=(GraspMark("other", behind, 0.1, 0.05, 1.0),),
    )
    assert (drawn(marks) == GREY).all()


def test_a_box_has_twelve_edges_of_its_sides() -> None:
    edges = box_edges(Pose(), np.array([0.0, 0.0, 0.0]), np.array([1.0, 2.0, 3.0]))
    lengths = np.linalg.norm(edges[:, 1] - edges[:, 0], axis=1)
    assert sorted(lengths) == pytest.approx([1.0] * 4 + [2.0] * 4 + [3.0] * 4)
