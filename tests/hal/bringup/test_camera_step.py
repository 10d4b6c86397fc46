"""The camera step: a board is seen where it was measured, or the camera is mounted otherwise than the file says."""

from __future__ import annotations

import math
from pathlib import Path

import cv2
import numpy as np
import pytest

from bestman_bt.bringup.sensors import BOARD, board_finding, board_in_view
from bestman_bt.cli.options import pose
from bestman_bt.manipulation.kinematics.link_hulls import ForwardKinematics
from bestman_bt.messages import CameraIntrinsics, Pose, RGBDImage
from bestman_bt.robot_model.compose import load_robot_model
from bestman_bt.runtime.calibration.board_link import with_board
from bestman_bt.scene.draw import draw_world
from bestman_bt.scene.load import load_scene
from hal.api import Camera, JointGroup
from hal.pybullet.robot import PyBulletRobot

LENS = CameraIntrinsics(640, 480, 600.0, 600.0, 320.0, 240.0)
EYE_FROM_BOARD = Pose.from_xyz_rpy((-0.12, -0.08, 0.6), (0.3, 0.2, 0.1))
BASE_FROM_EYE = Pose.from_xyz_rpy((0.1, 0.02, 1.2), (-2.2, 0.0, -math.pi / 2))


def picture(of_board: bool = True) -> RGBDImage:
    """What a camera sees of a board on grey."""
    pattern = BOARD.picture(80)
    corners = np.array([[0, 0], [pattern.shape[1], 0], [pattern.shape[1], pattern.shape[0]], [0, pattern.shape[0]]])
    points = EYE_FROM_BOARD.apply(np.hstack([corners * BOARD.square / 80, np.zeros((4, 1))]))
    pixels = (points[:, :2] / points[:, 2:]) * [LENS.fx, LENS.fy] + [LENS.cx, LENS.cy]
    warp = cv2.getPerspectiveTransform(corners.astype(np.float32), pixels.astype(np.float32))
    seen = cv2.warpPerspective(pattern, warp, (640, 480), borderValue=128, flags=cv2.INTER_AREA)
    grey = seen if of_board else np.full((480, 640), 128, np.uint8)
    return RGBDImage(np.repeat(grey[:, :, None], 3, axis=2), np.zeros((480, 640), np.float32), LENS, 0.0)


@pytest.mark.parametrize(
    ("mounted_otherwise", "outcome"),
    [
        (Pose(), "passed"),
        (Pose.from_xyz_rpy((0.012, 0.0, 0.0)), "passed"),
        (Pose.from_xyz_rpy((0.02, 0.0, 0.0)), "failed"),
        (Pose.from_xyz_rpy((0.0, 0.0, 0.0), (0.0, 0.06, 0.0)), "failed"),
        (Pose.from_xyz_rpy((0.0, 0.0, 0.0), (0.0, 0.0, math.pi)), "failed"),
    ],
)
def test_a_camera_that_is_mounted_otherwise_than_its_file_says_fails(mounted_otherwise: Pose, outcome: str) -> None:
    finding = board_finding("head_camera", picture(), BASE_FROM_EYE @ mounted_otherwise, BASE_FROM_EYE @ EYE_FROM_BOARD)
    assert finding is not None
    assert finding.outcome == outcome, finding.text


def test_a_camera_that_sees_no_board_finds_nothing() -> None:
    assert board_finding("head_camera", picture(of_board=False), BASE_FROM_EYE, Pose()) is None


@pytest.mark.slow
@pytest.mark.parametrize(("built", "outcome"), [("5 cm", "passed"), ("8 cm", "failed")])
def test_the_board_of_a_twin_shows_a_camera_that_is_built_in_elsewhere(built: str, outcome: str) -> None:
    file = Path(__file__).parents[1] / "rosbridge" / "ros_robot.yaml"
    model = load_robot_model(file)
    board = board_in_view(model)
    assert board is not None
    base_from_board = pose("--board", board)
    as_built = load_robot_model(file, {"parts.head_camera.xyz": [built, 0, 0]})
    twin = with_board(as_built, BOARD, as_built.base_frame, base_from_board)
    with PyBulletRobot(twin, draw_world(load_scene("pick_place_table"), 1)) as robot:
        image = robot.part("head_camera", Camera).capture()
        head = robot.part("head", JointGroup)
        joints = dict(zip(head.joint_names, head.positions().tolist(), strict=True))
    base_from_eye = ForwardKinematics(model).pose("head_camera_optical_frame", joints, model.base_frame)
    finding = board_finding("head_camera", image, base_from_eye, base_from_board)
    assert finding is not None
    assert finding.outcome == outcome, finding.text


def test_a_robot_without_a_camera_behind_a_connection_gets_no_board() -> None:
    assert board_in_view(load_robot_model("diff_panda")) is None
