"""Calibration: lenses, depth, and where cameras sit, from views of a board."""

from bestman_bt.perception.calibration.board_chain import (
    BoardView,
    ChainParameters,
    ChainPoses,
    ChainResult,
    calibrate_chain,
)
from bestman_bt.perception.calibration.board_pose import BoardPose, board_pose, project
from bestman_bt.perception.calibration.boards import Board, BoardSighting, CharucoBoard, Checkerboard
from bestman_bt.perception.calibration.daniilidis import Daniilidis, DaniilidisParameters
from bestman_bt.perception.calibration.depth_error import DepthErrorParameters, DepthErrorResult, calibrate_depth
from bestman_bt.perception.calibration.errors import CalibrationError, DegenerateMotionError
from bestman_bt.perception.calibration.hand_eye import HandEye, HandEyeParameters, HandEyeResult
from bestman_bt.perception.calibration.hand_eye_refinement import HandEyeNoise
from bestman_bt.perception.calibration.head_camera import HeadAxes, HeadCameraResult, calibrate_head_camera
from bestman_bt.perception.calibration.intrinsics import IntrinsicsParameters, IntrinsicsResult, calibrate_intrinsics
from bestman_bt.perception.calibration.park_martin import ParkMartin, ParkMartinParameters

__all__ = [
    "Board",
    "BoardPose",
    "BoardSighting",
    "BoardView",
    "CalibrationError",
    "ChainParameters",
    "ChainPoses",
    "ChainResult",
    "CharucoBoard",
    "Checkerboard",
    "Daniilidis",
    "DaniilidisParameters",
    "DegenerateMotionError",
    "DepthErrorParameters",
    "DepthErrorResult",
    "HandEye",
    "HandEyeNoise",
    "HandEyeParameters",
    "HandEyeResult",
    "HeadAxes",
    "HeadCameraResult",
    "IntrinsicsParameters",
    "IntrinsicsResult",
    "ParkMartin",
    "ParkMartinParameters",
    "board_pose",
    "calibrate_chain",
    "calibrate_depth",
    "calibrate_head_camera",
    "calibrate_intrinsics",
    "project",
]
