"""Which pixels show the robot itself, or what it holds: they say nothing about the world."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from bestman_bt.manipulation.kinematics import ForwardKinematics, link_hulls
from bestman_bt.messages import CameraIntrinsics, Pose, RGBDImage
from bestman_bt.robot_model import RobotModel
from bestman_bt.world_model import HeldObject

NEAREST = 0.02
"""Metres before the camera: a body nearer than this is part of the camera's own mount and not drawn."""


class SelfFilter:
    """Compares the image with the silhouettes of all links, by encoders and forward kinematics.

    ``margin``: metres by which a silhouette is widened, for calibration errors and covers that the model lacks. What
    lies further behind a link than ``slack`` metres is not the robot.
    """

    def __init__(
        self, robot: RobotModel, kinematics: ForwardKinematics, margin: float = 0.015, slack: float = 0.05
    ) -> None:
        self._robot = robot
        self._kinematics = kinematics
        self._margin = margin
        self._slack = slack

    @cached_property
    def _hulls(self) -> Mapping[str, tuple[NDArray[np.float64], ...]]:
        return link_hulls(self._robot)

    def mask(
        self,
        image: RGBDImage,
        base_from_camera: Pose,
        positions: Mapping[str, float],
        held: HeldObject | None = None,
    ) -> NDArray[np.bool_]:
        """(H, W), True where a pixel shows the robot or the held object. ``positions``: of all joints, by name."""
        bodies = self._bodies(base_from_camera.inverse(), positions, held)
        reach = np.zeros(image.depth.shape, dtype=np.float32)
        # The farthest last, so that it prevails where silhouettes overlap.
        for body in sorted(bodies, key=lambda points: float(points[:, 2].max())):
            self._draw(reach, image.intrinsics, body)
        return image.depth < reach

    def _bodies(
        self, camera_from_base: Pose, positions: Mapping[str, float], held: HeldObject | None
    ) -> list[NDArray[np.float64]]:
        """Corners of all convex bodies in the optical frame."""
        bodies = []
        for link, hulls in self._hulls.items():
            camera_from_link = camera_from_base @ self._kinematics.pose(link, positions)
            bodies += [camera_from_link.apply(hull) for hull in hulls]
        if held is not None:
            tool_frame = next(iter(self._robot.arms.values())).tool_frame
            camera_from_tool = camera_from_base @ self._kinematics.pose(tool_frame, positions)
            lower, upper = held.model.bounds()
            box = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)]) * (upper - lower) + lower
            bodies.append((camera_from_tool @ held.tool_from_object).apply(box))
        return bodies

    def _draw(self, reach: NDArray[np.float32], camera: CameraIntrinsics, points: NDArray[np.float64]) -> None:
        depth = points[:, 2]
        if depth.min() < NEAREST:
            return
        pixels = np.column_stack(
            [camera.cx + camera.fx * points[:, 0] / depth, camera.cy + camera.fy * points[:, 1] / depth]
        )
        outline = cv2.convexHull(pixels.astype(np.float32)).astype(np.int32)
        farthest = float(depth.max()) + self._slack
        cv2.fillConvexPoly(reach, outline, farthest)
        widened = 2 * round(self._margin * camera.fx / float(depth.min()))
        if widened > 0:
            cv2.polylines(reach, [outline], True, farthest, widened)
