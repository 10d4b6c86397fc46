"""RGB-D cameras: usable images, or a typed error with the reason."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from bestman_bt.control.history import NotRecordedError
from bestman_bt.control.joint_state import JointStateSensor
from bestman_bt.manipulation.kinematics.link_hulls import ForwardKinematics, link_hulls
from bestman_bt.messages import CameraIntrinsics, Failure, PointCloud, Pose, Pose2D, RGBDImage
from bestman_bt.perception.camera_model import DepthCorrection, rectification
from bestman_bt.perception.errors import PerceptionError
from bestman_bt.perception.view import View
from bestman_bt.robot_model.model import ArmModel, RobotModel
from bestman_bt.robot_model.sensor_parts import CameraPart
from bestman_bt.world_model.world_model import HeldObject, WorldModel
from hal.api import Camera, Clock, PartError, RobotError


class CameraErrorCode(StrEnum):
    """Reasons for an unusable image, used as ``error_code`` by skills."""

    NO_IMAGE = "camera_no_image"
    BLACK = "camera_black"
    NO_DEPTH = "camera_no_depth"
    STALE = "camera_stale"


class CameraError(PerceptionError):
    """Raised if a camera delivers no image, or an unusable one; a skill fails with its code and message."""

    def __init__(self, code: CameraErrorCode, text: str, camera: str, vendor_code: str = "") -> None:
        super().__init__(text)
        self.code, self.failure = code, Failure(code, text, camera, vendor_code)


@dataclass(frozen=True, eq=False)
class RGBDView:
    """A rectified image, the camera's pose in the base frame, and the base's believed pose in the map at that time.

    ``own_body``: (H, W), True for pixels of the robot and its held object; views leave these pixels out.
    """

    image: RGBDImage
    base_from_camera: Pose
    map_from_base: Pose
    own_body: NDArray[np.bool_]

    @property
    def stamp(self) -> float:
        """The time at which the image was taken, seconds on the robot's clock."""
        return self.image.stamp

    @cached_property
    def _of_the_world(self) -> RGBDImage:
        depth = np.where(self.own_body, np.float32(0.0), self.image.depth)
        return RGBDImage(self.image.rgb, depth, self.image.intrinsics, self.image.stamp)

    @property
    def in_base(self) -> View:
        """The points and camera pose of the view in the base frame."""
        return View(self._of_the_world, self.base_from_camera)

    @property
    def in_map(self) -> View:
        """The view in the map frame, as accurate as the localisation."""
        return View(self._of_the_world, self.map_from_base @ self.base_from_camera)

    @cached_property
    def cloud(self) -> PointCloud:
        """The measured points in the base frame."""
        return self.in_base.cloud()


@dataclass(eq=False)
class RGBDSensor:
    """Captures views with one camera: rectified, with the systematic depth error corrected.

    Camera and base poses are those at the image's stamp. ``base_at``: returns the pose of the base in the map frame at
    a time; without it, that of ``world``. ``clock``: for the age of images; without it, ages are not checked.
    ``max_age``: maximum age, seconds; up to ``attempts`` images are requested if they are older, because a busy
    computer may delay one. ``black_level``: of 255; an image without a brighter pixel is black. ``min_depth_share``:
    minimum fraction of pixels with a depth.
    """

    camera: Camera
    kinematics: ForwardKinematics
    joints: JointStateSensor
    world: WorldModel
    clock: Clock | None = None
    base_at: Callable[[float], Pose2D] | None = None
    max_age: float = 0.5
    attempts: int = 5
    black_level: int = 8
    min_depth_share: float = 0.001

    def __post_init__(self) -> None:
        self.name, self.optical_frame = self.camera.name, self.camera.optical_frame
        self._self_filter = SelfFilter(self.kinematics.robot, self.kinematics)
        self._subscribers: list[Callable[[RGBDView], None]] = []

    @property
    def intrinsics(self) -> CameraIntrinsics:
        """The pinhole model of the views."""
        return replace(self.camera.intrinsics, distortion=())

    def base_from_camera(self) -> Pose:
        """Return the current pose of the camera."""
        return self.kinematics.pose(self.camera.optical_frame, self.joints.positions())

    def subscribe(self, subscriber: Callable[[RGBDView], None]) -> None:
        """Call ``subscriber`` with every view that is captured."""
        self._subscribers.append(subscriber)

    def capture(self) -> RGBDView:
        """Return the latest image. Raises CameraError if the camera delivers no usable image."""
        image = self._ideal(self._taken())
        try:
            positions = self.joints.at(image.stamp)
            base = self.world.base.pose if self.base_at is None else self.base_at(image.stamp)
        except NotRecordedError as error:
            text = f"the pose of the robot is unknown for the image of {self.name}: {error}"
            raise CameraError(CameraErrorCode.STALE, text, self.name) from error
        base_from_camera = self.kinematics.pose(self.camera.optical_frame, positions)
        own_body = self._self_filter.mask(image, base_from_camera, positions, self.world.hands)
        view = RGBDView(image, base_from_camera, base.to_pose(), own_body)
        for subscriber in self._subscribers:
            subscriber(view)
        return view

    def _taken(self) -> RGBDImage:
        age = 0.0
        for _ in range(self.attempts):
            try:
                image = self.camera.capture()
            except (RobotError, OSError, ValueError) as error:  # ValueError: sizes that do not fit the intrinsics
                vendor_code = error.failure.vendor_code if isinstance(error, PartError) else ""
                text = f"{self.name} gave no image: {error}"
                raise CameraError(CameraErrorCode.NO_IMAGE, text, self.name, vendor_code) from error
            age = 0.0 if self.clock is None else self.clock.now() - image.stamp
            if abs(age) <= self.max_age:
                if not (image.rgb > self.black_level).any():
                    raise CameraError(CameraErrorCode.BLACK, f"{self.name} gave a black image", self.name)
                return image
        which = "old" if age > 0.0 else "in the future"
        text = f"{self.name} gave an image that is {abs(age):.2f} s {which}, {self.max_age:g} s are allowed"
        raise CameraError(CameraErrorCode.STALE, text, self.name)

    def _ideal(self, image: RGBDImage) -> RGBDImage:
        known = np.isfinite(image.depth) & (image.depth > 0.0)
        share = float(known.mean())
        if share < self.min_depth_share:
            raise CameraError(
                CameraErrorCode.NO_DEPTH,
                f"{self.name} gave an image without depth ({share:.2%} of its pixels have one)",
                self.name,
            )
        model = self.kinematics.robot.of(CameraPart).get(self.name)
        correction = DepthCorrection() if model is None else DepthCorrection(model.depth_scale, model.depth_offset)
        depth = correction.apply(image.depth if known.all() else np.where(known, image.depth, np.float32(0.0)))
        image = replace(image, depth=depth)
        rectify = rectification(image.intrinsics)
        if rectify is None:
            return replace(image, intrinsics=replace(image.intrinsics, distortion=()))
        return rectify.apply(image)


NEAREST = 0.02
"""Distance from the camera, metres, within which a body is part of the camera's own mount and not drawn."""


class SelfFilter:
    """Compares the image with the silhouettes of all links, from encoders and forward kinematics.

    ``margin``: metres by which a silhouette is widened, for calibration errors and unmodelled covers. ``slack``: metres
    behind a link beyond which a point is not the robot.
    """

    def __init__(
        self, robot: RobotModel, kinematics: ForwardKinematics, margin: float = 0.015, slack: float = 0.05
    ) -> None:
        self._robot = robot
        self.kinematics = kinematics
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
        hands: Mapping[str, HeldObject] | None = None,
    ) -> NDArray[np.bool_]:
        """Return a mask (H, W), True where a pixel shows the robot or a held object.

        ``positions``: of all joints, by name. ``hands``: arm → held object.
        """
        bodies = self._bodies(base_from_camera.inverse(), positions, hands or {})
        reach = np.zeros(image.depth.shape, dtype=np.float32)
        # The farthest last, so that it prevails where silhouettes overlap.
        for body in sorted(bodies, key=lambda points: float(points[:, 2].max())):
            self._draw(reach, image.intrinsics, body)
        return image.depth < reach

    def _bodies(
        self, camera_from_base: Pose, positions: Mapping[str, float], hands: Mapping[str, HeldObject]
    ) -> list[NDArray[np.float64]]:
        """Return the corners of all convex bodies in the optical frame."""
        bodies = []
        for link, hulls in self._hulls.items():
            camera_from_link = camera_from_base @ self.kinematics.pose(link, positions)
            bodies += [camera_from_link.apply(hull) for hull in hulls]
        arms = self._robot.of(ArmModel)
        for arm, held in hands.items():
            camera_from_tool = camera_from_base @ self.kinematics.pose(arms[arm].tool_frame, positions)
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
