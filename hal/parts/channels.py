"""Interfaces that a driver implements for each moving part: read, send and halt, without any decision. SI units.

The controllers in ``hal.parts`` decide; they are the same for every vendor and for the simulation.
"""

from __future__ import annotations

import inspect
import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import Pose2D, Twist2D
from hal.api import Failure, Part
from hal.parts.black_box import Trace
from hal.parts.part_connection import PartConnection
from hal.parts.stop_latch import StopLatch


class ControlledPart(Part):
    """A part that a controller moves. ``trace``: recent commands and measurements, if recorded."""

    trace: Trace | None = None

    @property
    def traced(self) -> tuple[str, ...]:
        """Return the column names of the part's ``trace``; empty without a trace."""
        return ()

    @abstractmethod
    def attach(self) -> None:
        """Hold the current position after the controller has connected or recovered."""

    @abstractmethod
    def detach(self) -> None:
        """Prepare for a disconnect: motions fail, the part brakes, commands are refused; idempotent."""

    @property
    @abstractmethod
    def resting(self) -> bool:
        """Return whether no motion of it is commanded."""

    @abstractmethod
    def fail(self, fault: Failure) -> None:
        """Handle a fault of the controller: the current motion fails, the part comes to rest."""


def traces(parts: Mapping[str, Part], now: Callable[[], float]) -> dict[str, Trace]:
    """Start a trace of every part that supports one, with times from ``now``; returns name → trace."""
    found = {}
    for name, part in parts.items():
        if isinstance(part, ControlledPart) and part.traced:
            found[name] = part.trace = Trace(part.traced, now)
    return found


class StoppablePart(ControlledPart):
    """A part with one motion at a time; ``brake`` brings it to rest."""

    def __init__(self, name: str, latch: StopLatch) -> None:
        super().__init__(name)
        self._connection = PartConnection(name, latch)

    @abstractmethod
    def brake(self) -> None:
        """Come to rest within half a second."""

    def stop(self) -> None:
        """Come to rest and end the current motion."""
        with self._connection.lock:
            if self._connection.connected:
                self.brake()
                self._connection.stop_motion()

    def detach(self) -> None:
        """Come to rest before the controller disconnects."""
        with self._connection.lock:
            self.brake()
            self._connection.close()


OPTIONAL = frozenset({"trajectory_time"})
"""Readings that a part may lack; other methods with a body are implemented through abstract ones."""
ASIDES = frozenset({"carry"})
"""Commands that move nothing: they are neither recorded nor replayed."""


@dataclass(frozen=True)
class Interface:
    """The members of a part class of ``hal.api``, ``kind``: attributes, reading methods, commands, and ``asides``.

    ``attributes``: without the ``model``. ``asides``: commands that move nothing.
    """

    kind: type[Part]
    attributes: tuple[str, ...]
    readings: tuple[str, ...]
    commands: tuple[str, ...]
    asides: tuple[str, ...] = ()


def interface_of(part: type[Part]) -> Interface:
    """Return the members of a class of parts, from the most derived class of ``hal.api`` among its bases."""
    kind = next(cls for cls in part.__mro__ if cls.__module__.startswith("hal.api."))
    declared = dict.fromkeys(name for cls in kind.__mro__ for name in inspect.get_annotations(cls))
    attributes = tuple(name for name in declared if name not in ("kind", "model"))
    readings: list[str] = []
    commands: list[str] = []
    for name in dir(kind):
        found = getattr(kind, name)
        if name in OPTIONAL or (name != "stop" and getattr(found, "__isabstractmethod__", False)):
            (commands if len(inspect.signature(found).parameters) > 1 else readings).append(name)
    asides = tuple(sorted(ASIDES & set(dir(kind))))
    return Interface(kind, attributes, tuple(readings), tuple(commands), asides)


def part_proxy(prefix: str, interface: Interface, name: str, members: Mapping[str, Any], described: Any) -> Part:
    """Return a part whose methods are ``members``; its model and attributes are those that ``described`` has."""
    part: Part = type(f"{prefix}{interface.kind.__name__}", (interface.kind,), dict(members))(name)
    for attribute in ("model", *interface.attributes):
        if hasattr(described, attribute):  # sensors have no model of their own
            setattr(part, attribute, getattr(described, attribute))
    return part


Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class JointReading:
    """Measured positions, velocities and efforts, (n,) each; rad, rad/s, N m."""

    positions: Array
    velocities: Array
    efforts: Array


@dataclass(frozen=True)
class GripperReading:
    """The reading of a gripper. ``width``: metres. ``object_held``: whether the gripper itself detects an object, or
    None if it cannot.
    """

    width: float
    object_held: bool | None = None


@dataclass(frozen=True)
class BaseReading:
    """Odometry, and the velocity in the base frame."""

    odometry: Pose2D
    velocity: Twist2D


class JointChannel(ABC):
    """Joints behind a controller that accepts streamed position set-points.

    ``stream_at_rest``: whether the controller needs a set-point every period, even at rest. ``takes_efforts``: whether
    it also accepts efforts. ``longest_tool_step``: metres that the controller allows an arm's tool to move between two
    set-points.
    """

    stream_at_rest = False
    takes_efforts = False
    longest_tool_step = math.inf

    @property
    def age(self) -> float:
        """Return the age of the latest reading in seconds; 0 if each set-point waits for a reading."""
        return 0.0

    @property
    def scaling(self) -> float:
        """Return the scale of time, 0 to 1, with which the controller follows set-points; 0: it is paused."""
        return 1.0

    @abstractmethod
    def read(self) -> JointReading:
        """Return the latest reading without waiting. Raises NoDataError if there is none."""

    def published(self) -> JointReading:
        """Return the reading for programs: ``read()``, unless further sensors provide it.

        Raises NoDataError if these are silent.
        """
        return self.read()

    def exert(self, efforts: Array) -> None:
        """Apply ``efforts`` (n,), N m or N, until a set-point is sent; only if ``takes_efforts`` is set."""
        raise NotImplementedError  # a channel that takes efforts overrides it; the law asks no other

    def halt(self) -> None:
        """Brake joints that efforts have moved, as hard as their drives can; only if ``takes_efforts`` is set.

        Called every control period until they are at rest: set-points within the limits cannot brake joints that are
        faster than the limits. By default the joints are held where they are.
        """
        positions = self.read().positions
        self.send(positions, np.zeros_like(positions))

    @abstractmethod
    def send(self, positions: Array, velocities: Array) -> None:
        """Send one set-point (n,); called every control period while joints move; may take a round trip."""


class GripperChannel(ABC):
    """A gripper behind a controller. ``reaction_time``: seconds from a command to the first reading that shows it."""

    reaction_time = 0.4

    def refresh(self) -> bool | None:  # noqa: B027 - nothing to do where readings come by themselves
        """Request the next reading; may take a round trip. Called once per cycle, after commands were sent.

        Returns False if none arrived: until the next one the fingers do not count as at rest.
        """

    @abstractmethod
    def read(self) -> GripperReading:
        """Return the latest reading without waiting. Raises NoDataError if there is none."""

    @abstractmethod
    def send(self, width: float, force: float, speed: float) -> None:
        """Move to ``width`` metres with at most ``force`` N at ``speed`` m/s (rate of the width)."""

    @abstractmethod
    def halt(self) -> None:
        """Hold the current width; a held object stays in the hand."""


class BaseChannel(ABC):
    """A base behind a controller that accepts velocities."""

    @abstractmethod
    def read(self) -> BaseReading:
        """Return the latest reading without waiting. Raises NoDataError if there is none."""

    @abstractmethod
    def send(self, velocity: Twist2D) -> bool:
        """Drive at a velocity (base frame); called every control period while the base moves.

        Returns False if the command was not accepted yet, because the wheels are still steering; it is due again.
        """
