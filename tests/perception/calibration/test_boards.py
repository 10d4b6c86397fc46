"""Boards are found in images to a fraction of a pixel, and what is no board is not found."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from bestman_bt.messages import Pose
from bestman_bt.perception.calibration.boards import CalibrationError, CharucoBoard, Checkerboard, board_pose, project
from tests.perception.calibration.recorded import CAMERA, LENS, errors, photographed

CHARUCO = CharucoBoard(7, 5, 0.03, 0.022)
CHESS = Checkerboard(7, 6, 0.03)


def chess_picture(board: Checkerboard, square: int = 40) -> np.ndarray:
    rows, columns = np.indices((board.rows, board.columns))
    return np.kron(np.where((rows + columns) % 2, 255, 0), np.ones((square, square))).astype(np.uint8)


POSE = Pose.from_xyz_rpy((-0.09, -0.07, 0.45), (0.4, -0.25, 0.2))


def test_a_charuco_board_is_found_with_its_pose():
    image = photographed(CHARUCO.picture(60), 60 / 0.03, POSE)
    found = CHARUCO.find(image)
    assert found is not None
    assert len(found.points) == 24
    assert np.abs(found.pixels - project(found.points, POSE, CAMERA)).max() < 0.3
    pose = board_pose(found, CAMERA)
    millimetres, degrees = errors(pose.eye_from_board, POSE)
    assert millimetres < 0.6
    assert degrees < 0.2
    assert pose.error < 0.15
    assert pose.ambiguity < 0.5


def test_a_board_that_is_partly_hidden_is_found_where_it_shows():
    image = photographed(CHARUCO.picture(60), 60 / 0.03, POSE)
    image[:, 320:] = 120
    found = CHARUCO.find(image)
    assert found is not None
    assert 6 <= len(found.points) < 20
    assert np.abs(found.pixels - project(found.points, POSE, CAMERA)).max() < 0.4


def test_a_checkerboard_is_found_as_a_whole_or_not_at_all():
    frame = np.pad(chess_picture(CHESS), 40, constant_values=255)
    shifted = POSE @ Pose(np.array([-0.03, -0.03, 0.0]))
    image = photographed(frame, 40 / 0.03, shifted)
    found = CHESS.find(image)
    assert found is not None
    assert len(found.points) == 30
    offset = project(found.points, POSE, CAMERA) - found.pixels
    reversed_offset = project(found.points[::-1], POSE, CAMERA) - found.pixels
    assert min(np.abs(offset).max(), np.abs(reversed_offset).max()) < 0.4
    image[200:, 300:] = 120
    assert CHESS.find(image) is None


def test_where_there_is_no_board_none_is_found():
    rng = np.random.default_rng(1)
    for image in (
        np.zeros((480, 640, 3), np.uint8),
        rng.integers(0, 255, (480, 640, 3)).astype(np.uint8),
        photographed(CharucoBoard(7, 5, 0.03, 0.022, "DICT_6X6_250").picture(60), 60 / 0.03, POSE),
    ):
        assert CHARUCO.find(image) is None


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ((7, 5, 0.03, 0.04), "markers smaller than them"),
        ((2, 5, 0.03, 0.02), "at least 3 × 3 squares"),
        ((7, 5, 0.03, 0.02, "DICT_9X9"), "no ArUco dictionary 'DICT_9X9'"),
        ((12, 12, 0.03, 0.02, "DICT_4X4_50"), "needs 72 markers, DICT_4X4_50 has 50"),
    ],
)
def test_boards_that_cannot_be_are_refused(arguments, words):
    with pytest.raises(CalibrationError, match=words):
        CharucoBoard(*arguments)


def test_projection_is_that_of_opencv():
    points = np.random.default_rng(2).uniform([-0.2, -0.2, -0.1], [0.2, 0.2, 0.1], (50, 3))
    turn, position = cv2.Rodrigues(POSE.rotation)[0], POSE.position
    expected, _ = cv2.projectPoints(points, turn, position, LENS.matrix, np.array(LENS.distortion))
    assert project(points, POSE, LENS) == pytest.approx(expected.reshape(-1, 2), abs=1e-9)
