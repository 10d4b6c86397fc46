from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import pytest

from benchmarks.rendered_table import RenderedTable, TrueObject, known_models, render_table, solid
from bestman_bt.messages import Box, ObjectModel, Pose, RGBDImage
from bestman_bt.perception.detection.base import DetectedScene, LabelledCluster
from bestman_bt.perception.detection.from_image import FromImage, ImageDetection
from bestman_bt.perception.errors import PerceptionError

TABLE = Pose.from_xyz_rpy((0.76, 0.0, 0.75))
MODELS = known_models(0)
CUP, CAN, BOX, TIN, CUBE = MODELS


@dataclass(frozen=True, kw_only=True)
class Painted(FromImage):
    """Names what the test has painted."""

    found: tuple[ImageDetection, ...]
    asked: list[str] = field(default_factory=list)

    def find(self, image: RGBDImage, names: Sequence[str]) -> tuple[ImageDetection, ...]:
        self.asked.extend(names)
        return self.found


def painted(*found: ImageDetection, **parameters: object) -> Painted:
    return Painted(found=found, **parameters)


def on_table(*placed: tuple[ObjectModel, float, float, float]) -> RenderedTable:
    items = [
        TrueObject(model, TABLE @ Pose.from_xyz_rpy((x, y, model.size[2] / 2), (0, 0, yaw)), True)
        for model, x, y, yaw in placed
    ]
    return render_table(items, TABLE, (0.8, 1.2), np.random.default_rng(1))


def mask_of(scene: RenderedTable, item: TrueObject) -> np.ndarray:
    points, _, _ = scene.view.organised()
    return (np.abs(item.pose.inverse().apply(points)) < item.model.size / 2 + 0.004).all(axis=-1)


def detection_of(scene: RenderedTable, index: int, label: str, score: float = 0.9, mask: bool = True) -> ImageDetection:
    shown = mask_of(scene, scene.objects[index])
    rows, columns = np.nonzero(shown)
    box = (columns.min() - 1.0, rows.min() - 1.0, columns.max() + 1.0, rows.max() + 1.0)
    return ImageDetection(label, score, box, shown if mask else None)


def detect(scene: RenderedTable, detector: FromImage, models: Sequence[ObjectModel] = MODELS) -> DetectedScene:
    return detector.detect(scene.view, scene.region, models, np.random.default_rng(0))


@pytest.mark.quick_cases(1)
@pytest.mark.parametrize("mask", [True, False], ids=["masks", "boxes"])
def test_named_boxes_become_objects_with_poses_and_the_others_stay_unknown(mask: bool) -> None:
    scene = on_table((BOX, -0.1, -0.2, 0.5), (CAN, -0.1, 0.0, 0.0), (TIN, 0.1, 0.2, 1.0))
    detector = painted(detection_of(scene, 0, "box", mask=mask), detection_of(scene, 1, "can", mask=mask))
    found = detect(scene, detector)
    assert {(detection.name, detection.score) for detection in found.detections} == {("box", 0.9), ("can", 0.9)}
    for item in scene.objects[:2]:
        assert np.linalg.norm(found.find(item.model.name).pose.position - item.pose.position) < 0.004
    assert len(found.unknown) == 1
    assert not isinstance(found.unknown[0], LabelledCluster)


def test_a_name_without_a_model_gives_a_labelled_cluster() -> None:
    scene = on_table((BOX, -0.1, -0.2, 0.5), (CAN, -0.1, 0.0, 0.0))
    detector = painted(
        detection_of(scene, 0, "a red packet", 0.7), names=("packet",), prompts={"packet": "a red packet"}
    )
    found = detect(scene, detector)
    assert "a red packet" in detector.asked
    thing = found.labelled("packet")
    assert thing.score == 0.7
    assert np.linalg.norm(thing.points.mean(axis=0) - scene.objects[0].pose.position) < 0.05
    assert found.labelled("teapot") is None
    assert len(found.obstacles_beside(None)) == 2


def test_a_label_that_the_shape_contradicts_has_no_pose() -> None:
    scene = on_table((TIN, -0.1, 0.0, 0.5))
    found = detect(scene, painted(detection_of(scene, 0, "can")))
    assert found.find("can") is None
    assert found.labelled("can") is not None


@pytest.mark.slow
def test_masks_part_what_the_segmentation_could_not() -> None:
    twin = solid("twin", Box((0.04, 0.06, 0.10)), (0.2, 0.4, 0.8), 2)
    scene = on_table((BOX, -0.1, 0.0, 0.0), (twin, -0.1, 0.0605, 0.0))
    masks = detection_of(scene, 0, "box", 0.9), detection_of(scene, 1, "twin", 0.8)
    assert len(detect(scene, painted()).unknown) == 1
    found = detect(scene, painted(*masks, names=("twin",)))
    assert found.find("box") is not None
    assert found.labelled("twin") is not None
    middle = found.labelled("twin").points.mean(axis=0)
    assert middle[1] == pytest.approx(0.06, abs=0.015)


def test_a_thing_too_flat_for_the_segmentation_is_cut_out_by_its_mask() -> None:
    card = solid("card", Box((0.06, 0.09, 0.005)), (0.8, 0.2, 0.2), 2)
    scene = on_table((card, -0.1, 0.0, 0.3))
    found = detect(scene, painted(detection_of(scene, 0, "card"), names=("card",)))
    thing = found.labelled("card")
    assert np.linalg.norm(thing.points.mean(axis=0) - scene.objects[0].pose.position) < 0.02


def test_a_box_around_nothing_or_around_everything_names_nothing() -> None:
    scene = on_table((BOX, -0.1, -0.2, 0.5), (CAN, -0.1, 0.0, 0.0))
    empty, all_of_it = ImageDetection("box", 0.9, (5.0, 5.0, 40.0, 40.0)), ImageDetection("can", 0.9, (0, 0, 639, 479))
    found = detect(scene, painted(empty, all_of_it))
    assert found.detections == ()
    assert not any(isinstance(thing, LabelledCluster) for thing in found.unknown)


def test_labels_that_were_not_asked_for_and_low_scores_are_left_out() -> None:
    scene = on_table((BOX, -0.1, -0.2, 0.5))
    detector = painted(detection_of(scene, 0, "elephant"), detection_of(scene, 0, "box", 0.1))
    assert detect(scene, detector).detections == ()


def test_without_models_and_names_nothing_is_asked() -> None:
    scene = on_table((BOX, -0.1, -0.2, 0.5))
    detector = painted(detection_of(scene, 0, "box"))
    assert len(detect(scene, detector, models=[]).unknown) == 1
    assert detector.asked == []


def test_the_higher_score_has_the_cluster() -> None:
    scene = on_table((BOX, -0.1, -0.2, 0.5))
    both = detection_of(scene, 0, "brick", 0.5), detection_of(scene, 0, "packet", 0.8)
    found = detect(scene, painted(*both, names=("packet", "brick")))
    assert found.labelled("packet") is not None
    assert found.labelled("brick") is None


def test_another_frame_keeps_the_label() -> None:
    scene = on_table((BOX, -0.1, -0.2, 0.5))
    found = detect(scene, painted(detection_of(scene, 0, "packet"), names=("packet",)))
    moved = found.labelled("packet").seen_from(Pose.from_xyz_rpy((1.0, 0.0, 0.0)))
    assert isinstance(moved, LabelledCluster)
    assert moved.label == "packet"


@pytest.mark.parametrize("box", [(3.0, 0.0, 1.0, 5.0), (0.0, 0.0, np.nan, 5.0), (0.0, 5.0, 3.0, 5.0)])
def test_boxes_without_extent_are_refused(box: tuple[float, float, float, float]) -> None:
    with pytest.raises(PerceptionError, match="box should be left < right, top < bottom"):
        ImageDetection("cup", 0.5, box)


def test_scores_beyond_one_are_refused() -> None:
    with pytest.raises(PerceptionError, match="score should be 0 to 1"):
        ImageDetection("cup", 1.5, (0.0, 0.0, 1.0, 1.0))


def test_a_box_is_cut_at_the_image_and_gone_outside_of_it() -> None:
    assert ImageDetection("cup", 0.5, (-10.0, 5.0, 20.0, 90.0)).clipped(64, 48).box == (-0.5, 5.0, 20.0, 47.5)
    assert ImageDetection("cup", 0.5, (70.0, 5.0, 80.0, 9.0)).clipped(64, 48) is None
