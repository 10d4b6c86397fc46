"""State shared by controlled parts: the connection, the stop latch, and one motion at a time."""

from __future__ import annotations

import threading

from bestman_bt.errors import InputError
from bestman_bt.messages import MotionObstacle
from hal.api import CommandRefusedError, Failure, Motion, MotionErrorCode, MotionStatus, NotConnectedError, RobotError
from hal.parts.stop_latch import StopLatch


class ConnectionFailedError(RobotError, InputError):
    """A controller could not be reached, refused the connection, or its SDK is not installed."""


def refusal(part_name: str, command: str, why: str) -> CommandRefusedError:
    """Return the error for a command that is malformed or beyond a limit."""
    return CommandRefusedError(f"{part_name} refused {command}: {why}", part_name)


class PartConnection:
    """The state of one part, shared between threads; hold ``lock`` for related accesses."""

    def __init__(self, part_name: str, latch: StopLatch) -> None:
        self.part_name = part_name
        self.lock = threading.RLock()
        self._latch = latch
        self.connected = False
        self._lost: Failure | None = None
        self._motion: Motion[None] | None = None

    @property
    def motion(self) -> Motion[None] | None:
        """The current motion, or None."""
        motion = self._motion
        return motion if motion is not None and motion.status is MotionStatus.RUNNING else None

    def open(self) -> None:
        """Mark the controller as connected."""
        self.connected, self._lost = True, None

    def close(self) -> None:
        """Mark the controller as disconnected; the current motion fails."""
        self.connected = False
        self.end_motion(MotionStatus.FAILED, MotionErrorCode.DISCONNECTED, "the robot was disconnected")

    def check_connected(self) -> None:
        """Raise NotConnectedError without a connection."""
        if not self.connected:
            raise NotConnectedError(
                f"{self.part_name} was used while the robot is not connected; call connect()", self.part_name
            )

    def check_reading(self) -> None:
        """Raise NotConnectedError if readings are not current: not connected, or connection lost."""
        self.check_connected()
        if self._lost is not None:
            text = f"{self.part_name} delivers nothing: {self._lost}"
            raise NotConnectedError(text, self.part_name, self._lost.vendor_code)

    def check_command(self, command: str) -> None:
        """Raise NotConnectedError or CommandRefusedError if a command is not allowed now."""
        self.check_connected()
        self._latch.check(self.part_name, command)

    def refuse(self, command: str, why: str) -> CommandRefusedError:
        """Return the error for a refused command of this part."""
        return refusal(self.part_name, command, why)

    def begin(self, motion: Motion[None] | None) -> None:
        """Start a new command; the current motion, if any, is superseded."""
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
        """End the current motion, if any."""
        if self._motion is not None:
            self._motion.end(status, Failure(code, text, self.part_name, vendor_code, obstacle))

    def stop_motion(self) -> None:
        """Cancel the current motion, if any, with the reason of the stop."""
        fault = self._latch.fault
        text, vendor_code = ("stopped", "") if fault is None else (f"stopped because {fault}", fault.vendor_code)
        self.end_motion(MotionStatus.CANCELED, MotionErrorCode.STOPPED, text, vendor_code)

    def fail_motion(self, fault: Failure) -> None:
        """Fail the current motion, if any, because of a fault; a lost connection also invalidates readings."""
        if fault.code is MotionErrorCode.DISCONNECTED:
            self._lost = fault
        self.end_motion(MotionStatus.FAILED, fault.code, fault.text, fault.vendor_code)
