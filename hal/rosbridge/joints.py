"""Joints behind ROS, for example a pan-tilt head: set-points to a trajectory controller, joint states in."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hal.parts import JointChannel, JointReading
from hal.rosbridge import decoding
from hal.rosbridge.decoding import Message
from hal.rosbridge.link import RosLink
from hal.rosbridge.options import RosbridgeOptions
from hal.rosbridge.stream import Stream

Array = NDArray[np.float64]
REACH_PERIODS = 1.5
"""Within how many periods of ours the controller is to reach a set-point: longer than one, so that it never pauses."""


class JointStates:
    """Picks the joints of one part, by their names in ROS, out of ``sensor_msgs/JointState``."""

    def __init__(self, ros_names: tuple[str, ...]) -> None:
        self._names = ros_names

    def decode(self, message: Message, at: float) -> JointReading | None:
        """A reading; None where the message is about other joints."""
        found = decoding.joints(message, self._names)
        return JointReading(*(np.array(column) for column in found)) if found is not None else None


class RosJoints(JointChannel):
    """Sends each set-point as a ``trajectory_msgs/JointTrajectory`` of one point, for a joint_trajectory_controller."""

    def __init__(
        self,
        link: RosLink,
        topic: str,
        ros_names: tuple[str, ...],
        options: RosbridgeOptions,
        states: Stream[JointReading],
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
        """The newest reading; the connection's watchdog looks at how old it is."""
        return self._states.latest()

    def send(self, positions: Array, velocities: Array) -> None:
        """One set-point; it does not wait."""
        point = {"positions": positions.tolist(), "time_from_start": self._duration}
        self._link.publish(self._topic, {"header": self._header, "joint_names": list(self._names), "points": [point]})
