"""An RGB-D camera behind ROS: compressed colour and depth, subscribed to only while somebody waits for an image."""

from __future__ import annotations

import threading
import time
from collections.abc import Mapping
from typing import Any

from bestman_bt.messages import CameraIntrinsics, RGBDImage
from bestman_bt.robot_model import CameraPart
from hal.api import Clock, NoDataError
from hal.hardware import RemoteTime
from hal.rosbridge import decoding
from hal.rosbridge.link import RosLink
from hal.rosbridge.options import RosbridgeOptions
from hal.rosbridge.stream import Stream

INTRINSICS_TOLERANCE = 0.05
"""Share by which the camera's own focal length may differ from the robot model's, which may come of a calibration."""


class RosCamera:
    """Depth has to be registered to colour, and both to have the size that the robot model says.

    ``info``: the camera's own description, which comes all the time and shows that the camera is alive.
    """

    def __init__(
        self,
        name: str,
        model: CameraPart,
        link: RosLink,
        clock: Clock,
        ros_time: RemoteTime,
        options: RosbridgeOptions,
    ) -> None:
        self._name, self._model, self._link, self._clock, self._options = name, model, link, clock, options
        self._lock = threading.Lock()

        def stream(what: str, decode: Any) -> Stream[Any]:
            return Stream(name, options.topic("camera", name, what), decode, clock, ros_time, longest_age=2.0)

        self.info: Stream[CameraIntrinsics] = stream("info", lambda message, at: decoding.intrinsics(message))
        self._color: Stream[Mapping[str, Any]] = stream("color", lambda message, at: message)
        self._depth: Stream[Mapping[str, Any]] = stream("depth", lambda message, at: message)

    def mismatch(self) -> str:
        """In which way the camera is not the one of the robot model; empty where it is."""
        told, believed = self.info.latest(), self._model.intrinsics
        if (told.width, told.height) != (believed.width, believed.height):
            size = f"{believed.width} x {believed.height}"
            return f"{self._name} tells images of {told.width} x {told.height}, the robot model says {size}"
        if abs(told.fx - believed.fx) > INTRINSICS_TOLERANCE * believed.fx:
            return f"{self._name} tells a focal length of {told.fx:.1f} pixels, the robot model says {believed.fx:.1f}"
        return ""

    def take(self) -> RGBDImage:
        """An image whose colour and depth were both taken after this was called; NoDataError says what is missing."""
        with self._lock:
            asked, image_type = self._clock.now(), self._options.message_type("sensor_msgs", "CompressedImage")
            streams = self._color, self._depth
            ends = [self._link.subscribe(stream.topic, image_type, stream.take) for stream in streams]
            try:
                color, depth, at = self._pair(asked, time.monotonic() + self._options.image_time)
            finally:
                for end in ends:
                    end()
        try:
            return RGBDImage(decoding.color_image(color), decoding.depth_image(depth), self._model.intrinsics, at)
        except (KeyError, TypeError, ValueError) as error:
            raise NoDataError(f"{self._name}: an image cannot be used: {error}") from error

    def _pair(self, asked: float, deadline: float) -> tuple[Mapping[str, Any], Mapping[str, Any], float]:
        after_color = after_depth = asked
        while True:
            color = self._color.newer_than(after_color, deadline)
            depth = self._depth.newer_than(after_depth, deadline) if color is not None else None
            if color is None or depth is None:
                topic = (self._color if color is None else self._depth).topic
                raise NoDataError(f"{self._name}: no image on {topic} within {self._options.image_time:g} s")
            apart = color[1] - depth[1]
            if abs(apart) <= self._options.pairing:
                return color[0], depth[0], color[1]
            if apart < 0.0:
                after_color = color[1]
            else:
                after_depth = depth[1]
