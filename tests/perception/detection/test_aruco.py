from __future__ import annotations

import math

import numpy as np
import pytest

from benchmarks.rendered_shelf import camera_pose
from benchmarks.rendered_table import solid
from benchmarks.rendering import render_view
from bestman_bt.messages import Box, CameraIntrinsics, PlacedShape, Pose, RGBDImage
from bestman_bt.perception.detection.by_marker import ByMarker, MarkerDetector, marker_shapes
from bestman_bt.perception.errors import PerceptionError
from bestman_bt.perception.segmentation.base import Region
from bestman_bt.perception.view import View

DICTIONARIES = ["DICT_4X4_50", "DICT_APRILTAG_36h11"]
TABLE = (PlacedShape(Box((0.8, 1.2, 0.03)), Pose.from_xyz_rpy((0.7, 0.0, 0.735))), (0.7, 0.55, 0.4))
REGION = Region(Pose.from_xyz_rpy((0.7, 0.0, 0.75)), (0.9, 1.3))
PACKET = solid("packet", Box((0.08, 0.10, 0.12)), (0.8, 0.2, 0.2), 2)


def upright(x: float, y: float, z: float, yaw: float = 0.0) -> Pose:
    """A pose whose z looks back to the camera, whose y is up."""
    frame_from_face = Pose.from_matrix(
        np.array([[0.0, 0.0, -1.0, 0.0], [-1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
    )
    return Pose.from_xyz_rpy((x, y, z), (0.0, 0.0, yaw)) @ frame_from_face


def marker_parts(marker: int, pose: Pose, size: float, dictionary: str = "DICT_4X4_50") -> list:
    return [(PlacedShape(p.shape, pose @ p.pose), color) for p, color in marker_shapes(marker, size, dictionary)]


def packet_with(marker: int, y: float, yaw: float = 0.0) -> tuple[Pose, list]:
    pose = Pose.from_xyz_rpy((0.6, y, 0.81), (0.0, 0.0, yaw))
    face = pose @ upright(-0.0415, 0.0, 0.02)
    return pose, [(PlacedShape(PACKET.collision[0].shape, pose), PACKET.color), *marker_parts(marker, face, 0.05)]


def look(parts: list, pitch: float = 0.55) -> View:
    return render_view([TABLE, *parts], camera_pose(0.0, 0.0, pitch, height=1.3), np.random.default_rng(0))


@pytest.mark.parametrize("dictionary", DICTIONARIES)
@pytest.mark.parametrize("marker", [0, 17])
def test_a_drawn_marker_is_read_and_its_corners_lie_where_they_were_drawn(dictionary: str, marker: int) -> None:
    pose, size = upright(0.7, 0.05, 0.95, 0.3), 0.12
    view = look(marker_parts(marker, pose, size, dictionary))
    (found,) = MarkerDetector(dictionary=dictionary).find(view.image)
    assert found.id == marker
    half = size / 2
    corners = np.array([[-half, half, 0.0], [half, half, 0.0], [half, -half, 0.0], [-half, -half, 0.0]])
    pixels, _ = view.project(pose.apply(corners))
    np.testing.assert_allclose(found.corners, pixels, atol=1.0)


def test_a_marker_of_another_dictionary_is_not_read() -> None:
    view = look(marker_parts(17, upright(0.7, 0.0, 0.95), 0.12, "DICT_APRILTAG_36h11"))
    assert MarkerDetector().find(view.image) == ()


def test_a_picture_without_markers_has_none() -> None:
    assert MarkerDetector().find(look([]).image) == ()


def test_an_object_has_the_name_of_the_marker_that_it_carries() -> None:
    truth, parts = packet_with(17, 0.1, 0.2)
    _, other = packet_with(18, -0.2)
    detector = ByMarker(markers={17: "packet"})
    found = detector.detect(look(parts + other), REGION, [PACKET], np.random.default_rng(0))
    (detection,) = found.detections
    assert detection.name == "packet"
    assert np.linalg.norm(detection.pose.position - truth.position) < 0.006
    assert len(found.unknown) == 1


def test_a_named_thing_without_a_model_is_labelled() -> None:
    _, parts = packet_with(17, 0.1)
    detector = ByMarker(markers={17: "parcel"})
    found = detector.detect(look(parts), REGION, [PACKET], np.random.default_rng(0))
    assert found.detections == ()
    assert found.labelled("parcel") is not None


def test_a_marker_on_the_table_names_nothing_that_stands_there() -> None:
    _, parts = packet_with(18, -0.2)
    flat = marker_parts(17, Pose.from_xyz_rpy((0.6, 0.2, 0.752), (0.0, 0.0, -math.pi / 2)), 0.09)
    detector = ByMarker(markers={17: "packet"})
    view = look(parts + flat)
    assert 17 in [marker.id for marker in detector.find(view.image)]
    found = detector.detect(view, REGION, [PACKET], np.random.default_rng(0))
    assert found.detections == ()
    assert found.labelled("packet") is None


def test_a_marker_without_its_object_does_not_bring_it_back() -> None:
    found = ByMarker(markers={17: "packet"}).detect(look([]), REGION, [PACKET], np.random.default_rng(0))
    assert found.detections == ()
    assert found.unknown == ()


def test_unknown_dictionaries_and_markers_are_refused_in_words() -> None:
    with pytest.raises(PerceptionError, match="no marker dictionary 'DICT_9X9'; known: .*DICT_4X4_50"):
        MarkerDetector(dictionary="DICT_9X9")
    with pytest.raises(PerceptionError, match="DICT_4X4_50 has markers 0 to 49, not 50"):
        marker_shapes(50, 0.1)


@pytest.mark.parametrize("shape", [(1, 1), (5, 3), (9, 700)])
def test_tiny_pictures_have_no_markers(shape: tuple[int, int]) -> None:
    k = CameraIntrinsics(shape[1], shape[0], 10.0, 10.0, 1.0, 1.0)
    image = RGBDImage(np.zeros((*shape, 3), np.uint8), np.ones(shape, np.float32), k, 0.0)
    assert MarkerDetector().find(image) == ()
