"""RGB-D cameras: images that algorithms can work with, or a typed error that says why there is none."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from bestman_bt.manipulation.kinematics import ForwardKinematics
from bestman_bt.messages import CameraIntrinsics, Pose, RGBDImage
from bestman_bt.perception.camera_model import DepthCorrection, rectification
from bestman_bt.sensing.joint_state import JointStateSensor
from bestman_bt.sensing.rgbd.errors import CameraError, CameraErrorCode
from bestman_bt.sensing.rgbd.rgbd_view import RGBDView
from bestman_bt.sensing.rgbd.self_filter import SelfFilter
from bestman_bt.world_model import WorldModel
from hal.api import Camera, Clock, RobotError


@dataclass(frozen=True)
class RGBDSensorParameters:
    """When an image counts as none.

    ``max_age``: seconds between its stamp and now; of images that are older, ``attempts`` are asked for, because a
    computer that is busy for a moment may have held one up. ``black_level``: of 255; an image without a pixel above it
    is black. ``min_depth_share``: share of the pixels that must have a depth.
    """

    max_age: float = 0.5
    attempts: int = 5
    black_level: int = 8
    min_depth_share: float = 0.001


class RGBDSensor:
    """Captures views through one camera: rectified, and with the systematic error of the depth taken away.

    ``clock``: tells how old an image is; without one, ages are not checked.
    """

    def __init__(
        self,
        camera: Camera,
        kinematics: ForwardKinematics,
        joints: JointStateSensor,
        world: WorldModel,
        clock: Clock | None = None,
        parameters: RGBDSensorParameters = RGBDSensorParameters(),
    ) -> None:
        self._camera = camera
        self._kinematics = kinematics
        self._joints = joints
        self._world = world
        self._clock = clock
        self._parameters = parameters
        self._self_filter = SelfFilter(kinematics.robot, kinematics)
        self._subscribers: list[Callable[[RGBDView], None]] = []

    @property
    def name(self) -> str:
        """The camera's name in its robot."""
        return self._camera.name

    @property
    def intrinsics(self) -> CameraIntrinsics:
        """The pinhole model of the views."""
        return replace(self._camera.intrinsics, distortion=())

    @property
    def optical_frame(self) -> str:
        """The frame of the images in the robot model."""
        return self._camera.optical_frame

    def base_from_camera(self) -> Pose:
        """Where the camera is now."""
        return self._kinematics.pose(self._camera.optical_frame, self._joints.positions())

    def subscribe(self, subscriber: Callable[[RGBDView], None]) -> None:
        """Call ``subscriber`` with every view that is captured."""
        self._subscribers.append(subscriber)

    def capture(self) -> RGBDView:
        """Take one image now; CameraError if the camera delivers nothing to work with."""
        image = self._ideal(self._taken())
        positions = self._joints.positions()
        base_from_camera = self._kinematics.pose(self._camera.optical_frame, positions)
        own_body = self._self_filter.mask(image, base_from_camera, positions, self._world.held)
        view = RGBDView(image, base_from_camera, self._world.base.pose.to_pose(), own_body)
        for subscriber in self._subscribers:
            subscriber(view)
        return view

    def _taken(self) -> RGBDImage:
        parameters, age = self._parameters, 0.0
        for _ in range(parameters.attempts):
            try:
                image = self._camera.capture()
            except (RobotError, OSError, ValueError) as error:  # ValueError: sizes that do not fit the intrinsics
                raise CameraError(CameraErrorCode.NO_IMAGE, f"{self.name} gave no image: {error}") from error
            age = 0.0 if self._clock is None else self._clock.now() - image.stamp
            if abs(age) <= parameters.max_age:
                if not (image.rgb > parameters.black_level).any():
                    raise CameraError(CameraErrorCode.BLACK, f"{self.name} gave a black image")
                return image
        which = "old" if age > 0.0 else "in the future"
        text = f"{self.name} gave an image that is {abs(age):.2f} s {which}, {parameters.max_age:g} s are allowed"
        raise CameraError(CameraErrorCode.STALE, text)

    def _ideal(self, image: RGBDImage) -> RGBDImage:
        known = np.isfinite(image.depth) & (image.depth > 0.0)
        share = float(known.mean())
        if share < self._parameters.min_depth_share:
            raise CameraError(
                CameraErrorCode.NO_DEPTH,
                f"{self.name} gave an image without depth ({share:.2%} of its pixels have one)",
            )
        model = self._kinematics.robot.cameras.get(self.name)
        correction = DepthCorrection() if model is None else DepthCorrection(model.depth_scale, model.depth_offset)
        depth = correction.apply(image.depth if known.all() else np.where(known, image.depth, np.float32(0.0)))
        image = replace(image, depth=depth)
        rectify = rectification(image.intrinsics)
        if rectify is None:
            return replace(image, intrinsics=replace(image.intrinsics, distortion=()))
        return rectify.apply(image)
