"""Both renderers of scenes with known truth show the same to the pixel and the millimetre."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks import rendering
from benchmarks.rendered_shelf import camera_pose
from bestman_bt.messages import Box, Cylinder, PlacedShape, Pose

SHAPES = [
    (PlacedShape(Box((1.2, 0.8, 0.04)), Pose.from_xyz_rpy((0.9, 0.1, 0.7), (0.0, 0.0, 0.3))), (0.6, 0.4, 0.2)),
    (PlacedShape(Cylinder(0.04, 0.2), Pose.from_xyz_rpy((0.8, -0.1, 0.82), (0.0, 0.0, 0.0))), (0.1, 0.2, 0.8)),
]


def test_pybullet_and_mujoco_show_the_same_scene(monkeypatch: pytest.MonkeyPatch) -> None:
    exact = rendering.DepthNoise(0.0, 0.0, 0.0, 0.0, 1e-6)
    depths = []
    for engine in ("pybullet", "mujoco"):
        monkeypatch.setattr(rendering, "DEFAULT_SIMULATOR", engine)
        view = rendering.render_view(SHAPES, camera_pose(0.1, 0.2, 0.6), np.random.default_rng(0), exact)
        color = view.image.rgb[view.image.depth > 0.0].astype(int)
        assert (color[:, 2] > color[:, 0] + 50).sum() > 1000  # the blue cylinder
        depths.append(view.image.depth)
    first, second = depths
    assert np.mean((first > 0.0) != (second > 0.0)) < 0.002
    both = (first > 0.0) & (second > 0.0)
    assert both.sum() > 20_000
    assert np.quantile(np.abs(first - second)[both], 0.95) < 0.001
