"""Scale and offset of a depth sensor are recovered from a board."""

from __future__ import annotations

from functools import cache

import cv2
import numpy as np
import pytest

from bestman_bt.messages import Pose
from bestman_bt.perception.calibration.boards import CalibrationError, DegenerateMotionError
from bestman_bt.perception.calibration.depth_error import DepthCalibration
from tests.perception.calibration.recorded import LENS, corners, sighting, turned


@cache
def rays() -> np.ndarray:
    """Of the pixels (480, 640), each (3,), through the real lens."""
    pixels = np.stack(np.meshgrid(np.arange(640.0), np.arange(480.0)), axis=-1).reshape(-1, 1, 2)
    ideal = cv2.undistortPoints(pixels, LENS.matrix, np.array(LENS.distortion)).reshape(480, 640, 2)
    return np.concatenate([ideal, np.ones((480, 640, 1))], axis=-1)


def plane_depth(eye_from_board: Pose) -> np.ndarray:
    normal = eye_from_board.rotation[:, 2]
    return normal @ eye_from_board.position / (rays() @ normal)


def view(distance: float, rng: np.random.Generator, scale: float = 1.0, offset: float = 0.0):
    """Corners, pose, and the depth of the board's plane as the sensor tells it, with 3 mm of noise and holes."""
    lean = turned(np.append(rng.uniform(-0.4, 0.4, 2), 0.0))
    pose = Pose(np.array([0.0, 0.0, distance])) @ lean @ Pose(-corners().mean(axis=0))
    true = plane_depth(pose)
    told = scale * true + offset + rng.normal(0.0, 0.003, true.shape)
    told[rng.random(told.shape) < 0.05] = 0.0
    return sighting(pose, LENS, rng, 0.1), pose, told.astype(np.float32)


def test_scale_and_offset_are_recovered():
    rng = np.random.default_rng(1)
    views = [view(distance, rng, 1.02, -0.008) for distance in np.linspace(0.35, 1.1, 12)]
    result = DepthCalibration().calibrate(views, LENS)
    assert result.correction.scale == pytest.approx(1.02, abs=0.002)
    assert result.correction.offset == pytest.approx(-0.008, abs=0.0015)
    assert abs(result.correction.scale - 1.02) < 4 * result.scale_std + 1e-3
    assert np.abs(result.residuals).max() < 0.003
    assert len(result.distances) == 12


def test_the_true_depth_is_that_along_the_rays_of_the_real_lens():
    place = Pose(np.array([0.14, -0.1, 0.45])) @ turned(np.array([0.5, 0.4, 0.0])) @ Pose(-corners().mean(axis=0))
    seen = sighting(place, LENS, np.random.default_rng(5), 0.0)
    told, true = DepthCalibration().measured_and_true(seen, place, plane_depth(place).astype(np.float32), LENS)
    assert told == pytest.approx(true, abs=2e-5)


def test_one_view_with_something_before_the_board_does_not_matter():
    rng = np.random.default_rng(2)
    views = [view(distance, rng, 0.99, 0.004) for distance in np.linspace(0.35, 1.1, 12)]
    views[5][2][:] = 0.2
    result = DepthCalibration().calibrate(views, LENS)
    assert result.correction.scale == pytest.approx(0.99, abs=0.004)
    assert result.correction.offset == pytest.approx(0.004, abs=0.0015)
    assert np.argmax(np.abs(result.residuals)) == 5


def test_one_distance_does_not_tell_scale_from_offset():
    rng = np.random.default_rng(3)
    with pytest.raises(DegenerateMotionError, match="cannot be distinguished"):
        DepthCalibration().calibrate([view(0.5, rng) for _ in range(5)], LENS)


def test_images_without_depth_are_refused():
    rng = np.random.default_rng(4)
    blind = [(s, p, np.zeros_like(d)) for s, p, d in (view(0.5, rng), view(0.9, rng))]
    with pytest.raises(CalibrationError, match="0 of 2 views have depth on the board"):
        DepthCalibration().calibrate(blind, LENS)
