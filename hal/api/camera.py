"""Cameras."""

from __future__ import annotations

from abc import abstractmethod
from typing import ClassVar

from bestman_bt.messages import CameraIntrinsics, RGBDImage
from hal.api.part import Sensor


class Camera(Sensor):
    """An RGB-D camera; its pose follows from encoders and forward kinematics, never from the driver."""

    kind: ClassVar[str] = "camera"

    @property
    @abstractmethod
    def intrinsics(self) -> CameraIntrinsics:
        """The pinhole model; readable before connecting."""

    @property
    @abstractmethod
    def optical_frame(self) -> str:
        """The frame of the images in the robot model (x right, y down, z forward)."""

    @abstractmethod
    def capture(self) -> RGBDImage:
        """Take one image now. Raises NoDataError if the camera does not deliver one."""
