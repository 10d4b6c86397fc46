"""A mobile base and joints behind ROS, for example a pan-tilt head: velocities and set-points out, readings in."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import Pose2D, Twist2D, wrap_angle
from hal.parts.channels import BaseChannel, BaseReading, JointChannel, JointReading
from hal.rosbridge import decoding
from hal.rosbridge.decoding import Message
from hal.rosbridge.link import RosLink, TopicStream
from hal.rosbridge.options import RosbridgeOptions

Array = NDArray[np.float64]
REACH_PERIODS = 1.5
"""Number of periods in which the controller has to reach a set-point: more than one, so that it never pauses."""


class RosBase(BaseChannel):
    """Publishes ``Twist`` or ``TwistStamped``; the controller in ROS has a command timeout, as here."""

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
        """Return the newest reading; the connection's watchdog looks at how old it is."""
        return self._odometry.latest()

    def send(self, velocity: Twist2D) -> bool:
        """Drive at a velocity; it does not wait."""
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
    """Readings from the transforms of ``odom_frame`` to ``base_frame``: velocities by differences."""

    SHORTEST = 0.005

    def __init__(self, odom_frame: str, base_frame: str) -> None:
        self._frames = odom_frame.lstrip("/"), base_frame.lstrip("/")
        self._last: tuple[float, Pose2D] | None = None
        self._velocity = Twist2D(0.0, 0.0, 0.0)

    def header(self, message: Message) -> Message | None:
        """Return the header of the transform, or None if it is not in the message: others are stamped by others."""
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
        told, pose = found
        if self._last is None or told < self._last[0]:
            self._last, self._velocity = found, Twist2D(0.0, 0.0, 0.0)
        elif told - self._last[0] >= self.SHORTEST:
            elapsed, moved = told - self._last[0], self._last[1].inverse() @ pose
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
        """Readings come whether set-points are sent or not."""
        return self._states.age

    def read(self) -> JointReading:
        """Return the newest reading; the connection's watchdog looks at how old it is."""
        return self._states.latest()

    def send(self, positions: Array, velocities: Array) -> None:
        """Send one set-point; does not wait."""
        point = {"positions": positions.tolist(), "time_from_start": self._duration}
        self._link.publish(self._topic, {"header": self._header, "joint_names": list(self._names), "points": [point]})
