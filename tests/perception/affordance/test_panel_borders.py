from __future__ import annotations

import numpy as np
import pytest

from bestman_bt.perception.affordance.rectified import BorderSearch, PanelBorders, RectifiedFront

CELL = 0.004


def front(columns: int = 300, rows: int = 200) -> RectifiedFront:
    """A plain front, 1.2 by 0.8 metres."""
    height, noise = np.zeros((rows, columns)), np.full((rows, columns), 0.001)
    rgb = np.full((rows, columns, 3), 150.0, dtype=np.float32)
    return RectifiedFront(np.zeros(2), CELL, height, noise, rgb, np.zeros((rows, columns), dtype=bool))


def borders_around(scene: RectifiedFront, x: float, y: float) -> PanelBorders:
    half = np.array([0.05, 0.006])
    return BorderSearch().around(scene, np.array([x, y]) - half, np.array([x, y]) + half)


def test_seams_and_the_ends_of_the_front_bound_the_panel() -> None:
    scene = front()
    scene.rgb[:, 100] = 60.0  # an upright seam at x = 0.4
    scene.rgb[120] = 60.0  # a level seam at y = 0.316
    scene.height[:20] = scene.height[:, :10] = -0.3  # above and to the left something far behind
    found = borders_around(scene, 0.2, 0.5)
    assert found.left == pytest.approx(0.04, abs=0.006)
    assert found.right == pytest.approx(0.40, abs=0.006)
    assert found.bottom == pytest.approx(0.316, abs=0.006)
    assert found.top == pytest.approx(0.716, abs=0.006)


def test_a_window_in_a_door_is_no_border_of_it() -> None:
    scene = front()
    scene.rgb[:, [40, 280]] = scene.rgb[[10, 190]] = 60.0
    scene.rgb[60:140, 60:180] = 20.0
    found = borders_around(scene, 0.9, 0.4)
    assert found.left == pytest.approx(0.16, abs=0.006)
    assert found.right == pytest.approx(1.12, abs=0.006)


def test_a_border_that_is_not_in_the_image_is_unknown() -> None:
    scene = front()
    scene.rgb[:, [40, 280]] = scene.rgb[[10, 190]] = 60.0
    scene.outside[:, 200:] = True
    found = borders_around(scene, 0.5, 0.4)
    assert found.right is None
    assert found.rectangle is None
    assert found.left == pytest.approx(0.16, abs=0.006)
