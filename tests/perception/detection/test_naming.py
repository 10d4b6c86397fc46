"""Names, masks and boxes in pixels, cluster by cluster, without a camera."""

from __future__ import annotations

import math

import numpy as np
import pytest

from bestman_bt.messages import Box, ObjectModel, PlacedShape, Pose, YawSet
from bestman_bt.perception.detection.base import DetectedScene, LabelledCluster, Naming
from bestman_bt.perception.detection.from_image import ImageDetection
from bestman_bt.perception.pose_estimation.base import PoseHypothesis
from bestman_bt.perception.segmentation.base import Cluster, SegmentedScene, SupportPlane

PLANE = SupportPlane(Pose(), (1.0, 1.0), np.zeros((3, 3)), 0.001)
EMPTY = SegmentedScene((PLANE,), ())
MODEL = ObjectModel("box", (1, 0, 0), 0.3, 0.6, (PlacedShape(Box((0.1, 0.06, 0.08)), Pose()),))


def cluster(x: float, count: int = 20, spread: float = 0.0) -> Cluster:
    points = np.column_stack([np.full(count, x) + spread * np.arange(count), np.zeros(count), np.zeros(count)])
    return Cluster(points, np.zeros((count, 3), np.uint8), PLANE)


def fit(x: float, confidence: float, name: str = "box", yaw: float = 0.0) -> PoseHypothesis:
    model = ObjectModel(name, MODEL.color, 0.3, 0.6, MODEL.collision)
    pose = Pose.from_xyz_rpy((x, 0.0, 0.0), (0.0, 0.0, yaw))
    return PoseHypothesis(model, pose, confidence, np.eye(6), YawSet(), 0.001, 1.0, 1.0, 0.0, 0.0)


def names(scene: DetectedScene) -> list[str]:
    return [detection.name for detection in scene.detections]


def test_the_surest_come_first_and_what_is_unsure_or_has_no_fit_is_unknown() -> None:
    found = [
        (cluster(0.0), (fit(0.0, 0.6, "a"), fit(0.0, 0.2, "z"))),
        (cluster(1.0), (fit(1.0, 0.9, "b"),)),
        (cluster(2.0), (fit(2.0, 0.499, "c"),)),
        (cluster(3.0), ()),
        (cluster(4.0), (fit(4.0, 0.5, "d"),)),
    ]
    scene = Naming().named_scene(EMPTY, found)
    assert names(scene) == ["b", "a", "d"]
    assert [thing.points[0, 0] for thing in scene.unknown] == [2.0, 3.0]
    assert [one.model.name for one in scene.find("a").alternatives] == ["z"]
    assert scene.find("c") is None
    assert len(scene.obstacles_beside("a")) == 4
    assert len(scene.obstacles_beside(None)) == len(scene.obstacles_beside("c")) == 5


@pytest.mark.parametrize(("x", "absorbed"), [(0.059, True), (0.061, False), (-0.059, True)])
def test_a_piece_within_a_centimetre_of_a_found_object_belongs_to_it(x: float, absorbed: bool) -> None:
    """The box is 10 cm long, turned by a quarter: along y of the frame it is as long, along x 6 cm."""
    found = [(cluster(0.0), (fit(0.0, 0.9),)), (cluster(x), ())]
    assert len(Naming().named_scene(EMPTY, found).unknown) == (0 if absorbed else 1)
    turned = [(cluster(0.0), (fit(0.0, 0.9, yaw=math.pi / 2),)), (cluster(x), ())]
    assert len(Naming().named_scene(EMPTY, turned).unknown) == 1


@pytest.mark.parametrize(("share", "absorbed"), [(0.81, True), (0.79, False)])
def test_most_of_a_piece_has_to_lie_there(share: float, absorbed: bool) -> None:
    points = np.zeros((100, 3))
    points[round(100 * share) :, 0] = 0.5
    piece = Cluster(points, np.zeros((100, 3), np.uint8), PLANE)
    found = [(cluster(0.0), (fit(0.0, 0.9),)), (piece, ())]
    assert len(Naming().named_scene(EMPTY, found).unknown) == (0 if absorbed else 1)


def test_the_thing_with_the_highest_score_of_a_label_is_reported() -> None:
    things = [
        LabelledCluster(*_parts(x), False, label, score)
        for x, label, score in ((0, "a", 0.4), (1, "a", 0.8), (2, "b", 0.9))
    ]
    scene = DetectedScene(EMPTY, (), tuple(things))
    assert scene.labelled("a").score == 0.8
    assert scene.labelled("c") is None


def _parts(x: float) -> tuple[np.ndarray, np.ndarray, SupportPlane]:
    one = cluster(x)
    return one.points, one.colors, one.plane


def test_a_box_holds_its_border_and_a_mask_only_what_is_marked() -> None:
    pixels = np.array(
        [[1.0, 2.0], [4.0, 5.0], [0.9, 3.0], [4.1, 3.0], [2.0, 1.9], [2.0, 5.1], [np.nan, 3.0], [2.0, 3.4]]
    )
    box = (1.0, 2.0, 4.0, 5.0)
    assert ImageDetection("a", 0.5, box).holds(pixels).tolist() == [1, 1, 0, 0, 0, 0, 0, 1]
    mask = np.zeros((8, 8), bool)
    mask[3, 2] = True
    assert ImageDetection("a", 0.5, box, mask).holds(pixels).tolist() == [0, 0, 0, 0, 0, 0, 0, 1]
    mask[0, 0] = True
    assert not ImageDetection("a", 0.5, (3.0, 4.0, 7.0, 7.0), mask).holds(pixels[[0, 6]]).any()


@pytest.mark.parametrize(
    ("box", "expected"),
    [
        ((-1.0, 0.0, 5.0, 5.0), (-0.5, 0.0, 5.0, 5.0)),
        ((5.0, 3.0, 99.0, 99.0), (5.0, 3.0, 9.5, 7.5)),
        ((9.6, 0, 12, 4), None),
    ],
)
def test_boxes_are_cut_at_the_outer_edges_of_the_outer_pixels(box: tuple, expected: tuple | None) -> None:
    clipped = ImageDetection("a", 0.5, box).clipped(10, 8)
    assert (None if clipped is None else clipped.box) == expected
