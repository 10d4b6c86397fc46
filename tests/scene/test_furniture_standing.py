"""Furniture on furniture goes with it, and things keep from where it really stands."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bestman_bt.messages import Pose, Pose2D
from bestman_bt.scene.load import load_scene
from bestman_bt.scene.placing import gap_to_furniture, gap_to_objects, planar_radius, standing_furniture
from bestman_bt.scene.scene import PlacedObject
from bestman_bt.scene.scene_config import SceneConfig


@pytest.fixture(scope="module")
def scene() -> SceneConfig:
    """A microwave on a counter."""
    return load_scene("microwave_room")


def test_what_stands_on_a_piece_is_moved_and_turned_with_it(scene: SceneConfig) -> None:
    shares = {"counter": (1.0, -1.0, 1.0)}
    counter, microwave = (
        next(
            piece
            for piece in standing_furniture(scene, lambda name: shares.get(name, (0.0, 0.0, 0.0)))
            if piece.name == name
        )
        for name in ("counter", "microwave")
    )
    assert counter.actual != counter.nominal
    on_counter = counter.nominal.inverse() @ microwave.nominal
    expected = counter.actual @ on_counter
    assert (*microwave.actual.xy, microwave.actual.theta) == pytest.approx((*expected.xy, expected.theta))


def test_room_beside_a_piece_on_a_counter_is_measured_to_where_that_really_stands(scene: SceneConfig) -> None:
    pieces = standing_furniture(scene)
    counter, microwave = (next(piece for piece in pieces if piece.name == name) for name in ("counter", "microwave"))
    model = load_scene("kitchen").models["cup"]
    depth = microwave.model.footprint[0]
    gaps = []
    for moved in (0.0, 0.1):
        really = replace(microwave, actual=microwave.nominal @ Pose2D(moved, 0.0, 0.0))
        beside = (microwave.nominal @ Pose2D(depth / 2 + 0.5, 0.0, 0.0)).to_pose()
        gaps.append(gap_to_furniture(beside, model, counter, [counter, really]))
    np.testing.assert_allclose(gaps, np.array([0.5, 0.4]) - planar_radius(model))
    assert gap_to_furniture(Pose(), model, counter, [counter]) == np.inf


def test_things_on_boards_above_each_other_do_not_keep_from_each_other() -> None:
    model = load_scene("kitchen").models["cup"]
    height = float(model.size[2])
    for rise, gap in ((0.0, 0.5), (0.99 * height, 0.5), (1.01 * height, np.inf), (-1.01 * height, np.inf)):
        other = PlacedObject("other", model, Pose(np.array([0.3, 0.4, rise])))
        assert gap_to_objects(Pose(), model, [other]) == pytest.approx(gap - 2 * planar_radius(model)), rise
