"""What parts that are controlled share: the connection, the stop latch, and one motion at a time."""

from __future__ import annotations

import threading

from bestman_bt.errors import InputError
from bestman_bt.messages import MotionObstacle
from hal.api import CommandRefusedError, Failure, Motion, MotionErrorCode, MotionStatus, NotConnectedError, RobotError
from hal.parts.stop_latch import StopLatch


class ConnectionFailedError(RobotError, InputError):
    """A controller could not be reached, refused the connection, or its SDK is not installed."""


class PartConnection:
    """The state of one part that several threads reach; hold ``lock`` over what belongs together."""

    def __init__(self, part_name: str, latch: StopLatch) -> None:
        self.part_name = part_name
        self.lock = threading.RLock()
        self._latch = latch
        self.connected = False
        self._lost: Failure | None = None
        self._motion: Motion[None] | None = None

    @property
    def motion(self) -> Motion[None] | None:
        """The motion under way."""
        motion = self._motion
        return motion if motion is not None and motion.status is MotionStatus.RUNNING else None

    def open(self) -> None:
        """The controller has connected."""
        self.connected, self._lost = True, None

    def close(self) -> None:
        """The controller disconnects."""
        self.connected = False
        self.end_motion(MotionStatus.FAILED, MotionErrorCode.DISCONNECTED, "the robot was disconnected")

    def check_connected(self) -> None:
        """Raise NotConnectedError without a connection."""
        if not self.connected:
            raise NotConnectedError(
                f"{self.part_name} was used while the robot is not connected; call connect()", self.part_name
            )

    def check_reading(self) -> None:
        """Whether readings are of now; raises NotConnectedError, also after the controller was lost."""
        self.check_connected()
        if self._lost is not None:
            text = f"{self.part_name} delivers nothing: {self._lost}"
            raise NotConnectedError(text, self.part_name, self._lost.vendor_code)

    def check_command(self, command: str) -> None:
        """Whether a command may act now; raises NotConnectedError or CommandRefusedError."""
        self.check_connected()
        self._latch.check(self.part_name, command)

    def refuse(self, command: str, why: str) -> CommandRefusedError:
        """The error for a command that is malformed or beyond a limit."""
        return CommandRefusedError(f"{self.part_name} refused {command}: {why}", self.part_name)

    def begin(self, motion: Motion[None] | None) -> None:
        """A new command takes over; the older motion, if any, is superseded."""
        self.end_motion(MotionStatus.CANCELED, MotionErrorCode.SUPERSEDED, "a newer command took over")
        self._motion = motion

    def end_motion(
        self,
        status: MotionStatus,
        code: str,
        text: str,
        vendor_code: str = "",
        obstacle: MotionObstacle | None = None,
    ) -> None:
        """End the motion under way, if any."""
        if self._motion is not None:
            self._motion.end(status, Failure(code, text, self.part_name, vendor_code, obstacle))

    def stop_motion(self) -> None:
        """The robot or the part was stopped: the motion under way, if any, is cancelled and told why."""
        fault = self._latch.fault
        text, vendor_code = ("stopped", "") if fault is None else (f"stopped because {fault}", fault.vendor_code)
        self.end_motion(MotionStatus.CANCELED, MotionErrorCode.STOPPED, text, vendor_code)

    def fail_motion(self, fault: Failure) -> None:
        """The motion under way, if any, has failed because of a fault; one that cuts the wire cuts readings, too."""
        if fault.code is MotionErrorCode.DISCONNECTED:
            self._lost = fault
        self.end_motion(MotionStatus.FAILED, fault.code, fault.text, fault.vendor_code)
