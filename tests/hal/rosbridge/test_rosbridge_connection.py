"""What a connection to rosbridge makes of messages that stay away, are malformed, or come of another clock."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bestman_bt.messages import LaserScan, Pose2D, Twist2D
from bestman_bt.robot_model.compose import load_robot_model
from bestman_bt.robot_model.connection_config import SafetyConfig
from bestman_bt.robot_model.sensor_parts import LidarPart
from hal.api import Lidar, MobileBase, MotionErrorCode, NoDataError
from hal.parts.part_connection import ConnectionFailedError
from hal.parts.simulated_clock import SimulatedClock
from hal.parts.stop_latch import StopLatch
from hal.rosbridge.connection import RosbridgeConnection
from hal.twins import ros_messages
from hal.twins.ros_messages import RosVersion

ROBOT = Path(__file__).parent / "ros_robot.yaml"
PERIOD = 0.02
Message = Mapping[str, Any]


class Link:
    """A websocket whose other end is the test: ``told`` topic → what comes at once; ``sent``: what was published."""

    def __init__(self, name: str, clock: SimulatedClock) -> None:
        self.clock, self.heard, self.complaint, self.connected = clock, -1e9, "", False
        self.handlers: dict[str, Callable[[Message, float], None]] = {}
        self.sent: list[tuple[str, Message]] = []
        self.told: Callable[[], dict[str, Message]] = dict

    def open(self, *arguments: Any) -> None:
        self.heard, self.connected, self.complaint = self.clock.now(), True, ""

    def close(self) -> None:
        self.connected = False

    def abandon(self) -> None:
        self.connected = False

    def advertise(self, topic: str, message_type: str) -> None:
        pass

    def publish(self, topic: str, message: Message) -> None:
        self.sent.append((topic, message))

    def subscribe(self, topic: str, message_type: str, handler: Any, period: float = 0.0) -> None:
        self.handlers[topic] = handler
        self.come(topic)

    def come(self, *topics: str) -> None:
        messages = self.told()
        for topic in topics or messages:
            self.heard = self.clock.now()
            self.handlers[topic](messages[topic], self.heard)


class Loop:
    """A control loop that the test steps."""

    def __init__(self, name: str, rate: float, step: Callable[[float], None], crashed: Any) -> None:
        self.step = step

    def start(self) -> None:
        pass

    def close(self) -> None:
        pass


class Ros:
    """A base and a lidar behind a connection. ``ahead``: seconds by which ROS's clock is ahead of ours."""

    def __init__(self) -> None:
        self.clock = SimulatedClock(PERIOD)
        self.clock.step = lambda: None
        self.ahead, self.scan_frame = 1000.0, "lidar_link"
        model = load_robot_model(ROBOT)
        settings = replace(model.connections["platform"], parts=("base", "lidar"))
        limits = SafetyConfig(watchdog=0.25)
        self.connection = RosbridgeConnection("platform", settings, model, limits, self.clock, StopLatch())
        self.link: Link = self.connection._link
        self.link.told = self.told
        self.connection.connect()
        self.base, self.lidar = self.connection.parts["base"], self.connection.parts["lidar"]
        assert isinstance(self.base, MobileBase)
        assert isinstance(self.lidar, Lidar)

    def told(self) -> dict[str, Message]:
        header = RosVersion(2).header("odom", self.clock.now() + self.ahead)
        scan = LaserScan(np.full(8, 2.0), 0.0, 0.1, 0.1, 8.0, 0.0)
        still = ros_messages.odometry(header, "base_link", Pose2D(0.0, 0.0, 0.0), Twist2D(0.0, 0.0, 0.0))
        return {"/odom": still, "/scan": ros_messages.laser_scan({**header, "frame_id": self.scan_frame}, scan)}

    def cycles(self, count: int, *topics: str) -> None:
        """Time goes on; ``topics`` come meanwhile."""
        for _ in range(count):
            self.clock.sleep(PERIOD)
            if topics:
                self.link.come(*topics)
            for loop in self.connection.loops:
                loop.step(PERIOD)


@pytest.fixture
def ros(monkeypatch: pytest.MonkeyPatch) -> Ros:
    monkeypatch.setattr("hal.rosbridge.connection.RosLink", Link)
    monkeypatch.setattr("hal.hardware.connection.ControlLoop", Loop)
    return Ros()


def test_no_velocity_is_sent_any_more_once_nothing_is_heard(ros: Ros) -> None:
    ros.base.set_velocity(0.2, 0.0, 0.0)
    ros.cycles(5, "/odom", "/scan")
    assert ros.link.sent
    ros.cycles(13)
    sent = len(ros.link.sent)
    ros.base.set_velocity(0.2, 0.0, 0.0)
    ros.cycles(10)
    assert len(ros.link.sent) == sent
    fault = ros.connection.fault()
    assert fault is not None
    assert fault.code is MotionErrorCode.DISCONNECTED


def test_a_topic_in_another_frame_than_the_models_is_refused_with_the_option_that_allows_it(ros: Ros) -> None:
    ros.connection.disconnect()
    ros.scan_frame = "base_scan"
    with pytest.raises(ConnectionFailedError, match="/scan is in the frame 'base_scan'.*options.frames.lidar"):
        ros.connection.connect()


def test_a_lidar_that_falls_silent_has_no_scan_after_a_moment_and_the_base_drives_on(ros: Ros) -> None:
    ros.cycles(5, "/odom", "/scan")
    longest = max(4.0 / ros.connection.model.of(LidarPart)["lidar"].rate, 0.25 + 0.05)
    ros.cycles(int(longest / PERIOD) - 1, "/odom")
    ros.lidar.scan()
    ros.cycles(3, "/odom")
    with pytest.raises(NoDataError, match="/scan"):
        ros.lidar.scan()
    assert ros.connection.fault() is None


def test_odometry_that_stays_away_while_scans_come_is_a_fault(ros: Ros) -> None:
    ros.cycles(5, "/odom", "/scan")
    ros.cycles(14, "/scan")
    assert ros.connection.fault() is None
    ros.cycles(3, "/scan")
    fault = ros.connection.fault()
    assert fault is not None
    assert fault.code is MotionErrorCode.TIMEOUT
    assert "/odom" in fault.text


def test_a_malformed_message_is_a_fault_until_it_is_cleared(ros: Ros) -> None:
    ros.cycles(2, "/odom", "/scan")
    ros.link.complaint = "a message on /scan is malformed"
    fault = ros.connection.fault()
    assert fault is not None
    assert fault.code is MotionErrorCode.FAULT
    ros.connection.clear(fault)
    assert ros.connection.fault() is None


def test_connected_anew_stamps_are_read_by_the_clock_of_the_new_connection(ros: Ros) -> None:
    """As after a restart of the robot's computer, which has set its clock back."""
    ros.cycles(5, "/odom", "/scan")
    ros.connection.disconnect()
    ros.ahead = 400.0
    ros.connection.connect()
    ros.cycles(5, "/odom", "/scan")
    assert ros.connection.fault() is None
    ros.lidar.scan()


def test_connected_anew_what_a_topic_has_told_before_does_not_count(ros: Ros) -> None:
    ros.connection.disconnect()
    ros.connection.options = replace(ros.connection.options, connect_timeout=0.05)
    subscribe = ros.link.subscribe
    ros.link.subscribe = lambda topic, *rest: None if topic == "/scan" else subscribe(topic, *rest)
    with pytest.raises(ConnectionFailedError, match="no messages on /scan"):
        ros.connection.connect()
