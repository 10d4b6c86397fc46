from __future__ import annotations

import numpy as np
import pytest

from bestman_bt.perception.detection.color_shape import palette_distance

RED, GREEN, WHITE, BLACK = (0.8, 0.2, 0.2), (0.2, 0.7, 0.3), (0.9, 0.9, 0.9), (0.1, 0.1, 0.1)
ALL = np.ones((1, 1))


def cluster(*parts: tuple[tuple[float, float, float], int], light: float = 1.0) -> np.ndarray:
    colors = np.concatenate([np.tile(color, (count, 1)) for color, count in parts])
    noise = np.random.default_rng(0).normal(0.0, 0.02, colors.shape)
    return (255 * np.clip(light * colors + noise, 0.0, 1.0)).astype(np.uint8)


@pytest.mark.parametrize("light", [1.0, 0.7, 0.5])
def test_a_colour_is_its_own_in_any_light(light: float) -> None:
    assert palette_distance(cluster((RED, 200), light=light), np.array([RED]), ALL) < 0.06


def test_another_colour_is_far() -> None:
    assert palette_distance(cluster((RED, 200)), np.array([GREEN]), ALL) > 0.3


def test_white_and_black_differ_though_their_chromaticity_does_not() -> None:
    own = palette_distance(cluster((WHITE, 200)), np.array([WHITE]), ALL)
    assert palette_distance(cluster((WHITE, 200)), np.array([BLACK]), ALL) > own + 0.1


def test_shares_of_colours_count() -> None:
    palette, mostly_red = np.array([RED, GREEN]), np.array([[0.8, 0.2]])
    right = palette_distance(cluster((RED, 160), (GREEN, 40)), palette, mostly_red)
    swapped = palette_distance(cluster((RED, 40), (GREEN, 160)), palette, mostly_red)
    assert right < 0.05
    assert swapped > right + 0.1


def test_the_best_yaw_decides_on_shares() -> None:
    palette, yaws = np.array([RED, GREEN]), np.array([[1.0, 0.0], [0.2, 0.8]])
    assert palette_distance(cluster((RED, 40), (GREEN, 160)), palette, yaws) < 0.05
