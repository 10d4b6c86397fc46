"""One RealSense camera: colour, and depth registered to it by the SDK."""

from __future__ import annotations

import contextlib
import ctypes
import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import ModuleType
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Field

from bestman_bt.configuration.quantity import PositiveTime
from bestman_bt.messages import CameraIntrinsics, RGBDImage
from bestman_bt.robot_model.sensor_parts import CameraPart
from hal.api import Failure, NoDataError
from hal.hardware.clock import RemoteTime, StampOrder
from hal.hardware.connection import Connection, PartFactory
from hal.hardware.controller_facts import Identity
from hal.hardware.sensors import HardwareCamera, is_another_camera, lens_differences
from hal.parts.part_connection import ConnectionFailedError

FrameRate = Annotated[int, Field(ge=1, le=90)]


@dataclass(frozen=True)
class RealSenseOptions:
    """Options of ``driver: realsense``; images have the size of the robot model's camera.

    Without images for ``image_time`` the camera counts as lost; only readers of images are affected. ``serial``: serial
    number of the camera; another one is refused. ``recording``: a file recorded by the RealSense viewer or SDK, played
    in a loop instead of a camera. ``frame_rate``: images per second. ``image_time``: seconds to wait for an image.
    """

    serial: str = ""
    recording: str = ""
    frame_rate: FrameRate = 30
    image_time: PositiveTime = 2.0


POLLS = 3.0
"""Number of times per frame that the SDK is polled."""
FIRST_FRAME_TIME = 5.0
LEAST_DISTORTION = 0.01
"""Smaller coefficients move no image point by more than about a pixel."""


class RealSenseConnection(Connection):
    """Streams continuously; depth is registered when an image is requested.

    Frames are stamped by the camera, in the machine's time or its own, and the domain may change during streaming
    (``rs2_timestamp_domain``); frames of a recording are stamped when played. Images carry the device's intrinsics; if
    these differ from the robot file's, ``remarks`` says so.
    """

    driver: ClassVar[str] = "realsense"
    package: ClassVar[str] = "pyrealsense2"
    extra: ClassVar[str] = "realsense"
    options_type: ClassVar[type] = RealSenseOptions
    serves: ClassVar[Mapping[str, tuple[int, int]]] = {"camera": (1, 1)}
    needs_address: ClassVar[bool] = False

    def factories(self) -> Mapping[str, PartFactory]:
        """Return the factory of the camera."""
        return {"camera": self._make_camera}

    def _make_camera(self, name: str, model: CameraPart) -> HardwareCamera:
        self._camera, self._model = name, model
        self._pipeline: Any = None
        self._align: Any = None
        self._arrived = threading.Condition()
        self._newest: tuple[Any, float] | None = None
        self._heard = -1e9
        self._camera_times: dict[Any, tuple[RemoteTime, StampOrder]] = {}  # by domain
        self._lens, self._identity = model.intrinsics, Identity()
        self._part = HardwareCamera(name, model, self.latch, self._take)
        return self._part

    def open(self) -> None:
        """Start both streams, and wait for the first images."""
        options: RealSenseOptions = self.options
        rs, k = realsense_sdk(self.sdk), self._model.intrinsics
        config, pipeline = rs.config(), rs.pipeline()
        if options.recording:
            config.enable_device_from_file(options.recording, repeat_playback=True)
        elif options.serial:
            config.enable_device(options.serial)
        config.enable_stream(rs.stream.color, k.width, k.height, rs.format.rgb8, options.frame_rate)
        config.enable_stream(rs.stream.depth, k.width, k.height, rs.format.z16, options.frame_rate)
        try:
            profile = pipeline.start(config)
        except RuntimeError as error:
            asked = f" with the serial number {options.serial}" if options.serial else ""
            raise ConnectionFailedError(f"{self.name}: {self._camera}{asked} does not start: {error}") from error
        self._identity = _identity_of(rs, profile.get_device())
        if options.serial and self._identity.serial_number != options.serial:
            pipeline.stop()
            raise ConnectionFailedError(
                f"{self.name}: {self._camera} has the serial number {self._identity.serial_number or 'not reported'}; "
                f"the option 'serial' says {options.serial}"
            )
        self._pipeline, self._align = pipeline, rs.align(rs.stream.color)
        reported = profile.get_stream(rs.stream.color).as_video_stream_profile().get_intrinsics()
        self._lens = CameraIntrinsics(
            reported.width, reported.height, reported.fx, reported.fy, reported.ppx, reported.ppy, k.distortion
        )
        if other := is_another_camera(self._lens, k):
            raise ConnectionFailedError(f"{self.name}: {self._camera} {other}")
        self._part.intrinsics = self._lens
        remarks = [f"{self._camera} reports {number}, which is used" for number in lens_differences(self._lens, k)]
        if max(map(abs, reported.coeffs), default=0.0) > LEAST_DISTORTION:
            remarks.append(f"{self._camera} reports a distortion of {reported.coeffs}, which is not removed")
        self.remarks = tuple(remarks)
        self._newest = None
        self._camera_times.clear()
        deadline = time.monotonic() + FIRST_FRAME_TIME
        while self._newest is None:
            self._poll(0.0)
            if time.monotonic() > deadline:
                raise ConnectionFailedError(f"{self.name}: no images within {FIRST_FRAME_TIME:g} s")
            time.sleep(0.005)
        self.add_loop("frames", POLLS * options.frame_rate, self._poll)

    def close(self) -> None:
        """Stop the streams."""
        pipeline, self._pipeline = self._pipeline, None
        if pipeline is not None:
            with contextlib.suppress(RuntimeError):  # it has stopped by itself
                pipeline.stop()

    def heard(self) -> float:
        """Return the time of the last frame."""
        return self._heard

    @property
    def longest_silence(self) -> float:
        """Seconds without a frame that count as silence; a dropped frame does not."""
        longest: float = max(self.limits.watchdog, self.options.image_time)
        return longest

    def reported_fault(self) -> Failure | None:
        """Return None: exceptions of the SDK end the loop, which already counts as a fault."""
        return None

    def identity(self) -> Identity:
        """Return the identity of the device that streams."""
        return self._identity

    def recover(self) -> None:
        """Do nothing: a camera has no faults to clear."""

    def _poll(self, elapsed: float) -> None:
        frames = self._pipeline.poll_for_frames()
        if not frames:
            return
        color = frames.get_color_frame()
        if not color or not frames.get_depth_frame():
            return
        now = self.clock.now()
        stamp = now if self.options.recording else self._here(color, now)
        with self._arrived:
            frames.keep()
            self._newest, self._heard = (frames, stamp), now
            self._arrived.notify_all()

    def _here(self, color: Any, now: float) -> float:
        """Convert a time stamp to this clock; each domain is a separate clock."""
        reported, domain = 1e-3 * color.get_timestamp(), color.get_frame_timestamp_domain()
        remote, order = self._camera_times.setdefault(domain, (RemoteTime(), StampOrder()))
        if order.set_back(reported):
            remote.forget()
        order.note(reported)
        return remote.here(reported, now)

    def _take(self) -> RGBDImage:
        asked, deadline = self.clock.now(), time.monotonic() + self.options.image_time
        with self._arrived:
            while self._newest is None or self._newest[1] <= asked:
                left = deadline - time.monotonic()
                if left <= 0.0 or not self._arrived.wait(left):
                    raise NoDataError(f"{self._camera}: no image within {self.options.image_time:g} s", self._camera)
            frames, stamp = self._newest
        registered = self._align.process(frames)
        depth = registered.get_depth_frame()
        rgb = np.asanyarray(registered.get_color_frame().get_data())
        metres = np.asanyarray(depth.get_data()) * np.float32(depth.get_units())
        try:
            return RGBDImage(rgb, metres.astype(np.float32), self._lens, stamp)
        except ValueError as error:
            raise NoDataError(f"{self._camera}: an image cannot be used: {error}", self._camera) from error


def _identity_of(rs: ModuleType, device: Any) -> Identity:
    infos = rs.camera_info.name, rs.camera_info.serial_number, rs.camera_info.firmware_version
    return Identity(*(device.get_info(info) if device.supports(info) else "" for info in infos))


def realsense_sdk(load: Callable[[str], ModuleType]) -> ModuleType:
    """Return the SDK; ``load`` imports a module, and raises ConnectionFailedError if it cannot.

    Minimal systems have no libusb: that of the extra is loaded first, under the name that the SDK expects.
    """
    libusb = load("libusb_package").get_library_path()
    if libusb is not None:
        ctypes.CDLL(str(libusb), mode=ctypes.RTLD_GLOBAL)
    return load("pyrealsense2")
