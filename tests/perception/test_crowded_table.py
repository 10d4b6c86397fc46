from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial import cKDTree

from benchmarks.crowded_table import MAX_OCCLUSION, MIN_GAP, crowded_table, hidden_shares
from benchmarks.perception_measures.known_objects import Tally, shipped_models
from benchmarks.rendered_table import RenderedTable
from benchmarks.rendering import occlusion
from bestman_bt.messages import Box, PlacedShape, Pose
from bestman_bt.perception.detection.color_shape import ColorShape
from bestman_bt.perception.pose_estimation.model_surface import model_surface
from bestman_bt.perception.view_planning import looking_at

pytestmark = pytest.mark.slow

CAMERA = looking_at(np.zeros(3), 0.0, 0.0, 1.0)


def screen(x: float, y: float) -> list[PlacedShape]:
    return [PlacedShape(Box((0.01, 0.2, 0.2)), Pose(np.array([x, y, 0.0])))]


def test_occlusion_is_the_share_of_pixels_that_others_hide() -> None:
    shares = occlusion([screen(0.0, 0.0), screen(0.05, 0.1)], CAMERA)
    # The nearer one, seen a little larger, covers half of the other.
    assert shares[0] == pytest.approx(0.5, abs=0.05)
    assert shares[1] == 0.0


def test_what_is_not_in_the_image_counts_as_hidden() -> None:
    assert occlusion([screen(2.0, 0.0)], CAMERA)[0] == 1.0


@pytest.fixture(scope="module")
def crowd() -> RenderedTable:
    return crowded_table(1002, shipped_models(), (5, 5))


def test_objects_keep_their_gaps_and_stay_visible(crowd: RenderedTable) -> None:
    assert len(crowd.objects) == 5
    outlines = [
        (item.pose @ surface.rest_from_object.inverse()).apply(surface.points)[:, :2]
        for item in crowd.objects
        for surface in [model_surface(item.model, Pose(), 0.004)]
    ]
    gaps = [cKDTree(one).query(other)[0].min() for i, one in enumerate(outlines) for other in outlines[i + 1 :]]
    assert min(gaps) > MIN_GAP - 0.001
    assert hidden_shares(crowd.objects, crowd.view.frame_from_camera).max() <= MAX_OCCLUSION


def test_the_tally_counts_an_object_that_is_taken_for_another_as_wrong(crowd: RenderedTable) -> None:
    models = shipped_models()
    found = ColorShape().detect(crowd.view, crowd.region, models, np.random.default_rng(0))
    right, wrong = Tally(), Tally()
    right.add(crowd, found)
    assert right.right == right.known == 5
    missing = crowd.objects[0].model.name
    without = tuple(model for model in models if model.name != missing)
    wrong.add(crowd, ColorShape().detect(crowd.view, crowd.region, without, np.random.default_rng(0)))
    assert wrong.right == 4
    assert math.isclose(wrong.report()["identity_rate"], 0.8)
