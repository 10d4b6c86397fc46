"""RGB-D cameras: images together with where they were taken from, by encoders and forward kinematics."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from bestman_bt.manipulation.kinematics import ForwardKinematics
from bestman_bt.messages import CameraIntrinsics, PointCloud, Pose, RGBDImage
from bestman_bt.perception import View
from bestman_bt.sensing.joint_state import JointStateSensor
from bestman_bt.sensing.rgbd.self_filter import SelfFilter
from bestman_bt.world_model import WorldModel
from hal.api import Camera


@dataclass(frozen=True, eq=False)
class RGBDView:
    """An image, the camera's pose in the base frame, and the base's believed pose in the map when it was taken.

    ``own_body``: (H, W), True where a pixel shows the robot or what it holds; views leave these pixels out.
    """

    image: RGBDImage
    base_from_camera: Pose
    map_from_base: Pose
    own_body: NDArray[np.bool_]

    @property
    def stamp(self) -> float:
        """When the image was taken, seconds on the robot's clock."""
        return self.image.stamp

    @cached_property
    def _of_the_world(self) -> RGBDImage:
        depth = np.where(self.own_body, np.float32(0.0), self.image.depth)
        return RGBDImage(self.image.rgb, depth, self.image.intrinsics, self.image.stamp)

    @property
    def in_base(self) -> View:
        """The view in the base frame."""
        return View(self._of_the_world, self.base_from_camera)

    @property
    def in_map(self) -> View:
        """The view in the map frame, as good as the localisation."""
        return View(self._of_the_world, self.map_from_base @ self.base_from_camera)

    @cached_property
    def cloud(self) -> PointCloud:
        """The measured points in the base frame."""
        return self.in_base.cloud()


class RGBDSensor:
    """Captures views through one camera."""

    def __init__(
        self, camera: Camera, kinematics: ForwardKinematics, joints: JointStateSensor, world: WorldModel
    ) -> None:
        self._camera = camera
        self._kinematics = kinematics
        self._joints = joints
        self._world = world
        self._self_filter = SelfFilter(kinematics.robot, kinematics)
        self._subscribers: list[Callable[[RGBDView], None]] = []

    @property
    def name(self) -> str:
        """The camera's name in its robot."""
        return self._camera.name

    @property
    def intrinsics(self) -> CameraIntrinsics:
        """The pinhole model."""
        return self._camera.intrinsics

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
        """Take one image now."""
        image = self._camera.capture()
        positions = self._joints.positions()
        base_from_camera = self._kinematics.pose(self._camera.optical_frame, positions)
        own_body = self._self_filter.mask(image, base_from_camera, positions, self._world.held)
        view = RGBDView(image, base_from_camera, self._world.base.pose.to_pose(), own_body)
        for subscriber in self._subscribers:
            subscriber(view)
        return view
