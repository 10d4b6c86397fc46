"""Calibration: lenses, depth, and where cameras sit, from views of a board."""

from bestman_bt.perception.calibration.boards import (
    Board,
    BoardPose,
    BoardSighting,
    CalibrationError,
    CharucoBoard,
    Checkerboard,
    ContradictingViewsError,
    DegenerateMotionError,
    board_pose,
    project,
)
from bestman_bt.perception.calibration.depth_error import DepthCalibration, DepthErrorResult
from bestman_bt.perception.calibration.hand_eye import Daniilidis, HandEye, HandEyeResult, ParkMartin
from bestman_bt.perception.calibration.hand_eye_refinement import HandEyeNoise
from bestman_bt.perception.calibration.head_camera import (
    BoardView,
    ChainCalibration,
    ChainPoses,
    ChainResult,
    HeadAxes,
    HeadCameraResult,
    calibrate_head_camera,
)
from bestman_bt.perception.calibration.intrinsics import IntrinsicsCalibration, IntrinsicsResult

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
    "ContradictingViewsError",
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
