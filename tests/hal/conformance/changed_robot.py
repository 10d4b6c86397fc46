"""How a robot is made to break one promise, and which checks find it out."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from hal.api import Failure, Motion, MotionStatus, Robot
from hal.conformance import CHECKS, LIFE_CHECKS
from hal.conformance.subject import Check

Make = Callable[[], Any]
Break = Callable[[Any], None]
"""Breaks a promise of a robot that is not connected yet."""


def changed(subject: Any, **members: Any) -> Any:
    """The base class of an object whose methods and properties are from now on others."""
    base = type(subject)
    subject.__class__ = type(f"Changed{base.__name__}", (base,), members)
    return base


def wrapped(subject: Any, method: str, around: Callable[..., Any]) -> None:
    """``around(do, *arguments)`` instead of a method; ``do`` is what the method did."""
    base = type(subject)
    do = getattr(base, method)

    def instead(self: Any, *arguments: Any, **keywords: Any) -> Any:
        return around(lambda *a, **k: do(self, *a, **k), *arguments, **keywords)

    changed(subject, **{method: instead})


def of(part: str, method: str, around: Callable[..., Any]) -> Break:
    """Breaks a method of a part."""
    return lambda robot: wrapped(robot.parts[part], method, around)


def telling(part: str, name: str, value: Callable[[Any], Any]) -> Break:
    """Breaks an attribute of a part: ``value(what it should be)``."""
    return lambda robot: setattr(robot.parts[part], name, value(getattr(robot.parts[part], name)))


class OneMotion(Motion[None]):
    """A motion that behaves in one thing differently from the one it stands for."""

    def __init__(self, motion: Motion[None]) -> None:
        self.motion = motion

    @property
    def status(self) -> MotionStatus:
        return self.motion.status

    @property
    def failure(self) -> Failure | None:
        return self.motion.failure

    def cancel(self) -> None:
        self.motion.cancel()


class OnlySaysSo(OneMotion):
    """Cancelled at once, but what moves goes on, for ``delay`` seconds."""

    delay: float | None = None
    clock: Any = None
    cancelled = False

    @property
    def status(self) -> MotionStatus:
        running = self.motion.status is MotionStatus.RUNNING
        return MotionStatus.CANCELED if self.cancelled and running else self.motion.status

    def cancel(self) -> None:
        if self.motion.done:
            return
        self.cancelled = True
        if self.delay is not None:
            self.clock.every(self.delay, self.motion.cancel)


def failing(make: Make, spoil: Break, checks: tuple[Check, ...] = (*CHECKS, *LIFE_CHECKS)) -> list[str]:
    """Names of the checks that a broken robot fails; a new one for each."""
    failed = []
    for check in checks:
        robot: Robot = make()
        spoil(robot)
        if check.why_not(robot) is not None:
            continue
        try:
            if check in CHECKS:
                robot.connect()
            check.run(robot)
        except Exception:  # noqa: BLE001 - whatever a check raises, it has found something
            failed.append(check.name)
        finally:
            robot.disconnect()
    return failed
