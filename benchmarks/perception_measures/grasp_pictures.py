"""Pictures of grasps that failed: what the robot saw and meant to do beside what came of it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import cv2
import numpy as np
from numpy.typing import NDArray

from benchmarks.grasp_rig import GraspOutcome, GraspRig
from bestman_bt.perception.grasp_pose.base import GraspCandidate
from bestman_bt.perception.view import View

if TYPE_CHECKING:
    from benchmarks.perception_measures.grasp_episodes import PlannedGrasp

FINGER, PALM = 0.05, 0.06
"""Metres that the drawn fingers and the drawn approach are long."""


def save_picture(file: Path, rig: GraspRig, planned: PlannedGrasp, outcome: GraspOutcome, target: str) -> None:
    """Left the image with the chosen grasp, magnified around the target; right a photograph of the end."""
    image = np.ascontiguousarray(planned.view.image.rgb.copy())
    if planned.candidate is not None:
        draw_grasp(image, planned.view, planned.candidate)
    pixels, _ = planned.view.project(rig.outline(target))
    where = planned.candidate.grasp.position if planned.candidate else None
    pixels = pixels if where is None else planned.view.project(where[None])[0]
    cropped = _around(image, np.nanmean(pixels, axis=0))
    pair = np.concatenate([cropped, rig.photograph(target)], axis=1)
    lines = [outcome.why, *(f"{name}: {value}" for name, value in planned.notes.items())]
    pair = np.concatenate([pair, np.full((20 * len(lines) + 8, pair.shape[1], 3), 255, np.uint8)])
    for line, text in enumerate(lines):
        place = (8, 480 + 18 + 20 * line)
        cv2.putText(pair, text[:140], place, cv2.FONT_HERSHEY_SIMPLEX, 0.45, (20, 20, 20), 1, cv2.LINE_AA)
    file.parent.mkdir(parents=True, exist_ok=True)
    cv2.imwrite(str(file), cv2.cvtColor(pair, cv2.COLOR_RGB2BGR))


def draw_grasp(image: NDArray[np.uint8], view: View, candidate: GraspCandidate) -> None:
    """The opened fingers, the line between them and the approach, as lines in the image (H, W, 3)."""
    half = candidate.opening / 2
    lines = [
        [(0, -half, 0), (0, -half, -FINGER), (0, half, -FINGER), (0, half, 0)],
        [(0, 0, -FINGER), (0, 0, -FINGER - PALM)],
    ]
    touch = [(0, -candidate.width / 2, 0), (0, candidate.width / 2, 0)]
    for corners, color in [(line, (20, 200, 40)) for line in lines] + [(touch, (230, 40, 40))]:
        pixels, _ = view.project(candidate.grasp.apply(np.array(corners, dtype=float)))
        if np.isfinite(pixels).all():
            cv2.polylines(image, [np.rint(pixels).astype(np.int32)], False, color, 1, cv2.LINE_AA)


def _around(
    image: NDArray[np.uint8], pixel: NDArray[np.float64], size: tuple[int, int] = (213, 160)
) -> NDArray[np.uint8]:
    """The part of ``size`` around ``pixel``, as large as the whole image is."""
    corner = [int(np.clip(pixel[k] - size[k] / 2, 0, image.shape[1 - k] - size[k])) for k in range(2)]
    part = image[corner[1] : corner[1] + size[1], corner[0] : corner[0] + size[0]]
    return cv2.resize(part, (640, 480), interpolation=cv2.INTER_NEAREST).astype(np.uint8)
