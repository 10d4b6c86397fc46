"""A driver of one's own: a robot that exists in memory only, made of the parts that real controllers get, too.

It does at once and exactly the commands; its time passes in ``sleep``. Test it as any driver::

    pytest --pyargs hal.conformance --driver memory_robot:MemoryRobot
"""

from __future__ import annotations

import math

import numpy as np
from memory_sensors import FlatCamera, FullBattery, QuietWrist, RoundRoom, StillImu, UntouchedBumper, UntouchedPad

from bestman_bt.messages import Pose2D, Twist2D, wrap_angle
from bestman_bt.robot_model.model import ArmModel, BaseModel, GripperModel, JointGroupModel, RobotModel
from bestman_bt.robot_model.sensor_parts import (
    BatteryPart,
    CameraPart,
    ImuPart,
    LidarPart,
    MountedBumper,
    MountedForceTorque,
    TactilePart,
)
from bestman_bt.scene.scene import World
from hal.api import Part, Robot
from hal.parts.channels import BaseChannel, BaseReading, GripperChannel, GripperReading, JointChannel, JointReading
from hal.parts.driven_base import DrivenBase
from hal.parts.gate import ToolLimits
from hal.parts.gripper import CommandedGripper
from hal.parts.simulated_clock import SimulatedClock
from hal.parts.stop_latch import StopLatch
from hal.parts.streamed_arm import StreamedArm
from hal.parts.streamed_joints import StreamedJointGroup

PERIOD = 0.01


class Joints(JointChannel):
    """Joints that are where they were last sent."""

    def __init__(self, positions: np.ndarray) -> None:
        self._positions, self._velocities = positions, np.zeros_like(positions)

    def read(self) -> JointReading:
        """Efforts are zero: nothing weighs anything."""
        return JointReading(self._positions, self._velocities, np.zeros_like(self._positions))

    def send(self, positions: np.ndarray, velocities: np.ndarray) -> None:
        """Be there."""
        self._positions, self._velocities = positions, velocities


class Fingers(GripperChannel):
    """Fingers that never meet anything."""

    def __init__(self, model: GripperModel) -> None:
        self._width = self._target = model.max_width
        self._speed = 0.0

    def read(self) -> GripperReading:
        """The present width."""
        return GripperReading(self._width)

    def send(self, width: float, force: float, speed: float) -> None:
        """Set out for a width."""
        self._target, self._speed = width, speed

    def halt(self) -> None:
        """Stay."""
        self._target = self._width

    def move(self, dt: float) -> None:
        """What happens in ``dt`` seconds."""
        step = self._speed * dt
        self._width += min(max(self._target - self._width, -step), step)


class Wheels(BaseChannel):
    """A base that drives exactly as it is told, and knows exactly where it is."""

    def __init__(self) -> None:
        self._pose, self._velocity = Pose2D(0.0, 0.0, 0.0), Twist2D(0.0, 0.0, 0.0)

    def read(self) -> BaseReading:
        """Odometry without any drift."""
        return BaseReading(self._pose, self._velocity)

    def send(self, velocity: Twist2D) -> bool:
        """Drive."""
        self._velocity = velocity
        return True

    def move(self, dt: float) -> None:
        """What happens in ``dt`` seconds."""
        v, heading = self._velocity, self._pose.theta + self._velocity.wz * dt / 2
        x = self._pose.x + (v.vx * math.cos(heading) - v.vy * math.sin(heading)) * dt
        y = self._pose.y + (v.vx * math.sin(heading) + v.vy * math.cos(heading)) * dt
        self._pose = Pose2D(x, y, wrap_angle(self._pose.theta + v.wz * dt))


class MemoryRobot(Robot):
    """Any robot that a YAML describes. ``world``, ``seed`` and ``gui`` are what every driver is given."""

    def __init__(self, model: RobotModel, world: World | None = None, *, seed: int = 0, gui: bool = False) -> None:
        self.model, self._latch, self.clock = model, StopLatch(), SimulatedClock(PERIOD)
        home = model.postures["home"]
        self._channels: list[Fingers | Wheels] = []
        self._moving: list[StreamedJointGroup | CommandedGripper | DrivenBase] = []
        for name, group in (model.of(ArmModel) | model.of(JointGroupModel)).items():
            at = np.array([home.get(joint, 0.0) for joint in group.joint_names])
            channel = Joints(np.clip(at, group.lower, group.upper))
            if name in model.of(ArmModel):
                tool = ToolLimits(model, name, model.safety)
                self._moving.append(StreamedArm(name, model.of(ArmModel)[name], channel, self._latch, PERIOD, tool))
            else:
                self._moving.append(StreamedJointGroup(name, group, channel, self._latch, PERIOD))
        for name, gripper in model.of(GripperModel).items():
            fingers = Fingers(gripper)
            self._channels.append(fingers)
            self._moving.append(CommandedGripper(name, gripper, fingers, self._latch))
        for name, base in model.of(BaseModel).items():
            wheels = Wheels()
            self._channels.append(wheels)
            self._moving.append(DrivenBase(name, base, wheels, self._latch))
        sensors: list[Part] = [FlatCamera(name, camera, self) for name, camera in model.of(CameraPart).items()]
        sensors += [RoundRoom(name, lidar, self) for name, lidar in model.of(LidarPart).items()]
        sensors += [QuietWrist(name, wrist, self) for name, wrist in model.of(MountedForceTorque).items()]
        sensors += [StillImu(name, imu, self) for name, imu in model.of(ImuPart).items()]
        sensors += [UntouchedPad(name, pad, self) for name, pad in model.of(TactilePart).items()]
        sensors += [UntouchedBumper(name, bumper, self) for name, bumper in model.of(MountedBumper).items()]
        sensors += [FullBattery(name, battery, self) for name, battery in model.of(BatteryPart).items()]
        self.parts: dict[str, Part] = {part.name: part for part in (*self._moving, *sensors)}

    @property
    def connected(self) -> bool:
        """Whether it is connected."""
        return self.clock.step is not None

    def connect(self) -> None:
        """Begin."""
        if self.connected:
            return
        for part in self._moving:
            part.attach()
        self.clock.step = self._step

    def disconnect(self) -> None:
        """End motions and periodic calls."""
        for part in self._moving:
            part.detach()
        self.clock.step = None
        self.clock.cancel_timers()

    def stop(self) -> None:
        """Bring all parts to rest, and latch."""
        self._latch.set()
        for part in self._moving:
            part.stop()

    def clear_stop(self) -> None:
        """Accept commands again."""
        self._latch.clear()

    @property
    def stopped(self) -> bool:
        """Whether the stop is latched."""
        return bool(self._latch)

    def diagnostics(self) -> dict[str, str]:
        """For people."""
        return {"implementation": "memory", "connected": "yes" if self.connected else "no"}

    def _step(self) -> None:
        for part in self._moving:
            part.cycle(PERIOD)
        for channel in self._channels:
            channel.move(PERIOD)
