"""From a dataset to where a camera sits on an arm, or beside one."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from bestman_bt.messages import Pose
from bestman_bt.perception.calibration import BoardView, CalibrationError, ChainCalibration, ChainPoses, board_pose
from bestman_bt.registry import ALGORITHMS
from bestman_bt.runtime.calibration.dataset import Dataset, Progress
from bestman_bt.runtime.calibration.result import CalibrationResult, deviations
from bestman_bt.runtime.calibration.robot_chain import written
from bestman_bt.runtime.calibration.seen_views import add_depth, both_ends, chain_of, result_of, seen_views


def solve_hand_eye(dataset: Dataset, method: str, progress: Progress) -> CalibrationResult:
    """A camera on an arm before a fixed board, or a fixed camera before a board on the arm."""
    if not dataset.board.tells_orientation:
        raise CalibrationError("a checkerboard looks the same after half a turn; poses need a ChArUco board")
    chain = chain_of(dataset)
    seen = seen_views(dataset, chain, progress)
    carriers, holders = both_ends(dataset, chain, seen)
    in_camera = [board_pose(sighting, seen.intrinsics).eye_from_board for sighting in seen.sightings]
    world_from_carrier = [holder.inverse() @ carrier for holder, carrier in zip(holders, carriers, strict=True)]
    algorithm = ALGORITHMS.resolve(f"calibration/{method}")()
    first = algorithm.calibrate(world_from_carrier, in_camera)
    views = [BoardView(*view) for view in zip(seen.sightings, carriers, holders, strict=True)]
    start = ChainPoses(Pose(), first.carrier_from_eye, first.world_from_target)
    refined = ChainCalibration().calibrate(views, seen.intrinsics, start, ("camera", "board"))
    camera = refined.poses.camera
    settings: dict[str, Any] = {}
    figures: dict[str, Any] = {
        "method": method,
        "carrier": chain.carrier if chain is not None else "hand",
        "carrier_from_camera": {**written(camera), "quaternion_xyzw": camera.quaternion},
        "standard_deviations": deviations(refined.covariance["camera"]),
        "covariance": refined.covariance["camera"],
        "closed_form": {
            "apart_mm": 1e3 * float(np.linalg.norm(first.carrier_from_eye.position - camera.position)),
            "apart_deg": _degrees(first.carrier_from_eye, camera),
        },
    }
    seen_poses = [refined.poses.board_in_camera(view) for view in views]
    notes = add_depth(seen, seen_poses, settings, figures)
    part: dict[str, Any] = chain.camera_mount(camera) if chain is not None else written(camera)
    if settings:
        part["set"] = settings
    return result_of("hand_eye", dataset, seen, refined.offsets, {dataset.config.camera: part}, figures, notes)


def _degrees(a: Pose, b: Pose) -> float:
    return math.degrees(2.0 * math.asin(min(1.0, float(np.linalg.norm((a.inverse() @ b).quaternion[:3])))))
