"""Robots behind rosbridge, of either version of ROS, through roslibpy."""

from __future__ import annotations

import threading
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import CameraIntrinsics, Pose2D, RGBDImage, Twist2D, wrap_angle
from bestman_bt.robot_model.model import BaseModel, JointGroupModel
from bestman_bt.robot_model.sensor_parts import CameraPart, MountedForceTorque
from hal.api import Clock, Failure, MotionErrorCode, NoDataError, Part
from hal.hardware.connection import Connection, PartFactory
from hal.hardware.sensors import (
    HardwareBattery,
    HardwareCamera,
    HardwareForceTorque,
    HardwareImu,
    HardwareLidar,
    is_another_camera,
    lens_differences,
)
from hal.parts.channels import BaseChannel, BaseReading, JointChannel, JointReading
from hal.parts.driven_base import DrivenBase
from hal.parts.part_connection import ConnectionFailedError
from hal.parts.stop_latch import StopLatch
from hal.parts.streamed_joints import StreamedJointGroup
from hal.rosbridge import decoding
from hal.rosbridge.decoding import Message
from hal.rosbridge.link import RosLink, TopicStream
from hal.rosbridge.options import TOPICS, RosbridgeOptions


class RosCamera:
    """A camera; depth must be registered to colour, and both must have the size of the robot model.

    ``info``: CameraInfo, which is published continuously and shows that the camera is alive.
    """

    def __init__(
        self,
        name: str,
        model: CameraPart,
        link: RosLink,
        clock: Clock,
        options: RosbridgeOptions,
        latch: StopLatch,
    ) -> None:
        self.lens, self.part = model.intrinsics, HardwareCamera(name, model, latch, self.take)
        self._name, self._model, self._link, self._clock, self._options = name, model, link, clock, options
        self._lock = threading.Lock()
        ros_time = options.ros_time(clock)

        def stream(what: str, decode: Any) -> TopicStream[Any]:
            return TopicStream(name, options.topic("camera", name, what), decode, clock, ros_time, longest_age=2.0)

        self.info: TopicStream[CameraIntrinsics] = stream("info", lambda message, at: decoding.intrinsics(message))
        self._color: TopicStream[Mapping[str, Any]] = stream("color", lambda message, at: message)
        self._depth: TopicStream[Mapping[str, Any]] = stream("depth", lambda message, at: message)

    def check(self) -> tuple[str, ...]:
        """Return the lens differences from the robot file. Raises ConnectionFailedError if it is another camera."""
        file = self._model.intrinsics
        reported = self.lens = replace(self.info.latest(), distortion=file.distortion)
        if other := is_another_camera(reported, file):
            raise ConnectionFailedError(f"{self._name} {other}")
        return tuple(f"{self._name} reports {number}, which is used" for number in lens_differences(reported, file))

    def take(self) -> RGBDImage:
        """Return an image whose colour and depth were both captured after the call.

        Raises NoDataError naming the missing image.
        """
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
            return RGBDImage(decoding.color_image(color), decoding.depth_image(depth), self.lens, at)
        except (KeyError, TypeError, ValueError) as error:
            raise NoDataError(f"{self._name}: an image cannot be used: {error}", self._name) from error

    def _pair(self, asked: float, deadline: float) -> tuple[Mapping[str, Any], Mapping[str, Any], float]:
        after_color = after_depth = asked
        while True:
            color = self._color.newer_than(after_color, deadline)
            depth = self._depth.newer_than(after_depth, deadline) if color is not None else None
            if color is None or depth is None:
                topic = (self._color if color is None else self._depth).topic
                raise NoDataError(
                    f"{self._name}: no image on {topic} within {self._options.image_time:g} s", self._name
                )
            apart = color[1] - depth[1]
            if abs(apart) <= self._options.pairing:
                return color[0], depth[0], color[1]
            if apart < 0.0:
                after_color = color[1]
            else:
                after_depth = depth[1]


PORT = 9090
MANY = 99
"""Any number of parts of a kind."""
INFO_PERIOD = 0.1
"""Seconds between a camera's descriptions, which show that it is alive."""
STALE_TIME = 0.05
"""Seconds beyond the watchdog's time after which one silent topic counts; if all are silent, the watchdog acts
first.
"""
SENSOR_PERIODS = 4.0
"""Number of periods of a sensor after which its last reading expires."""
SENSORS: Mapping[str, tuple[Any, str, Any, str, str]] = {
    "lidar": (HardwareLidar, "scan", decoding.laser_scan, "sensor_msgs", "LaserScan"),
    "force_torque": (HardwareForceTorque, "wrench", decoding.wrench, "geometry_msgs", "WrenchStamped"),
    "imu": (HardwareImu, "readings", decoding.imu, "sensor_msgs", "Imu"),
    "battery": (HardwareBattery, "state", decoding.battery, "sensor_msgs", "BatteryState"),
}
"""Kind of sensor → class, stream, decoder, and message type."""


class RosbridgeConnection(Connection):
    """A mobile base, joints, cameras, lidars, other sensors and batteries behind one rosbridge server.

    Odometry and joint states are monitored: if they are late or missing while other messages arrive, motion is refused.
    Readings of other sensors are refused once they are too old. Images are requested one at a time.
    """

    driver: ClassVar[str] = "rosbridge"
    package: ClassVar[str] = "roslibpy"
    extra: ClassVar[str] = "rosbridge"
    options_type: ClassVar[type] = RosbridgeOptions
    serves: ClassVar[Mapping[str, tuple[int, int]]] = dict.fromkeys(TOPICS, (0, MANY))
    unsupported: Mapping[str, str] = {
        "command(efforts=…)": "joints are commanded by set-points of a trajectory controller",
    }

    def factories(self) -> Mapping[str, PartFactory]:
        """Return the factories. Raises ConnectionFailedError for unknown streams."""
        options: RosbridgeOptions = self.options
        self._stale_after = self.limits.watchdog + STALE_TIME
        self._link = RosLink(self.name, self.clock)
        self._frames: list[tuple[TopicStream[Any], str]] = []  # and the frames that they are to be in
        self._streams: list[tuple[TopicStream[Any], str, float]] = []  # with message types and periods
        self._watched: list[TopicStream[Any]] = []
        self._cameras: list[RosCamera] = []
        self._outputs: dict[str, str] = {}
        self._driven: list[DrivenBase | StreamedJointGroup] = []
        for part, topics in options.topics.items():
            known = TOPICS.get(self.model.kind(part), {}) if part in self.settings.parts else {}
            if unknown := [stream for stream in topics if stream not in known]:
                streams = ", ".join(known) or "none"
                raise ConnectionFailedError(
                    f"{self.name}: options.topics.{part} has {', '.join(unknown)}; the streams of {part} are: {streams}"
                )
        sensors = {kind: partial(self._make_sensor, kind) for kind in SENSORS}
        return {
            **sensors,
            "base": self._make_base,
            "camera": self._make_camera,
            "joint_group": self._make_joints,
        }

    def open(self) -> None:
        """Connect, and wait for the first message of every topic."""
        options: RosbridgeOptions = self.options
        settings = self.settings
        for stream, _, _ in self._streams:
            stream.forget()
        port = settings.port or PORT
        self._link.open(self.sdk, settings.address, port, options.secure, settings.token, options.connect_timeout)
        deadline = time.monotonic() + options.connect_timeout  # importing the SDK may have taken longer
        for topic, message_type in self._outputs.items():
            self._link.advertise(topic, message_type)
        for stream, message_type, period in self._streams:
            self._link.subscribe(stream.topic, message_type, stream.take, period)
        self._await(deadline)
        self._check_frames()
        while unlike := self._unlike_clock([stream for stream, _, _ in self._streams]):
            if time.monotonic() > deadline:
                raise ConnectionFailedError(f"{self.name}: {unlike}")
            time.sleep(0.02)
        try:
            self.remarks = tuple(remark for camera in self._cameras for remark in camera.check())
            for camera in self._cameras:
                camera.part.intrinsics = camera.lens
        except ConnectionFailedError as error:
            raise ConnectionFailedError(f"{self.name}: {error}") from error
        if self._driven:
            self.add_loop("velocities and set-points", options.rate, self._cycle)

    def close(self) -> None:
        """Close the websocket."""
        self._link.close()

    def heard(self) -> float:
        """Return the arrival time of the last message."""
        return self._link.heard

    def reported_fault(self) -> Failure | None:
        """Return a failure if the websocket was closed, a message is malformed, or data of base or joints are late or
        old.
        """
        if not self._link.connected:
            return Failure(MotionErrorCode.DISCONNECTED, f"the rosbridge of {self.name} has closed the connection")
        if self._link.complaint:
            return Failure(MotionErrorCode.FAULT, self._link.complaint)
        if self.clock.now() - self.heard() > self.limits.watchdog:
            return None  # silence is the watchdog's
        if unlike := self._unlike_clock(self._watched):
            return Failure(MotionErrorCode.TIMEOUT, unlike)
        for stream in self._watched:
            if (age := stream.age) > stream.longest_age:
                text = f"the newest message on {stream.topic} is {age:.2f} s old"
                return Failure(MotionErrorCode.TIMEOUT, text)
            if (late := stream.late(self.options.longest_delay)) is not None:
                return Failure(MotionErrorCode.TIMEOUT, f"{stream.topic} comes {late:.2f} s late")
        return None

    def recover(self) -> None:
        """Continue if the fault has ended. Raises ConnectionFailedError otherwise."""
        self._link.complaint = ""
        for stream, _, _ in self._streams:
            if self.options.clock == "estimated":
                stream.forget_time()
        deadline = time.monotonic() + self.options.connect_timeout
        while (fault := self.reported_fault()) is not None:
            if time.monotonic() > deadline:
                raise ConnectionFailedError(f"{self.name}: {fault}")
            time.sleep(0.02)

    def abandon(self) -> None:
        """Drop the connection, so that velocities still in its buffers are not sent."""
        self._link.abandon()

    def _make_base(self, name: str, model: BaseModel) -> DrivenBase:
        options: RosbridgeOptions = self.options
        if options.odometry == "tf":
            source, package, kind = TransformOdometry(options.odom_frame, options.base_frame), "tf2_msgs", "TFMessage"
            topic = options.topic("base", name, "transforms")
            odometry = self._stream(name, topic, source.decode, self._stale_after, source.header)
        else:
            package, kind, topic = "nav_msgs", "Odometry", options.topic("base", name, "odometry")
            odometry = self._stream(name, topic, lambda message, at: decoding.odometry(message), self._stale_after)
        self._frames.append((odometry, options.odom_frame))
        self._listen(odometry, package, kind, watched=True)
        channel = RosBase(self._link, options.topic("base", name, "velocity"), options, odometry)
        self._outputs[options.topic("base", name, "velocity")] = channel.message_type
        base = DrivenBase(name, model, channel, self.latch)
        self._driven.append(base)
        return base

    def _make_joints(self, name: str, model: JointGroupModel) -> StreamedJointGroup:
        options: RosbridgeOptions = self.options
        ros_names = tuple(options.joints.get(joint, joint) for joint in model.joint_names)
        topic = options.topic("joint_group", name, "states")
        states: TopicStream[JointReading] = self._stream(
            name, topic, lambda message, at: joint_reading(ros_names, message), self._stale_after
        )
        self._listen(states, "sensor_msgs", "JointState", watched=True)
        output = options.topic("joint_group", name, "commands")
        channel = RosJoints(self._link, output, ros_names, options, states)
        self._outputs[output] = channel.message_type
        group = StreamedJointGroup(name, model, channel, self.latch, 1.0 / options.rate)
        self._driven.append(group)
        return group

    def _make_camera(self, name: str, model: CameraPart) -> HardwareCamera:
        camera = RosCamera(name, model, self._link, self.clock, self.options, self.latch)
        self._expect_frame(camera.info, name, model.optical_frame)
        self._cameras.append(camera)
        self._listen(camera.info, "sensor_msgs", "CameraInfo", period=INFO_PERIOD)
        return camera.part

    def _make_sensor(self, kind: str, name: str, model: Any) -> Part:
        make, stream_name, decode, package, message = SENSORS[kind]
        described = model.part if isinstance(model, MountedForceTorque) else model
        longest_age = max(SENSOR_PERIODS / described.rate, self._stale_after)
        stream = self._stream(name, self.options.topic(kind, name, stream_name), decode, longest_age)
        if frame := getattr(described, "frame", ""):
            self._expect_frame(stream, name, frame)
        self._listen(stream, package, message)
        part: Part = make(name, described, self.latch, stream.read)
        return part

    def _stream(self, part: str, topic: str, decode: Any, longest_age: float, header: Any = None) -> TopicStream[Any]:
        keywords = {} if header is None else {"header": header}
        return TopicStream(part, topic, decode, self.clock, self.options.ros_time(self.clock), longest_age, **keywords)

    def _expect_frame(self, stream: TopicStream[Any], part: str, frame: str) -> None:
        self._frames.append((stream, self.options.frames.get(part, frame)))

    def _check_frames(self) -> None:
        for stream, frame in self._frames:
            if stream.frame.lstrip("/") != frame.lstrip("/"):
                what = "options.odom_frame" if frame == self.options.odom_frame else f"options.frames.{stream.part}"
                raise ConnectionFailedError(
                    f"{self.name}: {stream.topic} is in the frame {stream.frame!r}, but should be in {frame!r}; "
                    f"if both are the same place, write {what}: {stream.frame!r}"
                )

    def _unlike_clock(self, streams: Sequence[TopicStream[Any]]) -> str:
        """Return evidence that clocks are not synchronised although they should be; empty without any."""
        cure = "synchronise the robot's clock with this machine's (PTP, NTP), or write options.clock: estimated"
        return next((f"{stream.topic} {unlike}: {cure}" for stream in streams if (unlike := stream.unlike_clock)), "")

    def _listen(
        self, stream: TopicStream[Any], package: str, kind: str, watched: bool = False, period: float = 0.0
    ) -> None:
        self._streams.append((stream, self.options.message_type(package, kind), period))
        if watched:
            self._watched.append(stream)

    def _await(self, deadline: float) -> None:
        while silent := [stream.topic for stream, _, _ in self._streams if stream.age == float("inf")]:
            if self._link.complaint:
                raise ConnectionFailedError(f"{self.name}: {self._link.complaint}")
            if time.monotonic() > deadline:
                raise ConnectionFailedError(f"{self.name}: no messages on {', '.join(silent)}")
            time.sleep(0.01)

    def _cycle(self, elapsed: float) -> None:
        if self.clock.now() - self.heard() < self.limits.watchdog:
            for part in self._driven:
                part.cycle(elapsed)


Array = NDArray[np.float64]
REACH_PERIODS = 1.5
"""Number of periods in which the controller has to reach a set-point: more than one, so that it never pauses."""


class RosBase(BaseChannel):
    """Publishes ``Twist`` or ``TwistStamped``; the ROS controller must have a command timeout."""

    def __init__(
        self, link: RosLink, topic: str, options: RosbridgeOptions, odometry: TopicStream[BaseReading]
    ) -> None:
        self._link, self._topic, self._options, self._odometry = link, topic, options, odometry

    @property
    def message_type(self) -> str:
        """Return the type of the velocity messages."""
        return self._options.message_type(
            "geometry_msgs", "TwistStamped" if self._options.stamped_velocity else "Twist"
        )

    def read(self) -> BaseReading:
        """Return the newest reading; the connection's watchdog checks its age."""
        return self._odometry.latest()

    def send(self, velocity: Twist2D) -> bool:
        """Publish a velocity without waiting."""
        twist = {
            "linear": {"x": velocity.vx, "y": velocity.vy, "z": 0.0},
            "angular": {"x": 0.0, "y": 0.0, "z": velocity.wz},
        }
        if self._options.stamped_velocity:  # stamped 0: now
            zero = {"secs": 0, "nsecs": 0} if self._options.ros == 1 else {"sec": 0, "nanosec": 0}
            self._link.publish(
                self._topic, {"header": {"stamp": zero, "frame_id": self._options.base_frame}, "twist": twist}
            )
        else:
            self._link.publish(self._topic, twist)
        return True


class TransformOdometry:
    """Odometry from the transform of ``odom_frame`` to ``base_frame``; velocities are finite differences."""

    SHORTEST = 0.005

    def __init__(self, odom_frame: str, base_frame: str) -> None:
        self._frames = odom_frame.lstrip("/"), base_frame.lstrip("/")
        self._last: tuple[float, Pose2D] | None = None
        self._velocity = Twist2D(0.0, 0.0, 0.0)

    def header(self, message: Message) -> Message | None:
        """Return the header of the transform, or None if the message does not contain it: other nodes publish other
        transforms.
        """
        for entry in message["transforms"]:
            header: Message = entry["header"]
            if (header["frame_id"].lstrip("/"), entry["child_frame_id"].lstrip("/")) == self._frames:
                return header
        return None

    def decode(self, message: Message, at: float) -> BaseReading | None:
        """Return a reading, or None if the message is about other frames."""
        found = decoding.transform(message, *self._frames)
        if found is None:
            return None
        stamp, pose = found
        if self._last is None or stamp < self._last[0]:
            self._last, self._velocity = found, Twist2D(0.0, 0.0, 0.0)
        elif stamp - self._last[0] >= self.SHORTEST:
            elapsed, moved = stamp - self._last[0], self._last[1].inverse() @ pose
            self._velocity = Twist2D(moved.x / elapsed, moved.y / elapsed, wrap_angle(moved.theta) / elapsed)
            self._last = found
        return BaseReading(pose, self._velocity)


def joint_reading(ros_names: tuple[str, ...], message: Message) -> JointReading | None:
    """Return the joints of these names in ``sensor_msgs/JointState``, or None if the message has other joints."""
    found = decoding.joints(message, ros_names)
    return JointReading(*(np.array(column) for column in found)) if found is not None else None


class RosJoints(JointChannel):
    """Sends each set-point as a ``trajectory_msgs/JointTrajectory`` of one point, for a joint_trajectory_controller."""

    def __init__(
        self,
        link: RosLink,
        topic: str,
        ros_names: tuple[str, ...],
        options: RosbridgeOptions,
        states: TopicStream[JointReading],
    ) -> None:
        self._link, self._topic, self._names, self._states = link, topic, ros_names, states
        nanoseconds = int(1e9 * REACH_PERIODS / options.rate)
        names = ("secs", "nsecs") if options.ros == 1 else ("sec", "nanosec")
        self._duration = dict(zip(names, divmod(nanoseconds, 1_000_000_000), strict=True))
        self._header = {"stamp": dict.fromkeys(names, 0), "frame_id": ""}
        self.message_type = options.message_type("trajectory_msgs", "JointTrajectory")

    @property
    def age(self) -> float:
        """Return the age of the newest reading, seconds; readings also arrive without set-points."""
        return self._states.age

    def read(self) -> JointReading:
        """Return the newest reading; the connection's watchdog checks its age."""
        return self._states.latest()

    def send(self, positions: Array, velocities: Array) -> None:
        """Send one set-point; does not wait."""
        point = {"positions": positions.tolist(), "time_from_start": self._duration}
        self._link.publish(self._topic, {"header": self._header, "joint_names": list(self._names), "points": [point]})
