"""A mobile base behind ROS: velocities out, odometry in."""

from __future__ import annotations

from bestman_bt.messages import Pose2D, Twist2D, wrap_angle
from hal.parts import BaseChannel, BaseReading
from hal.rosbridge import decoding
from hal.rosbridge.decoding import Message
from hal.rosbridge.link import RosLink
from hal.rosbridge.options import RosbridgeOptions
from hal.rosbridge.stream import Stream


class RosBase(BaseChannel):
    """Publishes ``Twist`` or ``TwistStamped``; a base of ROS lets velocities lapse by itself, as this stack's do."""

    def __init__(self, link: RosLink, topic: str, options: RosbridgeOptions, odometry: Stream[BaseReading]) -> None:
        self._link, self._topic, self._options, self._odometry = link, topic, options, odometry

    @property
    def message_type(self) -> str:
        """Of the velocities."""
        return self._options.message_type(
            "geometry_msgs", "TwistStamped" if self._options.stamped_velocity else "Twist"
        )

    def read(self) -> BaseReading:
        """The newest reading; the connection's watchdog looks at how old it is."""
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

    def header(self, message: Message) -> Message:
        """The header of the transform, or of any other where it is not in the message."""
        for entry in message["transforms"]:
            if entry["child_frame_id"].lstrip("/") == self._frames[1]:
                found: Message = entry["header"]
                return found
        first: Message = message["transforms"][0]["header"]
        return first

    def decode(self, message: Message, at: float) -> BaseReading | None:
        """A reading; None where the message is about other frames."""
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
