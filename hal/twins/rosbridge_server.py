"""The twin of a ROS robot behind rosbridge: odometry, transforms, joint states, scans, wrenches, compressed images."""

from __future__ import annotations

import functools
import math
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping, Set
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import Pose2D, Twist2D, Wrench
from bestman_bt.robot_model.connection_config import ConnectionConfig
from bestman_bt.robot_model.model import BaseModel, JointGroupModel, RobotModel
from bestman_bt.robot_model.sensor_parts import BatteryPart, CameraPart, ImuPart, LidarPart, MountedForceTorque
from hal.api import JointGroup, MobileBase
from hal.twins import ros_messages
from hal.twins.errors import TwinError
from hal.twins.faults import Faults
from hal.twins.ros_messages import Message, RosVersion
from hal.twins.rosbridge_protocol import RosbridgeServer, Taker
from hal.twins.world import TwinWorld

Array = NDArray[np.float64]
TRACKING_GAIN = 20.0
"""Gain with which a trajectory controller corrects the joint positions, 1/s."""
AT_GOAL = 1e-5
"""Radians or metres: joints nearer to their goal are held in position; from farther away this would cause a jolt."""
ROLLING_WINDOW = 5
"""Number of readings in the mean velocity of a base, as ``velocity_rolling_window_size`` of diff_drive_controller."""


class TwinBase:
    """Accepts ``Twist`` and ``TwistStamped``, clipped to the base's limits; its command timeout ends old velocities."""

    def __init__(self, world: TwinWorld, base: MobileBase) -> None:
        self._world, self.base = world, base
        self._velocities: deque[Twist2D] = deque(maxlen=ROLLING_WINDOW)
        self._asked = [0.0, 0.0, 0.0]
        self.stuck, self.has_dead_man = False, True

    def drive(self, message: Mapping[str, Any]) -> None:
        """Handle a velocity command; thread-safe."""
        twist = message.get("twist", message)
        asked = [float(twist["linear"]["x"]), float(twist["linear"]["y"]), float(twist["angular"]["z"])]
        if not np.all(np.isfinite(asked)):
            raise ValueError(f"a velocity should be finite but is {asked}")
        limits = self.base.model.part
        most = np.array([limits.max_vx, limits.max_vy, limits.max_wz])
        velocity = (np.clip(asked, -most, most) * (not self.stuck)).tolist()
        self._asked = velocity
        self._world.post(lambda: self.base.set_velocity(*velocity))

    def tick(self) -> None:
        """Prepare the next physics step of the world; without a command timeout, the last velocity continues."""
        if not self.has_dead_man:
            self.base.set_velocity(*self._asked)

    def mean_velocity(self) -> Twist2D:
        """Return the mean of the last readings including this one: a parked wheel creeps by tenths of a millimetre."""
        self._velocities.append(self.base.velocity())
        return Twist2D(*np.mean([(v.vx, v.vy, v.wz) for v in self._velocities], axis=0).tolist())


class TwinJoints:
    """Accepts ``JointTrajectory`` of one point: moves there in a straight line in ``time_from_start``."""

    def __init__(self, world: TwinWorld, group: JointGroup, ros_names: tuple[str, ...]) -> None:
        self._world, self.group, self.ros_names = world, group, ros_names
        self._lower = group.model.lower
        self._upper = group.model.upper
        self._speed = group.model.velocity
        self._wanted: Array | None = None
        self._goal: Array = np.zeros(len(self._lower))
        self._left = 0.0
        self._resting = True

    def follow(self, message: Mapping[str, Any]) -> None:
        """Handle a trajectory; thread-safe."""
        order = [message["joint_names"].index(name) for name in self.ros_names]
        point = message["points"][-1]
        positions = np.array([float(point["positions"][index]) for index in order])
        duration = point["time_from_start"]
        seconds = sum(float(v) * (1e-9 if n in ("nsecs", "nanosec") else 1.0) for n, v in duration.items())
        if not np.all(np.isfinite(positions)):
            raise ValueError(f"positions should be finite but are {positions.tolist()}")
        goal = np.clip(positions, self._lower, self._upper)
        self._world.post(lambda: self._take(goal, seconds))

    def tick(self, dt: float) -> None:
        """Prepare the next physics step of the world."""
        if self._resting or self._wanted is None:
            return
        step = min(1.0, dt / max(self._left, dt))
        velocity = (self._goal - self._wanted) * step / dt
        self._wanted = self._wanted + velocity * dt
        self._left = max(0.0, self._left - dt)
        error = self._wanted - self.group.positions()
        if self._left == 0.0 and np.max(np.abs(error)) < AT_GOAL:
            self._resting = True
            self.group.command(positions=self._goal)
        else:
            self.group.command(velocities=np.clip(velocity + TRACKING_GAIN * error, -self._speed, self._speed))

    def _take(self, goal: Array, seconds: float) -> None:
        if self._resting:
            self._wanted = self.group.positions()
        self._goal, self._left, self._resting = goal, seconds, False


PORT = 9090
STATE_RATE, INFO_RATE = 50.0, 30.0
IDLE = 0.5
FRAME_PAUSE = 0.1
"""Pause after a frame, seconds: requests that arrive meanwhile get that frame."""
HANDING_OVER = 0.005
"""Seconds until a new reading is published: at least a physics step."""
LOCALISATION_RATE, POST_DATED, CLOCK_STEP = 10.0, 1.0, 0.5
SENSORS: Mapping[str, tuple[str, str, str, str, Callable[[Message, Any], Message]]] = {
    "lidar": ("scan", "scan", "sensor_msgs", "LaserScan", ros_messages.laser_scan),
    "force_torque": ("wrench", "wrench", "geometry_msgs", "WrenchStamped", ros_messages.wrench),
    "imu": ("read", "readings", "sensor_msgs", "Imu", ros_messages.imu),
    "battery": ("read", "state", "sensor_msgs", "BatteryState", ros_messages.battery),
}
"""Kind of sensor → how to read it, its stream, its message type and encoder."""


@dataclass
class PeriodicOutput:
    """Messages published ``rate`` times a second: topic → function that makes the message, in the world's thread.

    ``delay``: seconds of each period until its reading is available.
    """

    rate: float
    messages: dict[str, Callable[[], Message]]
    delay: float = 0.0
    _periods: int = -1

    def due(self, now: float) -> bool:
        """Return whether another period has begun."""
        before, self._periods = self._periods, math.floor((now - self.delay) * self.rate + 1e-6)
        return self._periods != before


class RosbridgeTwin:
    """Serves bases, joint groups, cameras, lidars, other sensors and batteries on ``address``.

    Its clock is the machine's wall clock, which differs from the client's. A camera captures while a client subscribes
    to it. Further faults: ``stale_odometry`` (repeats the same odometry), ``silent_odometry`` (none),
    ``fresh_odometry``; ``silent_scan``, ``fresh_scan``; ``stuck`` (the base does not move), ``free``; ``no_dead_man``
    (it keeps driving without commands), ``dead_man``; ``other_wrench_sign`` (the hand's wrench on the environment),
    ``wrench_sign``; ``blind`` (no images), ``sighted``; ``restart`` (disconnects all clients); ``clock_back`` (its
    clock is half a second behind, as after a step of NTP), ``clock_right``. Besides the base's transforms, it publishes
    those of a localisation that stamps them ahead: AMCL adds ``transform_tolerance``, 1.0 s by default ("time with
    which to post-date the transform that is published", Nav2's configuration guide).
    """

    def __init__(self, connection: ConnectionConfig, model: RobotModel, world: TwinWorld, address: str) -> None:
        self._options, self._model, self._world = connection.options, model, world
        self._version = RosVersion(self._options.ros)
        self._offset = time.time()  # of ROS time from the simulation's
        self._set_back = 0.0
        self._outputs: list[PeriodicOutput] = []
        self._types: dict[str, str] = {}
        self._takers: dict[str, Taker] = {}
        self._bases: list[TwinBase] = []
        self._joints: list[TwinJoints] = []
        self._cameras = [name for name in connection.parts if name in model.of(CameraPart)]
        self._stale_odometry = False
        self._odometry_topics: set[str] = set()
        self._scan_topics: set[str] = set()
        self._silent: set[str] = set()
        self._blind = self._turned_wrench = False
        self._closing = threading.Event()
        self.faults = Faults()
        wrists = {name: mounted.part for name, mounted in model.of(MountedForceTorque).items()}
        makers: tuple[tuple[Any, Callable[[str], None]], ...] = (
            (model.of(BaseModel), self._add_base),
            (model.of(CameraPart), self._add_camera),
            (model.of(JointGroupModel), self._add_joints),
            (model.of(LidarPart), functools.partial(self._add_sensor, "lidar", model.of(LidarPart))),
            (wrists, functools.partial(self._add_sensor, "force_torque", wrists)),
            (model.of(ImuPart), functools.partial(self._add_sensor, "imu", model.of(ImuPart))),
            (model.of(BatteryPart), functools.partial(self._add_sensor, "battery", model.of(BatteryPart))),
        )
        for name in connection.parts:
            for there, add in makers:
                if name in there:
                    add(name)
        self._server = RosbridgeServer(
            address,
            connection.port or PORT,
            self._types,
            self._takers,
            lambda: self._version.time(time.time() - self._set_back),
            self.faults,
        )
        self.faults.add(
            {
                "stale_odometry": functools.partial(self._set_odometry, True, frozenset()),
                "silent_odometry": functools.partial(self._set_odometry, False, self._odometry_topics),
                "fresh_odometry": functools.partial(self._set_odometry, False, frozenset()),
                "silent_scan": functools.partial(self._silent.update, self._scan_topics),
                "fresh_scan": functools.partial(self._silent.difference_update, self._scan_topics),
                "stuck": functools.partial(self._set_stuck, True),
                "free": functools.partial(self._set_stuck, False),
                "no_dead_man": functools.partial(self._set_dead_man, False),
                "other_wrench_sign": functools.partial(setattr, self, "_turned_wrench", True),
                "wrench_sign": functools.partial(setattr, self, "_turned_wrench", False),
                "dead_man": functools.partial(self._set_dead_man, True),
                "blind": functools.partial(self._set_blind, True),
                "sighted": functools.partial(self._set_blind, False),
                "restart": self._server.close_clients,
                "clock_back": functools.partial(setattr, self, "_set_back", CLOCK_STEP),
                "clock_right": functools.partial(setattr, self, "_set_back", 0.0),
            }
        )
        world.ticks.append(self._tick)

    def start(self) -> None:
        """Accept clients and capture images."""
        self._server.start()
        if self._cameras:
            threading.Thread(target=self._photograph, name="rosbridge cameras", daemon=True).start()

    def close(self) -> None:
        """Close the port."""
        self._closing.set()
        self._server.close()

    def _add_base(self, name: str) -> None:
        options = self._options
        base = TwinBase(self._world, self._world.robot.part(name, MobileBase))
        self._bases.append(base)
        kept: dict[str, Message] = {}

        def fresh(what: str, make: Callable[[Message], Message]) -> Message:
            """Return the message of now, or the one that a stale driver repeats."""
            if not self._stale_odometry or what not in kept:
                kept[what] = make(self._header(options.odom_frame, self._world.now()))
            return kept[what]

        def odometry(header: Message) -> Message:
            return ros_messages.odometry(header, options.base_frame, base.base.odometry(), base.mean_velocity())

        def transform(header: Message) -> Message:
            return ros_messages.transform(header, options.base_frame, base.base.odometry())

        outputs = {
            self._declare("base", name, "odometry", "nav_msgs", "Odometry"): lambda: fresh("odometry", odometry),
            self._declare("base", name, "transforms", "tf2_msgs", "TFMessage"): lambda: fresh("transform", transform),
        }
        self._outputs.append(PeriodicOutput(STATE_RATE, outputs))
        map_from_odom = Pose2D(0.0, 0.0, 0.0)
        self._outputs.append(
            PeriodicOutput(
                LOCALISATION_RATE,
                {
                    list(outputs)[1]: lambda: ros_messages.transform(
                        self._header("map", self._world.now() + POST_DATED), options.odom_frame, map_from_odom
                    )
                },
            )
        )
        self._odometry_topics |= set(outputs)
        stamped = "TwistStamped" if options.stamped_velocity else "Twist"
        self._takers[self._declare("base", name, "velocity", "geometry_msgs", stamped)] = base.drive

    def _add_joints(self, name: str) -> None:
        group = self._world.robot.part(name, JointGroup)
        joints = TwinJoints(
            self._world, group, tuple(self._options.joints.get(joint, joint) for joint in group.joint_names)
        )
        self._joints.append(joints)
        topic = self._declare("joint_group", name, "states", "sensor_msgs", "JointState")

        def states() -> Message:
            columns = [group.positions().tolist(), group.velocities().tolist(), group.efforts().tolist()]
            return ros_messages.joint_states(self._header("", self._world.now()), joints.ros_names, columns)

        self._outputs.append(PeriodicOutput(STATE_RATE, {topic: states}))
        commands = self._declare("joint_group", name, "commands", "trajectory_msgs", "JointTrajectory")
        self._takers[commands] = joints.follow

    def _add_sensor(self, kind: str, models: Mapping[str, Any], name: str) -> None:
        part, model = self._world.robot.parts[name], models[name]
        read, stream, package, message, write = SENSORS[kind]
        frame, rate = getattr(model, "frame", ""), min(model.rate, STATE_RATE)

        def make() -> Message:
            reading = getattr(part, read)()
            if kind == "force_torque" and self._turned_wrench:
                reading = Wrench(-reading.force, -reading.torque, reading.stamp)
            return write(self._header(frame, reading.stamp), reading)

        topic = self._declare(kind, name, stream, package, message)
        if kind == "lidar":
            self._scan_topics.add(topic)
        self._outputs.append(PeriodicOutput(rate, {topic: make}, getattr(model, "latency", 0.0) + HANDING_OVER))

    def _add_camera(self, name: str) -> None:
        model = self._model.of(CameraPart)[name]
        for stream in ("color", "depth"):
            self._declare("camera", name, stream, "sensor_msgs", "CompressedImage")
        topic = self._declare("camera", name, "info", "sensor_msgs", "CameraInfo")

        def info() -> Message:
            header = self._header(model.optical_frame, self._world.now())
            return ros_messages.camera_info(header, model.intrinsics, self._version)

        self._outputs.append(PeriodicOutput(INFO_RATE, {topic: info}))

    def _declare(self, kind: str, part: str, stream: str, package: str, message: str) -> str:
        topic: str = self._options.topic(kind, part, stream)
        self._types[topic] = self._options.message_type(package, message)
        return topic

    def _header(self, frame: str, at: float) -> Message:
        """Return a message header. ``at``: simulated time."""
        return self._version.header(frame, at + self._offset - self._set_back)

    def _tick(self, dt: float) -> None:
        """Run one control tick, before a physics step of the world."""
        now = self._world.now()
        self._offset = time.time() - now
        for joints in self._joints:
            joints.tick(dt)
        for base in self._bases:
            base.tick()
        for output in self._outputs:
            if output.due(now):
                for topic, make in output.messages.items():
                    if topic not in self._silent:
                        self._server.publish(topic, make)

    def _photograph(self) -> None:
        while not self._closing.is_set():
            wanted = [] if self._blind else [name for name in self._cameras if self._is_watched(name)]
            if not wanted:
                self._server.subscribed.clear()
                if not any(self._is_watched(name) for name in self._cameras):
                    self._server.subscribed.wait(IDLE)
                else:
                    self._closing.wait(0.02)
            for name in wanted:
                try:
                    images, exposed = self._world.photograph(name, ros_messages.image_messages)
                except (TwinError, TimeoutError):
                    return  # the world ends
                frame = self._model.of(CameraPart)[name].optical_frame
                header = {"header": self._version.header(frame, exposed - self._set_back)}
                for stream, image in zip(("color", "depth"), images, strict=True):
                    make: Callable[[], Message] = functools.partial(dict, image, **header)
                    self._server.publish(self._options.topic("camera", name, stream), make)
            if wanted:
                self._closing.wait(FRAME_PAUSE)

    def _is_watched(self, camera: str) -> bool:
        return any(
            self._server.has_subscriber(self._options.topic("camera", camera, stream)) for stream in ("color", "depth")
        )

    def _set_odometry(self, stale: bool, silent: Set[str]) -> None:
        self._stale_odometry = stale
        self._silent.difference_update(self._odometry_topics)
        self._silent.update(silent)

    def _set_stuck(self, stuck: bool) -> None:
        for base in self._bases:
            base.stuck = stuck

    def _set_dead_man(self, there: bool) -> None:
        for base in self._bases:
            base.has_dead_man = there

    def _set_blind(self, blind: bool) -> None:
        self._blind = blind
