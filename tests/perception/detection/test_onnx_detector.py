from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import onnx
import pytest
from onnx import TensorProto, helper

from benchmarks.rendered_table import known_models
from bestman_bt.errors import MissingExtraError
from bestman_bt.messages import CameraIntrinsics, RGBDImage
from bestman_bt.perception.detection.from_image import ImageDetection
from bestman_bt.perception.detection.onnx_detector import OnnxDetector, letterbox
from bestman_bt.perception.errors import DetectorModelError, PerceptionError
from tests.perception.detection.train_tiny_detector import CLASSES, train, training_scene, true_boxes


@pytest.fixture(scope="session")
def tiny(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("models") / "tiny.onnx"
    train(range(200, 208), str(path))
    return path


def image(rgb: np.ndarray) -> RGBDImage:
    height, width = rgb.shape[:2]
    k = CameraIntrinsics(width, height, 100.0, 100.0, width / 2, height / 2)
    return RGBDImage(rgb, np.ones((height, width), np.float32), k, 0.0)


def overlap(detection: ImageDetection, box: np.ndarray) -> float:
    mine = np.array(detection.box)
    common = np.clip(np.minimum(mine[2:], box[2:]) - np.maximum(mine[:2], box[:2]), 0.0, None).prod()
    return float(common / ((mine[2:] - mine[:2]).prod() + (box[2:] - box[:2]).prod() - common))


@pytest.mark.slow
def test_a_trained_network_finds_things_in_pictures_that_it_has_not_seen(tiny: Path) -> None:
    detector = OnnxDetector(model=str(tiny), min_score=0.5)
    things = hits = strays = 0
    for seed in range(300, 306):
        scene = training_scene(seed)
        found = detector.find(scene.view.image, CLASSES)
        truth = true_boxes(scene)
        things += len(truth)
        hits += sum(any(f.label == name and overlap(f, box) > 0.4 for f in found) for name, box in truth)
        strays += sum(not any(f.label == name and overlap(f, box) > 0.1 for name, box in truth) for f in found)
    assert hits >= 0.8 * things
    assert strays <= 0.1 * things


@pytest.mark.slow
def test_only_what_was_asked_for_is_found(tiny: Path) -> None:
    picture = training_scene(300).view.image
    detector = OnnxDetector(model=str(tiny))
    assert {found.label for found in detector.find(picture, ["can"])} == {"can"}
    assert detector.find(picture, ["teapot"]) == ()


@pytest.mark.slow
def test_boxes_become_objects_with_poses(tiny: Path) -> None:
    scene = training_scene(300)
    detector = OnnxDetector(model=str(tiny))
    found = detector.detect(scene.view, scene.region, known_models(0), np.random.default_rng(0))
    placed = {item.model.name: item.pose.position for item in scene.objects}
    assert len(found.detections) >= 3
    for detection in found.detections:
        assert np.linalg.norm(detection.pose.position - placed[detection.name]) < 0.005


@pytest.mark.slow
def test_boxes_of_things_without_a_model_become_labelled_clusters(tiny: Path) -> None:
    scene = training_scene(300)
    detector = OnnxDetector(model=str(tiny), names=("can",))
    found = detector.detect(scene.view, scene.region, [], np.random.default_rng(0))
    assert found.detections == ()
    can = found.labelled("can")
    place = next(item.pose.position for item in scene.objects if item.model.name == "can")
    assert np.linalg.norm(can.points.mean(axis=0) - place) < 0.05


@pytest.mark.parametrize("size", [(320, 240), (640, 640), (100, 300)])
def test_letterboxed_pixels_come_back_where_they_were(size: tuple[int, int]) -> None:
    rgb = np.zeros((48, 64, 3), np.uint8)
    rgb[10:14, 40:44] = 255
    picture, scale, shift = letterbox(rgb, size)
    assert picture.shape == (1, 3, size[1], size[0])
    rows, columns = np.nonzero(picture[0, 0] > 0.9)
    box = np.array([columns.min(), rows.min(), columns.max() + 1, rows.max() + 1]).reshape(2, 2)
    np.testing.assert_allclose((box - shift) / scale, [[40, 10], [44, 14]], atol=0.6)


def save(
    path: Path, inputs: list[tuple[int, list]], output: list, names: str = "", given: np.ndarray | None = None
) -> str:
    """A network that gives ``given``, or zeros, of shape ``output`` whatever it is shown."""
    values = [helper.make_tensor_value_info(f"in{i}", kind, shape) for i, (kind, shape) in enumerate(inputs)]
    result = helper.make_tensor_value_info("out", TensorProto.FLOAT, output)
    zeros = helper.make_tensor(
        "value", TensorProto.FLOAT, output, np.ravel(np.zeros(output) if given is None else given)
    )
    graph = helper.make_graph([helper.make_node("Constant", [], ["out"], value=zeros)], "zeros", values, [result])
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=9)
    if names:
        helper.set_model_props(model, {"names": names})
    onnx.save(model, str(path))
    return str(path)


PICTURE = [(TensorProto.FLOAT, [1, 3, 64, 64])]


@pytest.mark.parametrize(
    ("inputs", "output", "names", "message"),
    [
        ([(TensorProto.FLOAT, [1, 64, 64, 3])], [1, 6, 10], "['a', 'b']", r"one input tensor\(float\) \[1, 3, H, W\]"),
        ([(TensorProto.UINT8, [1, 3, 64, 64])], [1, 6, 10], "['a', 'b']", r"takes tensor\(uint8\)"),
        (PICTURE * 2, [1, 6, 10], "['a', 'b']", r"one input"),
        (PICTURE, [1, 10, 6], "['a', 'b']", r"gives \(1, 10, 6\); with 2 classes one output \(1, 6, N\)"),
        (PICTURE, [1, 6, 10], "", "does not name its classes; give them as 'classes'"),
        (PICTURE, [1, 6, 10], "open('x')", "does not name its classes"),
    ],
)
def test_a_file_of_another_kind_is_refused_in_words(
    tmp_path: Path, inputs: list, output: list, names: str, message: str
) -> None:
    detector = OnnxDetector(model=save(tmp_path / "other.onnx", inputs, output, names))
    with pytest.raises(DetectorModelError, match=message):
        detector.find(image(np.zeros((48, 64, 3), np.uint8)), ["a"])


def test_a_network_that_sees_nothing_gives_nothing(tmp_path: Path) -> None:
    detector = OnnxDetector(model=save(tmp_path / "zeros.onnx", PICTURE, [1, 6, 10], "{0: 'a', 1: 'b'}"))
    assert detector.find(image(np.zeros((48, 64, 3), np.uint8)), ["a", "b"]) == ()


def test_classes_may_be_given_where_the_file_has_none(tmp_path: Path) -> None:
    detector = OnnxDetector(model=save(tmp_path / "zeros.onnx", PICTURE, [1, 6, 10]), classes=("a", "b"))
    assert detector.find(image(np.zeros((48, 64, 3), np.uint8)), ["a"]) == ()


def told(tmp_path: Path, boxes: list[tuple[float, ...]], **options: object) -> OnnxDetector:
    """A detector whose network tells of ``boxes``: centre, size, then the scores of a and b; its input is 64 x 64."""
    given = np.zeros((1, 6, 10), np.float32)
    given[0, :, : len(boxes)] = np.array(boxes).T
    file = save(tmp_path / "told.onnx", PICTURE, [1, 6, 10], "{0: 'a', 1: 'b'}", given)
    return OnnxDetector(model=file, **options)


SQUARE = image(np.zeros((64, 64, 3), np.uint8))


def test_boxes_of_two_classes_may_overlap_and_those_of_one_give_way_to_the_surest(tmp_path: Path) -> None:
    detector = told(
        tmp_path,
        [(20, 20, 10, 10, 0.6, 0), (21, 20, 10, 10, 0, 0.7), (20, 21, 10, 10, 0.9, 0), (50, 50, 10, 10, 0.5, 0)],
    )
    found = detector.find(SQUARE, ["a", "b"])
    assert [(one.label, round(one.score, 2)) for one in found] == [("a", 0.9), ("b", 0.7), ("a", 0.5)]
    assert found[0].box == pytest.approx((14.5, 15.5, 24.5, 25.5))


def test_overlap_is_that_of_areas_just_below_and_just_above_the_limit(tmp_path: Path) -> None:
    """Two boxes of 10 x 10, 3 or 4 pixels apart: 70 of 130 and 60 of 140."""
    for aside, count in ((3.0, 1), (4.0, 2)):
        detector = told(tmp_path, [(20, 20, 10, 10, 0.9, 0), (20 + aside, 20, 10, 10, 0.8, 0)])
        assert len(detector.find(SQUARE, ["a"])) == count


def test_low_scores_other_names_and_boxes_that_are_none_are_left_out(tmp_path: Path) -> None:
    boxes = [
        (20, 20, 10, 10, 0.29, 0),
        (40, 20, 10, 10, 0.31, 0.9),
        (20, 40, 0, 10, 0.9, 0),
        (np.nan, 40, 9, 9, 0.9, 0),
    ]
    found = told(tmp_path, boxes).find(SQUARE, ["a"])
    assert [(one.label, round(one.score, 2)) for one in found] == [("a", 0.31)]


@pytest.mark.parametrize(("width", "height"), [(64, 64), (128, 64), (32, 64), (500, 3), (2, 480), (1, 1)])
def test_boxes_are_given_in_pixels_of_the_picture_and_cut_at_its_border(
    tmp_path: Path, width: int, height: int
) -> None:
    """The whole input, a box about its middle, and one in the padding or beyond the border."""
    detector = told(
        tmp_path, [(32, 32, 64, 64, 0.9, 0), (32, 32, 8, 8, 0, 0.8), (70, 70, 10, 10, 0.7, 0)], max_overlap=0.99
    )
    found = detector.find(image(np.zeros((height, width, 3), np.uint8)), ["a", "b"])
    assert [one.label for one in found] == ["a", "b"]
    assert found[0].box == pytest.approx((-0.5, -0.5, width - 0.5, height - 0.5))
    left, top, right, bottom = found[1].box
    scale = min(64 / width, 64 / height)
    assert (left + right) / 2 == pytest.approx(width / 2 - 0.5, abs=0.5 / scale)
    assert (top + bottom) / 2 == pytest.approx(height / 2 - 0.5, abs=0.5 / scale)
    assert right - left == pytest.approx(min(8 / scale, width), abs=0.5 / scale)


def test_no_file_and_no_network_in_the_file_are_reported(tmp_path: Path) -> None:
    with pytest.raises(DetectorModelError, match="no ONNX file ''; give its path as 'model'"):
        OnnxDetector().find(image(np.zeros((8, 8, 3), np.uint8)), ["a"])
    path = tmp_path / "text.onnx"
    path.write_text("not a network")
    with pytest.raises(DetectorModelError, match="is not an ONNX model that onnxruntime can load"):
        OnnxDetector(model=str(path)).find(image(np.zeros((8, 8, 3), np.uint8)), ["a"])


def test_without_onnxruntime_the_error_names_the_extra(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "onnxruntime", None)
    detector = told(tmp_path, [])
    with pytest.raises(MissingExtraError, match=r"pip install .*\[onnx\]'"):
        detector.find(image(np.zeros((8, 8, 3), np.uint8)), ["a"])


def test_all_errors_are_errors_of_perception() -> None:
    assert issubclass(DetectorModelError, PerceptionError)


@pytest.mark.slow
def test_equal_pictures_give_equal_detections(tiny: Path) -> None:
    picture = training_scene(300).view.image
    detector = OnnxDetector(model=str(tiny))
    first, second = (replace(detector).find(picture, CLASSES) for _ in range(2))
    assert [(f.label, f.score, f.box) for f in first] == [(f.label, f.score, f.box) for f in second]
