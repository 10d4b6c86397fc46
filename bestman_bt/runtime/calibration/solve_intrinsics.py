"""From a dataset to the intrinsics and the distortion of a lens."""

from __future__ import annotations

from typing import Any

from bestman_bt.perception.calibration import IntrinsicsCalibration, board_pose, project
from bestman_bt.runtime.calibration.dataset import Dataset, Progress
from bestman_bt.runtime.calibration.result import CalibrationResult
from bestman_bt.runtime.calibration.seen_views import Seen, result_of


def solve_intrinsics(dataset: Dataset, method: IntrinsicsCalibration, progress: Progress) -> CalibrationResult:
    """Focal lengths, principal point, distortion. Raises CalibrationError."""
    views, size = dataset.read(progress)
    found = method.calibrate([view.sighting for view in views], size)
    k = found.intrinsics
    used = tuple(views[index] for index in found.used)
    sightings = tuple(view.sighting for view in used if view.sighting is not None)
    seen = Seen(used, sightings, k, len(views))
    settings: dict[str, Any] = {
        "width": k.width,
        "height": k.height,
        "focal_length": [k.fx, k.fy],
        "principal_point": [k.cx, k.cy],
        "distortion": list(k.distortion),
    }
    names = ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3")
    figures: dict[str, Any] = {
        "standard_deviations": dict(zip(names, found.standard_deviations.tolist(), strict=True)),
        "coverage": float(found.coverage.mean()),
    }
    offsets = [
        project(sighting.points, board_pose(sighting, k).eye_from_board, k) - sighting.pixels for sighting in sightings
    ]
    return result_of("intrinsics", dataset, seen, offsets, {dataset.config.camera: {"set": settings}}, figures, [])
