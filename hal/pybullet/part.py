"""What simulated parts that move share: the connection, the stop latch, and one motion at a time."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from hal.api import CommandRefusedError, MotionErrorCode, MotionStatus, NotConnectedError
from hal.parts import PartMotion
from hal.pybullet.simulation import Simulation


class Attachable(Protocol):
    """A part that a simulation can be attached to."""

    def attach(self, simulation: Simulation) -> None:
        """Connect to a running simulation."""

    def detach(self) -> None:
        """Let go of the simulation; idempotent."""


class Connection:
    """Holds the simulation while the robot is connected, and says who asked when it is not."""

    def __init__(self, part_name: str, stopped: Callable[[], bool]) -> None:
        self._part_name = part_name
        self._stopped = stopped
        self._simulation: Simulation | None = None
        self._motion: PartMotion | None = None

    @property
    def simulation(self) -> Simulation:
        """The running simulation; NotConnectedError without one."""
        if self._simulation is None:
            raise NotConnectedError(f"{self._part_name} was used while the robot is not connected; call connect()")
        return self._simulation

    @property
    def present(self) -> bool:
        """Whether there is a simulation."""
        return self._simulation is not None

    @property
    def motion(self) -> PartMotion | None:
        """The motion under way."""
        motion = self._motion
        return motion if motion is not None and motion.status is MotionStatus.RUNNING else None

    def attach(self, simulation: Simulation) -> None:
        """The robot has connected."""
        self._simulation = simulation

    def detach(self) -> None:
        """The robot disconnects."""
        self.end_motion(MotionStatus.FAILED, MotionErrorCode.DISCONNECTED, "the robot was disconnected")
        self._simulation = None

    def check_command(self, command: str) -> Simulation:
        """The simulation, if a command may act now; raises NotConnectedError or CommandRefusedError."""
        simulation = self.simulation
        if self._stopped():
            raise CommandRefusedError(
                f"{self._part_name} refused {command}: the robot is stopped; clear_stop() makes it accept commands"
            )
        return simulation

    def refuse(self, command: str, why: str) -> CommandRefusedError:
        """The error for a command that is malformed or beyond a limit."""
        return CommandRefusedError(f"{self._part_name} refused {command}: {why}")

    def begin(self, motion: PartMotion | None) -> None:
        """A new command takes over; the older motion, if any, is superseded."""
        self.end_motion(MotionStatus.CANCELED, MotionErrorCode.SUPERSEDED, "a newer command took over")
        self._motion = motion

    def end_motion(self, status: MotionStatus, code: MotionErrorCode, text: str) -> None:
        """End the motion under way, if any."""
        if self._motion is not None:
            self._motion.end(status, code, f"{self._part_name}: {text}")
