"""The pose of a board in the camera that sees it.

Collins & Bartoli, "Infinitesimal plane-based pose estimation", International Journal of Computer Vision 2014, then
least squares on the reprojection error.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from bestman_bt.messages import CameraIntrinsics, Pose
from bestman_bt.perception.calibration.boards import BoardSighting
from bestman_bt.perception.calibration.errors import CalibrationError


@dataclass(frozen=True)
class BoardPose:
    """``eye_from_board``; ``error``: root mean square distance of the corners from where the pose puts them, pixels.

    ``ambiguity``: error of this pose over that of the mirrored one: near 1 an image does not tell which way the board
    leans.
    """

    eye_from_board: Pose
    error: float
    ambiguity: float


def board_pose(sighting: BoardSighting, intrinsics: CameraIntrinsics) -> BoardPose:
    """The pose of the board that explains the sighting best; CalibrationError if none does."""
    matrix, distortion = intrinsics.matrix, np.array(intrinsics.distortion)
    points, pixels = sighting.points.reshape(-1, 1, 3), sighting.pixels.reshape(-1, 1, 2)
    count, turns, positions, errors = cv2.solvePnPGeneric(points, pixels, matrix, distortion, flags=cv2.SOLVEPNP_IPPE)
    if not count:
        raise CalibrationError(f"no pose of the board explains the {len(points)} corners that were found")
    turn, position = cv2.solvePnPRefineLM(points, pixels, matrix, distortion, turns[0], positions[0])
    pose = Pose(np.ravel(position), Rotation.from_rotvec(np.ravel(turn)).as_quat())
    offsets = project(sighting.points, pose, intrinsics) - sighting.pixels
    error = float(np.sqrt(np.mean(np.sum(offsets**2, axis=1))))
    others = np.ravel(errors)
    ambiguity = float(others[0] / max(others[1], 1e-9)) if len(others) > 1 else 0.0
    return BoardPose(pose, error, ambiguity)


def project(points: NDArray[np.float64], eye_from_points: Pose, intrinsics: CameraIntrinsics) -> NDArray[np.float64]:
    """Pixels (N, 2) of points (N, 3), with the distortion of the lens."""
    k = intrinsics
    x, y, z = eye_from_points.apply(points).T
    x, y = x / z, y / z
    k1, k2, p1, p2, k3 = (*k.distortion, 0.0, 0.0, 0.0, 0.0, 0.0)[:5]
    r2 = x * x + y * y
    radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
    bent_x = x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x)
    bent_y = y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y
    return np.stack([k.cx + k.fx * bent_x, k.cy + k.fy * bent_y], axis=1)
