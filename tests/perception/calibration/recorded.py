"""What a robot would record before a board: true poses, noise on both sides, corners in pixels."""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

from bestman_bt.messages import CameraIntrinsics, Pose
from bestman_bt.perception.calibration.boards import BoardSighting, project

CAMERA = CameraIntrinsics(640, 480, 433.0, 433.0, 319.5, 239.5)
LENS = CameraIntrinsics(640, 480, 431.0, 435.0, 322.0, 236.0, (-0.21, 0.06, 0.0012, -0.0008, -0.01))


@dataclass(frozen=True)
class Recording:
    """``carrier_from_eye`` and ``world_from_target`` are the truth, the other two what is measured, view by view."""

    carrier_from_eye: Pose
    world_from_target: Pose
    world_from_carrier: list[Pose]
    eye_from_target: list[Pose]


def turned(axis_angle: np.ndarray) -> Pose:
    return Pose(np.zeros(3), Rotation.from_rotvec(axis_angle).as_quat())


def noisy(pose: Pose, position: float, rotation: float, rng: np.random.Generator) -> Pose:
    """The pose with normal noise of these standard deviations per axis, metres and radians."""
    shaken = pose @ turned(rng.normal(0.0, rotation, 3))
    return Pose(pose.position + rng.normal(0.0, position, 3), shaken.quaternion)


def target_before_the_eye(rng: np.random.Generator) -> Pose:
    """A board 35 to 60 cm away, leaning by up to 35°, turned by up to 60°."""
    lean = rng.uniform(-1, 1, 2)
    lean *= math.radians(35.0) / max(1.0, float(np.linalg.norm(lean)))
    roll = math.radians(60.0) * rng.uniform(-1, 1)
    return Pose(np.append(rng.uniform(-0.05, 0.05, 2), rng.uniform(0.35, 0.6))) @ turned(np.append(lean, roll))


def hand_eye_recording(
    seed: int, views: int = 20, position: float = 0.0003, rotation: float = math.radians(0.05)
) -> Recording:
    """A camera on a hand before a fixed target, with noise on the poses of the hand and of the target seen."""
    rng = np.random.default_rng(seed)
    hand_from_eye = Pose(rng.uniform(-0.1, 0.1, 3), Rotation.random(rng=rng).as_quat())
    base_from_target = Pose(np.array([0.6, 0.0, 0.2]) + rng.uniform(-0.1, 0.1, 3)) @ turned(np.array([math.pi, 0, 0]))
    hands, seen = [], []
    for _ in range(views):
        eye_from_target = target_before_the_eye(rng)
        base_from_hand = base_from_target @ eye_from_target.inverse() @ hand_from_eye.inverse()
        hands.append(noisy(base_from_hand, position, rotation, rng))
        seen.append(noisy(eye_from_target, position, rotation, rng))
    return Recording(hand_from_eye, base_from_target, hands, seen)


def corners() -> np.ndarray:
    """The inner corners of 7 × 5 squares of 30 mm, (24, 3), in the board frame."""
    x, y = np.meshgrid(np.arange(1, 7), np.arange(1, 5))
    return 0.03 * np.stack([x.ravel(), y.ravel(), np.zeros(24)], axis=1)


def sighting(
    eye_from_board: Pose, camera: CameraIntrinsics, rng: np.random.Generator, noise: float = 0.1
) -> BoardSighting:
    """The corners as an image shows them, with ``noise`` pixels; those outside the image are missing."""
    points = corners()
    pixels = project(points, eye_from_board, camera) + rng.normal(0.0, noise, (len(points), 2))
    inside = ((pixels > 0) & (pixels < (camera.width - 1, camera.height - 1))).all(axis=1)
    return BoardSighting(points[inside], pixels[inside])


def errors(found: Pose, true: Pose) -> tuple[float, float]:
    """Millimetres and degrees between two poses."""
    angle = 2.0 * math.asin(min(1.0, float(np.linalg.norm((found.inverse() @ true).quaternion[:3]))))
    return 1e3 * float(np.linalg.norm(found.position - true.position)), math.degrees(angle)


def photographed(picture: np.ndarray, pixels_per_metre: float, eye_from_board: Pose) -> np.ndarray:
    """The picture of a board as CAMERA sees it at a pose, on grey."""
    height, width = picture.shape
    outline = np.array([[0, 0], [width, 0], [width, height], [0, height]], dtype=float) - 0.5
    points = np.column_stack([(outline + 0.5) / pixels_per_metre, np.zeros(4)])
    pixels = project(points, eye_from_board, CAMERA)
    homography = cv2.getPerspectiveTransform(outline.astype(np.float32), (4 * pixels + 1.5).astype(np.float32))
    large = cv2.warpPerspective(picture, homography, (4 * 640, 4 * 480), borderValue=120)
    image = cv2.resize(large, (640, 480), interpolation=cv2.INTER_AREA)
    return cv2.cvtColor(image, cv2.COLOR_GRAY2RGB)
