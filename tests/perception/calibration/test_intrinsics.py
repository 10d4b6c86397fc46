"""A lens is recovered from corners; views that cannot tell it are refused in words."""

from __future__ import annotations

import math

import numpy as np
import pytest

from bestman_bt.messages import Pose
from bestman_bt.perception.calibration.boards import CalibrationError, DegenerateMotionError, project
from bestman_bt.perception.calibration.intrinsics import IntrinsicsCalibration
from tests.perception.calibration.recorded import CAMERA, LENS, corners, sighting, turned

SIZE = (640, 480)


def sightings(rng: np.random.Generator, count: int = 25, lean: float = 0.6, camera=LENS, spread: float = 0.26):
    """Views of the board all over the image."""
    middle = Pose(-corners().mean(axis=0))
    found = []
    for _ in range(count):
        distance = rng.uniform(0.3, 0.5)
        centre = np.append(rng.uniform(-spread, spread, 2) * (1.3, 1.0) * distance / 0.45, distance)
        pose = Pose(centre) @ turned(np.append(rng.uniform(-lean, lean, 2), rng.uniform(-1, 1))) @ middle
        found.append(sighting(pose, camera, rng))
    return found


@pytest.mark.slow
def test_focal_length_centre_and_distortion_are_recovered():
    parameters = IntrinsicsCalibration(lens="k1_k2_p1_p2_k3")
    result = parameters.calibrate(sightings(np.random.default_rng(1), 40), SIZE)
    k = result.intrinsics
    found = np.array([k.fx, k.fy, k.cx, k.cy])
    true = np.array([LENS.fx, LENS.fy, LENS.cx, LENS.cy])
    assert np.abs(found - true).max() < 3.0
    assert (np.abs(found - true) < 4 * result.standard_deviations[:4]).all()
    assert 0.08 < result.error < 0.2
    # What counts is where pixels look, up to a turn of the camera, not single coefficients: compare images of a wall.
    x, y = np.meshgrid(np.linspace(-0.6, 0.6, 9), np.linspace(-0.45, 0.45, 7))
    wall = np.stack([x.ravel(), y.ravel(), np.ones(x.size)], axis=1)
    difference = project(wall, Pose(), k) - project(wall, Pose(), LENS)
    assert np.abs(difference - difference.mean(axis=0)).max() < 1.0


def test_a_pinhole_is_recovered_without_distortion_when_asked():
    parameters = IntrinsicsCalibration(lens="none")
    result = parameters.calibrate(sightings(np.random.default_rng(2), camera=CAMERA), SIZE)
    assert result.intrinsics.distortion == ()
    assert result.intrinsics.fx == pytest.approx(CAMERA.fx, abs=1.0)


def test_views_without_a_board_are_left_out_and_counted():
    rng = np.random.default_rng(3)
    with_gaps = [None, *sightings(rng), None]
    result = IntrinsicsCalibration().calibrate(with_gaps, SIZE)
    assert 0 not in result.used
    assert len(result.used) == len(result.errors)
    with pytest.raises(CalibrationError, match="0 of 3 views show at least 8 corners of the board, 8 are needed"):
        IntrinsicsCalibration().calibrate([None] * 3, SIZE)


def test_a_corner_of_the_image_that_was_never_covered_is_named():
    rng = np.random.default_rng(4)
    left_only = [s for s in sightings(rng, 80) if s.pixels[:, 0].max() < 330]
    with pytest.raises(CalibrationError, match=r"cover \d\d% of the image, 60% are needed; .* right"):
        IntrinsicsCalibration().calibrate(left_only, SIZE)


@pytest.mark.slow
def test_boards_that_never_lean_are_refused():
    flat = sightings(np.random.default_rng(5), 40, lean=math.radians(2.0), camera=CAMERA)
    with pytest.raises(DegenerateMotionError, match="leaning by 15° or more"):
        IntrinsicsCalibration(lens="none").calibrate(flat, SIZE)
