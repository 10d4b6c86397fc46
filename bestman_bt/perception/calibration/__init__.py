"""Calibration: lenses, depth, and where cameras sit, from views of a board."""

from bestman_bt.perception.calibration.board_chain import (
    BoardView,
    ChainCalibration,
    ChainPoses,
    ChainResult,
)
from bestman_bt.perception.calibration.board_pose import BoardPose, board_pose, project
from bestman_bt.perception.calibration.boards import Board, BoardSighting, CharucoBoard, Checkerboard
from bestman_bt.perception.calibration.daniilidis import Daniilidis
from bestman_bt.perception.calibration.depth_error import DepthCalibration, DepthErrorResult
from bestman_bt.perception.calibration.errors import CalibrationError, DegenerateMotionError
from bestman_bt.perception.calibration.hand_eye import HandEye, HandEyeResult
from bestman_bt.perception.calibration.hand_eye_refinement import HandEyeNoise
from bestman_bt.perception.calibration.head_camera import HeadAxes, HeadCameraResult, calibrate_head_camera
from bestman_bt.perception.calibration.intrinsics import IntrinsicsCalibration, IntrinsicsResult
from bestman_bt.perception.calibration.park_martin import ParkMartin

__all__ = [
    "Board",
    "BoardPose",
    "BoardSighting",
    "BoardView",
    "CalibrationError",
    "ChainCalibration",
    "ChainPoses",
    "ChainResult",
    "CharucoBoard",
    "Checkerboard",
    "Daniilidis",
    "DegenerateMotionError",
    "DepthCalibration",
    "DepthErrorResult",
    "HandEye",
    "HandEyeNoise",
    "HandEyeResult",
    "HeadAxes",
    "HeadCameraResult",
    "IntrinsicsCalibration",
    "IntrinsicsResult",
    "ParkMartin",
    "board_pose",
    "calibrate_head_camera",
    "project",
]
