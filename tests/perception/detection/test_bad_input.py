"""What every detector owes on input that shows nothing: words, no crash, no invented object."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Sequence

import numpy as np
import pytest

from benchmarks.rendered_table import RenderedTable, TrueObject, known_models, render_table
from bestman_bt.messages import CameraIntrinsics, Pose, RGBDImage
from bestman_bt.perception.detection.base import Detector
from bestman_bt.perception.detection.by_marker import ByMarker
from bestman_bt.perception.detection.color_shape import ColorShape
from bestman_bt.perception.detection.from_image import FromImage, ImageDetection, ModelRegistration
from bestman_bt.perception.errors import NoSurfaceError
from bestman_bt.perception.segmentation.plane_dbscan import PlaneDbscan
from bestman_bt.perception.segmentation.region_growing import RegionGrowing
from bestman_bt.perception.view import View

Tables = Callable[..., RenderedTable]
MODELS = known_models(1)


class Sure(FromImage):
    """Claims to see everything everywhere."""

    def find(self, image: RGBDImage, names: Sequence[str]) -> tuple[ImageDetection, ...]:
        height, width = image.depth.shape
        mask = np.ones((height, width), bool)
        return tuple(ImageDetection(name, 1.0, (-0.5, -0.5, width - 0.5, height - 0.5), mask) for name in names)


DETECTORS = {
    "registration": lambda: ModelRegistration(segmentation=PlaneDbscan()),
    "color and shape": lambda: ColorShape(segmentation=RegionGrowing()),
    "from image": lambda: Sure(),
    "markers": lambda: ByMarker(markers={0: "cup"}),
}


@pytest.fixture(params=DETECTORS)
def detector(request: pytest.FixtureRequest) -> Detector:
    made: Detector = DETECTORS[request.param]()
    return made


def with_depth(scene: RenderedTable, depth: np.ndarray) -> View:
    image = scene.view.image
    return View(RGBDImage(image.rgb, depth, image.intrinsics, 0.0), scene.view.frame_from_camera)


@pytest.mark.parametrize("value", [0.0, np.nan, np.inf, -np.inf, -1.0])
def test_an_image_without_depth_is_told_in_words(table: Tables, detector: Detector, value: float) -> None:
    scene = table(60, palette=1)
    view = with_depth(scene, np.full((480, 640), value, np.float32))
    with pytest.raises(NoSurfaceError, match="no surface in view near .* 0 measured points"):
        detector.detect(view, scene.region, MODELS, np.random.default_rng(0))


def test_a_view_of_no_surface_is_reported_in_words(table: Tables, detector: Detector) -> None:
    scene = table(60, palette=1)
    wall = np.full((480, 640), 0.4, np.float32)
    with pytest.raises(NoSurfaceError, match="no surface in view"):
        detector.detect(with_depth(scene, wall), scene.region, MODELS, np.random.default_rng(0))


def test_depth_that_is_all_noise_gives_no_object(table: Tables, detector: Detector) -> None:
    scene = table(60, palette=1)
    noise = np.random.default_rng(0).uniform(0.3, 3.0, (480, 640)).astype(np.float32)
    with contextlib.suppress(NoSurfaceError):
        found = detector.detect(with_depth(scene, noise), scene.region, MODELS, np.random.default_rng(0))
        assert found.detections == ()


@pytest.mark.parametrize("size", [1, 3, 16])
def test_a_tiny_image_is_told_in_words(table: Tables, detector: Detector, size: int) -> None:
    k = CameraIntrinsics(size, size, 10.0, 10.0, size / 2, size / 2)
    image = RGBDImage(np.zeros((size, size, 3), np.uint8), np.ones((size, size), np.float32), k, 0.0)
    view = View(image, table(60, palette=1).view.frame_from_camera)
    with pytest.raises(NoSurfaceError, match="no surface in view"):
        detector.detect(view, table(60, palette=1).region, MODELS, np.random.default_rng(0))


def test_an_image_that_does_not_fit_its_intrinsics_is_refused(table: Tables) -> None:
    image = table(60, palette=1).view.image
    wrong = CameraIntrinsics(320, 240, 200.0, 200.0, 160.0, 120.0)
    with pytest.raises(ValueError, match=r"RGBDImage rgb should have shape \(240, 320, 3\) but has \(480, 640, 3\)"):
        RGBDImage(image.rgb, image.depth, wrong, 0.0)


@pytest.mark.parametrize("name", ["registration", "color and shape"])
def test_an_object_that_the_picture_cuts_is_flagged_or_unknown(name: str) -> None:
    box = MODELS[2]
    table = Pose.from_xyz_rpy((0.76, 0.0, 0.75))
    item = TrueObject(box, table @ Pose.from_xyz_rpy((-0.1, 0.0, 0.05), (0, 0, 0.4)), True)
    scene = render_table([item], table, (0.8, 1.2), np.random.default_rng(0))
    pixels, _ = scene.view.project(item.pose.position[None])
    k, image = scene.view.image.intrinsics, scene.view.image
    last = round(float(pixels[0, 0])) + 3
    cut = CameraIntrinsics(last, k.height, k.fx, k.fy, k.cx, k.cy)
    view = View(RGBDImage(image.rgb[:, :last], image.depth[:, :last], cut, 0.0), scene.view.frame_from_camera)
    found = DETECTORS[name]().detect(view, scene.region, MODELS, np.random.default_rng(0))
    assert len(found.detections) + len(found.unknown) == 1
    assert all(detection.at_border for detection in found.detections)
    assert all(cluster.at_border for cluster in found.unknown)
    assert all(detection.name == "box" for detection in found.detections)
