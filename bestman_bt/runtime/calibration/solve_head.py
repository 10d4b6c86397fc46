"""From a dataset to where a pan-tilt head stands, and how its camera sits on it."""

from __future__ import annotations

import math
from typing import Any

from bestman_bt.configuration import ConfigurationError
from bestman_bt.perception.calibration import BoardView, CalibrationError, calibrate_head_camera
from bestman_bt.runtime.calibration.dataset import Dataset, Progress, pose_of
from bestman_bt.runtime.calibration.result import CalibrationResult, deviations
from bestman_bt.runtime.calibration.seen_views import add_depth, both_ends, chain_of, result_of, seen_views


def solve_head(dataset: Dataset, progress: Progress) -> CalibrationResult:
    """A camera on a pan-tilt head, before a fixed board or one on the arm."""
    if not dataset.board.tells_orientation:
        raise CalibrationError("a checkerboard looks the same after half a turn; poses need a ChArUco board")
    chain = chain_of(dataset)
    head = chain.head if chain is not None else None
    if chain is None or head is None:
        message = "no pan-tilt of a robot moves this camera; for others use bestman-bt calibrate hand-eye"
        raise ConfigurationError([dataset.document.problem(("camera",), message)])
    seen = seen_views(dataset, chain, progress)
    root = chain.head_root(head)
    joints = [dataset.config.views[view.index].joints for view in seen.views]
    _, holders = both_ends(dataset, chain, seen)
    views = [
        BoardView(sighting, chain.kinematics.pose(chain.carrier, positions, root), holder)
        for sighting, positions, holder in zip(seen.sightings, joints, holders, strict=True)
    ]
    measured = dataset.config.board_pose
    found = calibrate_head_camera(
        views,
        seen.intrinsics,
        chain.kinematics.pose(root, {}),
        chain.carrier_from_camera(),
        pose_of(measured) if measured is not None else None,
        chain.head_axes(head),
    )
    poses = found.chain.poses
    parts: dict[str, dict[str, Any]] = {}
    if "mount" in found.free:
        parts[head] = dict(chain.head_mount(head, poses.mount))
    parts[chain.camera] = dict(chain.camera_mount(poses.camera))
    settings: dict[str, Any] = {}
    figures: dict[str, Any] = {
        "estimated": list(found.free),
        "offsets_deg": {
            "pan": None if found.pan_offset is None else math.degrees(found.pan_offset),
            "tilt": math.degrees(found.tilt_offset),
        },
        "standard_deviations": {name: deviations(block) for name, block in found.chain.covariance.items()},
        "covariance": {name: block for name, block in found.chain.covariance.items() if name != "board"},
    }
    notes = add_depth(seen, [poses.board_in_camera(view) for view in views], settings, figures)
    if settings:
        parts[chain.camera]["set"] = settings
    if "mount" not in found.free:
        notes.append(
            "where the head stands was not estimated: that needs a board on the arm, or one at a measured place"
        )
    return result_of("head", dataset, seen, found.chain.offsets, parts, figures, notes)
