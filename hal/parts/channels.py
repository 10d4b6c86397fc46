"""What a driver provides for each moving part: read, send and halt, without any decision. SI units.

The laws of ``hal.parts`` decide; they are the same for every vendor and for the simulation.
"""

from __future__ import annotations

import inspect
import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import Pose2D, Twist2D
from hal.api import Failure, Part
from hal.parts.black_box import Trace
from hal.parts.part_connection import PartConnection
from hal.parts.stop_latch import StopLatch

# Parts that are controlled over a connection: what the connection needs of them, and how they come to rest.


class ControlledPart(Part):
    """A part behind a controller. ``trace``: keeps what it was told and measured lately, where somebody wants that."""

    trace: Trace | None = None

    @property
    def traced(self) -> tuple[str, ...]:
        """Names of what it writes into its ``trace`` each control period; empty where it writes nothing."""
        return ()

    @abstractmethod
    def attach(self) -> None:
        """The controller has connected, or has recovered: hold where the part is."""

    @abstractmethod
    def detach(self) -> None:
        """The controller is about to disconnect: motions fail, the part brakes, commands are refused; idempotent."""

    @property
    @abstractmethod
    def resting(self) -> bool:
        """Whether nothing of it is commanded to move any more."""

    @abstractmethod
    def fail(self, fault: Failure) -> None:
        """The controller has a fault: the motion under way has failed, the part comes to rest."""


def traces(parts: Mapping[str, Part], now: Callable[[], float]) -> dict[str, Trace]:
    """Have all parts that write one keep a trace, by the time of ``now``; name → trace."""
    found = {}
    for name, part in parts.items():
        if isinstance(part, ControlledPart) and part.traced:
            found[name] = part.trace = Trace(part.traced, now)
    return found


class StoppablePart(ControlledPart):
    """A part with one motion at a time, which ``brake`` brings to rest."""

    def __init__(self, name: str, latch: StopLatch) -> None:
        super().__init__(name)
        self._connection = PartConnection(name, latch)

    @abstractmethod
    def brake(self) -> None:
        """Come to rest within half a second."""

    def stop(self) -> None:
        """Come to rest, ending the motion under way."""
        with self._connection.lock:
            if self._connection.connected:
                self.brake()
                self._connection.stop_motion()

    def detach(self) -> None:
        """The controller disconnects: come to rest."""
        with self._connection.lock:
            self.brake()
            self._connection.close()


# What a kind of part in ``hal.api`` consists of, for those that stand between a program and a part.


COMPOSED = frozenset({"open", "close"})
"""Methods that the interface itself makes of others."""
ASIDES = frozenset({"carry"})
"""What a part is told that moves nothing: a recording holds it not, and a replay needs it not."""


@dataclass(frozen=True)
class Interface:
    """``kind``: the class of ``hal.api``. Names of its attributes, of methods that read, of those that command, asides.

    ``attributes``: without the ``model``.
    """

    kind: type[Part]
    attributes: tuple[str, ...]
    readings: tuple[str, ...]
    commands: tuple[str, ...]
    asides: tuple[str, ...] = ()


def interface_of(part: type[Part]) -> Interface:
    """The interface of a class of parts, by the most special class of ``hal.api`` that it derives from."""
    kind = next(cls for cls in part.__mro__ if cls.__module__.startswith("hal.api."))
    declared = dict.fromkeys(name for cls in kind.__mro__ for name in inspect.get_annotations(cls))
    attributes = tuple(name for name in declared if name not in ("kind", "model"))
    readings: list[str] = []
    commands: list[str] = []
    for name in dir(kind):
        found = inspect.getattr_static(kind, name)
        if not name.startswith("_") and name not in COMPOSED | ASIDES | {"stop"} and inspect.isfunction(found):
            (commands if len(inspect.signature(found).parameters) > 1 else readings).append(name)
    asides = tuple(sorted(ASIDES & set(dir(kind))))
    return Interface(kind, attributes, tuple(readings), tuple(commands), asides)


Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class JointReading:
    """Measured positions, velocities and efforts, (n,) each; rad, rad/s, N m."""

    positions: Array
    velocities: Array
    efforts: Array


@dataclass(frozen=True)
class GripperReading:
    """``width`` metres. ``object_held``: whether the gripper itself feels an object; None where it cannot tell."""

    width: float
    object_held: bool | None = None


@dataclass(frozen=True)
class BaseReading:
    """Odometry, and the velocity in the base frame."""

    odometry: Pose2D
    velocity: Twist2D


class JointChannel(ABC):
    """Joints behind a controller that takes streamed position set-points.

    ``stream_at_rest``: whether the controller wants a set-point every period, also where nothing moves.
    ``takes_efforts``: whether it takes efforts, too. ``longest_tool_step``: metres that the controller allows an
    arm's tool between two set-points.
    """

    stream_at_rest = False
    takes_efforts = False
    longest_tool_step = math.inf

    @property
    def age(self) -> float:
        """Seconds since the latest reading was taken; 0 where each set-point waits for one."""
        return 0.0

    @property
    def scaling(self) -> float:
        """The share of real time, 0 to 1, in which the controller follows set-points; 0: it is paused."""
        return 1.0

    @abstractmethod
    def read(self) -> JointReading:
        """The latest reading; it does not wait. NoDataError where none has come."""

    def published(self) -> JointReading:
        """What programs read; as ``read()``, unless further sensors tell it. NoDataError where they tell nothing."""
        return self.read()

    def exert(self, efforts: Array) -> None:
        """Exert ``efforts`` (n,), N m or N, until a set-point is sent; only where it ``takes_efforts``."""
        raise NotImplementedError  # a channel that takes efforts overrides it; the law asks no other

    @abstractmethod
    def send(self, positions: Array, velocities: Array) -> None:
        """One set-point, called every control period while joints move; may take a round trip."""


class GripperChannel(ABC):
    """A gripper behind a controller. ``reaction_time``: seconds from a command to the first reading that shows it."""

    reaction_time = 0.4

    def refresh(self) -> None:  # noqa: B027 - nothing to do where readings come by themselves
        """Ask for the next reading; may take a round trip. Called once a cycle, after what was to be sent."""

    @abstractmethod
    def read(self) -> GripperReading:
        """The latest reading; it does not wait. NoDataError where none has come."""

    @abstractmethod
    def send(self, width: float, force: float, speed: float) -> None:
        """Go to ``width`` metres with at most ``force`` N at ``speed`` m/s (rate of the width)."""

    @abstractmethod
    def halt(self) -> None:
        """Stay at the present width; what is held stays held."""


class BaseChannel(ABC):
    """A base behind a controller that takes velocities."""

    @abstractmethod
    def read(self) -> BaseReading:
        """The latest reading; it does not wait. NoDataError where none has come."""

    @abstractmethod
    def send(self, velocity: Twist2D) -> bool:
        """Drive at a velocity (base frame); called every control period while the base moves.

        False: not taken yet, the wheels still turn to where it asks them to; it is due again.
        """
