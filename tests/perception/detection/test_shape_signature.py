from __future__ import annotations

import math

import numpy as np
import pytest

from benchmarks.rendered_table import known_models, solid
from bestman_bt.messages import Box, Cylinder, Sphere
from bestman_bt.perception.detection.color_shape import model_appearance, signature

GREY = (0.6, 0.6, 0.6)
EYE = np.array([-1.0, 0.0, 1.0])


def wall(radius: float, height: float = 0.1) -> np.ndarray:
    """The half of a cylinder's side that faces the camera."""
    angle, z = np.meshgrid(np.linspace(-math.pi / 2, math.pi / 2, 30), np.linspace(0.0, height, 30))
    return np.stack([-radius * np.cos(angle), radius * np.sin(angle), z], axis=-1).reshape(-1, 3)


def test_height_and_widths_are_those_of_the_points() -> None:
    top, low, middle, high, *_ = signature(wall(0.03), EYE)
    assert top == pytest.approx(0.1, abs=0.004)
    np.testing.assert_allclose([low, middle, high], 0.06, atol=0.004)


def test_a_can_bulges_a_face_does_not_and_the_inside_of_a_cup_is_hollow() -> None:
    flat = wall(0.03)
    flat[:, 0] = 0.0
    assert signature(wall(0.03), EYE)[6] > 0.015
    assert abs(signature(flat, EYE)[6]) < 0.001
    assert signature(wall(0.03) * (-1.0, 1.0, 1.0), EYE)[6] < -0.015


@pytest.mark.parametrize("seen", range(5))
def test_each_model_looks_most_like_itself(seen: int) -> None:
    models = (
        solid("ball", Sphere(0.04), GREY, 0),
        solid("can", Cylinder(0.033, 0.12), GREY, 0),
        solid("box", Box((0.06, 0.06, 0.12)), GREY, 4),
        solid("brick", Box((0.06, 0.12, 0.06)), GREY, 2),
        solid("plate", Box((0.15, 0.15, 0.02)), GREY, 4),
    )
    own = model_appearance(models[seen], 0.8, yaws=17, spacing=0.004)
    distances = [
        np.mean([model_appearance(model, 0.8).shape_distance(found) for found in own.signatures]) for model in models
    ]
    assert int(np.argmin(distances)) == seen
    assert distances[seen] < 0.7
    assert sorted(distances)[1] > distances[seen] + 0.05


def test_a_body_of_revolution_has_one_yaw_and_a_box_as_many_as_look_different() -> None:
    cup, _, box, _, cube = known_models(0)
    assert [len(model_appearance(model, 0.8).signatures) for model in (cup, box, cube)] == [1, 12, 6]
