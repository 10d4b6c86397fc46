"""Options of a rosbridge connection in a robot's YAML."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Literal

from pydantic import Field

from bestman_bt.configuration.quantity import Frequency, PositiveTime
from hal.api import Clock
from hal.hardware.clock import RemoteTime, SynchronisedTime

TOPICS: Mapping[str, Mapping[str, str]] = {
    "base": {"velocity": "/cmd_vel", "odometry": "/odom", "transforms": "/tf"},
    "lidar": {"scan": "/scan"},
    "camera": {
        "color": "/{part}/color/image_raw/compressed",
        "depth": "/{part}/aligned_depth_to_color/image_raw/compressedDepth",
        "info": "/{part}/color/camera_info",
    },
    "joint_group": {"states": "/joint_states", "commands": "/{part}_controller/joint_trajectory"},
    "force_torque": {"wrench": "/{part}/wrench"},
    "imu": {"readings": "/{part}/data"},
    "battery": {"state": "/battery_state"},
}
"""Kind of part → its streams → their default topics."""

Rate = Annotated[Frequency, Field(le=200.0)]


@dataclass(frozen=True)
class RosbridgeOptions:
    """Options of ``driver: rosbridge``.

    ``topics``: part → stream → topic, if not the default (``TOPICS``). ``joints``: joint of the robot model → its name
    in ROS, if different. ``ros``: version of ROS, which determines the names of message types. ``odometry``: whether
    poses arrive as ``nav_msgs/Odometry`` or as the transform from ``odom_frame`` to ``base_frame``, frame names in ROS.
    ``frames``: part → frame name of its messages in ROS, if different from the robot model's; they are compared when
    connecting. ``clock``: ``synchronised`` with this machine's by PTP or NTP, so that stamps are used directly, or
    ``estimated`` for each part from its fastest message, whose own latency remains unknown. ``stamped_velocity``:
    whether the base takes ``TwistStamped``. ``rate``: rate of velocities and set-points, Hz. ``longest_delay``: largest
    sustained delay of readings, seconds. ``image_time``: seconds to wait for an image. ``pairing``: maximum seconds
    between the stamps of matching colour and depth images. ``secure``: TLS. ``connect_timeout``: seconds.
    """

    topics: Mapping[str, Mapping[str, str]] = field(default_factory=dict)
    joints: Mapping[str, str] = field(default_factory=dict)
    ros: Literal[1, 2] = 2
    odometry: Literal["odom", "tf"] = "odom"
    odom_frame: str = "odom"
    base_frame: str = "base_link"
    frames: Mapping[str, str] = field(default_factory=dict)
    clock: Literal["synchronised", "estimated"] = "estimated"
    stamped_velocity: bool = False
    rate: Rate = 50.0
    longest_delay: PositiveTime = 0.15
    image_time: PositiveTime = 3.0
    pairing: PositiveTime = 0.02
    secure: bool = False
    connect_timeout: PositiveTime = 5.0

    def ros_time(self, clock: Clock) -> RemoteTime:
        """Return the time of a stamp source, on ``clock``."""
        return SynchronisedTime(clock) if self.clock == "synchronised" else RemoteTime()

    def topic(self, kind: str, part: str, stream: str) -> str:
        """Return the topic of a part's stream."""
        given = self.topics.get(part, {})
        return given[stream] if stream in given else TOPICS[kind][stream].format(part=part)

    def message_type(self, package: str, name: str) -> str:
        """Return the name of a message type in this version of ROS."""
        return f"{package}/{name}" if self.ros == 1 else f"{package}/msg/{name}"
