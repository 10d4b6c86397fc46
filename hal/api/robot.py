"""Robots: a clock, and parts by name."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Self, TypeVar, cast

from hal.api.errors import UnknownPartError
from hal.api.part import Part

if TYPE_CHECKING:
    from bestman_bt.robot_model.model import RobotModel


class Timer:
    """A periodic call that runs until it is cancelled; for implementations of clocks.

    ``start``: time of the clock at which the first ``period`` begins, seconds. Raises ValueError if ``period`` is not
    finite and positive.
    """

    def __init__(self, period: float, start: float, call: Callable[[], None]) -> None:
        if not (math.isfinite(period) and period > 0.0):
            raise ValueError(f"timer period should be finite and positive but is {period!r}")
        self._period, self._start, self._call = period, start, call
        self._calls = 0
        self.cancelled = False

    @property
    def due(self) -> float:
        """Return the time of the next call, seconds of the clock."""
        return self._start + (self._calls + 1) * self._period

    def run(self, now: float | None = None) -> None:
        """Call once; with ``now``, skip the calls that were missed by then."""
        missed = 0 if now is None else int((now - self._start) / self._period + 1e-9)
        self._calls = max(self._calls + 1, missed)
        self._call()

    def cancel(self) -> None:
        """Stop calling; idempotent."""
        self.cancelled = True


class Clock(ABC):
    """The only source of time above the hardware layer.

    In simulation ``sleep`` steps physics and runs the due periodic calls, in one thread. On hardware it waits, and runs
    the periodic calls that the sleeping thread has registered.
    """

    @abstractmethod
    def now(self) -> float:
        """Return the monotonic time in seconds since an arbitrary start."""

    @abstractmethod
    def sleep(self, duration: float) -> None:
        """Let ``duration`` seconds pass. Raises ValueError if it is negative or not finite."""

    @abstractmethod
    def every(self, period: float, call: Callable[[], None]) -> Timer:
        """Call ``call`` every ``period`` seconds, first after one period; it must return within the period."""


PartType = TypeVar("PartType", bound=Part)


class Robot(ABC):
    """A simulated or real robot: connect it, read its parts, command them.

    The constructor does no work; the description (``parts``, ``model``) can be read before ``connect()``.
    """

    clock: Clock
    """The robot's time."""
    model: RobotModel
    """URDF, parts, frames, postures."""
    parts: Mapping[str, Part]
    """All parts by name."""

    @abstractmethod
    def connect(self) -> None:
        """Open the connection; idempotent."""

    @abstractmethod
    def disconnect(self) -> None:
        """Stop and close the connection; idempotent."""

    @abstractmethod
    def stop(self) -> None:
        """Bring all parts to rest and refuse commands until ``clear_stop()``; idempotent and thread-safe.

        Takes effect within one control period; all parts are at rest (0.01 rad/s, 0.01 m/s) within 0.5 s; no earlier
        command takes effect afterwards.
        """

    def keep_black_box_in(self, folder: Path | None) -> None:  # noqa: B027 - of robots that keep one
        """Write the last minute of set-points and measurements into ``folder`` whenever the robot stops.

        The file is ``black_box_<n>.npz``, see ``bestman_bt.messages.black_box``; None ends this. Pending files are
        written before the call returns.
        """

    @abstractmethod
    def clear_stop(self) -> None:
        """Accept commands again, without starting a motion."""

    @property
    @abstractmethod
    def stopped(self) -> bool:
        """Return whether the robot is stopped, until ``clear_stop()``."""

    speed = 1.0
    """Scale of the speed of motions, see ``set_speed``."""

    def set_speed(self, share: float) -> None:
        """Scale the speed of all motions, including the current ones, by ``share``, 0 to 1; thread-safe.

        Motions keep their path, because their time is scaled; at 0 they pause. The value remains until it is set again.
        Grippers, and motions that a controller plans itself, keep their speed. Raises ValueError outside [0, 1].
        """
        if not 0.0 <= share <= 1.0:
            raise ValueError(f"speed = {share!r} is not within [0, 1]")
        self.speed = float(share)
        for part in self.parts.values():
            part.speed_share = self.speed

    @property
    def unsupported(self) -> Mapping[str, str]:
        """Return the unsupported features by name, with the reason.

        ``hal.conformance`` fails a robot that lacks a feature without declaring it. Names are those of parts in the
        model, of checks, and ``commands`` for a robot that only reports.
        """
        return {}

    @abstractmethod
    def diagnostics(self) -> dict[str, str]:
        """Return diagnostic texts by subject, for people."""

    def part(self, name: str, part_type: Callable[..., PartType]) -> PartType:
        """Return the part called ``name``. Raises UnknownPartError listing the available parts.

        ``part_type``: ``Arm``, ``Gripper``, …; annotated as a callable, because type checkers accept no abstract class
        as a ``type``.
        """
        kind = cast(type[PartType], part_type)
        part = self.parts.get(name)
        if not isinstance(part, kind):
            available = ", ".join(f"{n} ({p.kind})" for n, p in self.parts.items())
            raise UnknownPartError(f"no {kind.kind} called {name!r}; this robot has: {available}")
        return part

    def __enter__(self) -> Self:
        self.connect()
        return self

    def __exit__(self, *_: object) -> None:
        self.disconnect()
