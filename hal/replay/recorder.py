"""Records all readings and commands between a program and a robot."""

from __future__ import annotations

import functools
import gzip
import io
import json
import threading
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from types import MappingProxyType
from typing import Any

from typing_extensions import override

from hal.api import ForceTorque, Gripper, JointGroup, MobileBase, Motion, Part, Robot, RobotError, Sensor, Timer
from hal.parts.channels import interface_of, part_proxy
from hal.parts.simulated_clock import SimulatedClock
from hal.replay.tape import error_to_json, to_json

SAMPLE_PERIOD = 0.05
"""Seconds between samples of joints and grippers, which programs read rarely, and of running motions."""
DEFAULT_TIME_STEP = 1.0 / 240.0


class RecordedRobot(Robot):
    """A wrapper of a connected ``robot`` that records all readings and commands to ``path`` until ``close``. The
    compressed file has one JSON document per line: first the description of the parts, then readings, commands, and how
    motions ended. Joints, grippers and speeds are also sampled; in simulation, sensors with noise or state are not, so
    that recording does not change the run. If a line cannot be written, ``failed`` is called and recording ends.
    """

    def __init__(self, robot: Robot, path: Path, failed: Callable[[OSError], None] = lambda error: None) -> None:
        self._robot, self._failed = robot, failed
        self._lock = threading.Lock()
        self._file = io.TextIOWrapper(gzip.GzipFile(path, "wb", compresslevel=1), encoding="utf-8")
        self._pending: list[RecordedMotion] = []
        self._commands = 0
        self.clock = clock = robot.clock
        self.model = robot.model
        step = clock.time_step if isinstance(clock, SimulatedClock) else DEFAULT_TIME_STEP
        self._simulated = isinstance(clock, SimulatedClock)
        self._write({"robot": robot.model.name, "start": clock.now(), "time_step": step, "parts": self._description()})
        self.parts = MappingProxyType({name: self._seen_through(part) for name, part in robot.parts.items()})
        self._timer: Timer | None = clock.every(SAMPLE_PERIOD, self.sample)

    @property
    def unsupported(self) -> Mapping[str, str]:
        """The unsupported features of the wrapped robot."""
        return self._robot.unsupported

    @property
    @override
    def stopped(self) -> bool:
        return self._robot.stopped

    def connect(self) -> None:
        """Connect the robot."""
        self._robot.connect()

    def disconnect(self) -> None:
        """Disconnect the robot; close the recording first."""
        self._robot.disconnect()

    def stop(self) -> None:
        """Stop the robot."""
        self._robot.stop()

    def set_speed(self, share: float) -> None:
        """Set the robot's speed."""
        super().set_speed(share)
        self._robot.set_speed(share)

    def clear_stop(self) -> None:
        """Clear the robot's stop."""
        self._robot.clear_stop()

    def diagnostics(self) -> dict[str, str]:
        """Return the diagnostics of the wrapped robot."""
        return self._robot.diagnostics()

    def sample(self) -> None:
        """Record joint and gripper positions, base velocities, and finished motions."""
        for part in self._robot.parts.values():
            if isinstance(part, JointGroup):
                self._try_to_read(part, "positions")
                self._try_to_read(part, "velocities")
            elif isinstance(part, MobileBase):
                self._try_to_read(part, "velocity")
                if not self._simulated:
                    self._try_to_read(part, "odometry")
            elif isinstance(part, ForceTorque) and not self._simulated:
                self._try_to_read(part, "wrench")
            elif isinstance(part, Gripper):
                self._try_to_read(part, "width")
                self._try_to_read(part, "state")
        self._note_ends()

    def close(self) -> None:
        """End the recording; idempotent."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
            self._note_ends()
            with self._lock, suppress(OSError):  # of what could not be written before
                self._file.close()

    def _description(self) -> dict[str, Any]:
        parts = {}
        for name, part in self._robot.parts.items():
            interface = interface_of(type(part))
            if interface.kind is Sensor:
                continue  # of a plug-in: its content is unknown here
            document = {name: to_json(getattr(part, name)) for name in interface.attributes}
            parts[name] = {"kind": interface.kind.__name__, "description": document}
        return parts

    def _seen_through(self, part: Part) -> Part:
        interface = interface_of(type(part))
        if interface.kind is Sensor:
            return part

        def reading(name: str) -> Callable[[Part], Any]:
            return lambda seen: self._read(part, name)

        def command(name: str) -> Callable[..., Any]:
            return lambda seen, *arguments, **keywords: self._command(part, name, arguments, keywords)

        members: dict[str, Any] = {name: reading(name) for name in interface.readings}
        members |= {name: command(name) for name in interface.commands}
        members["stop"] = lambda seen: part.stop()
        members |= {name: _told_on(part, name) for name in interface.asides}
        return part_proxy("Recorded", interface, part.name, members, part)

    def _read(self, part: Part, name: str) -> Any:
        note = functools.partial(self._note, read=name, part=part.name)
        try:
            value = getattr(part, name)()
        except RobotError as error:
            note(**error_to_json(error))
            raise
        note(value=to_json(value))
        return value

    def _try_to_read(self, part: Part, name: str) -> None:
        with suppress(RobotError):  # it is recorded, and not handled here
            self._read(part, name)

    def _command(self, part: Part, name: str, arguments: tuple[Any, ...], keywords: dict[str, Any]) -> Any:
        document = {"arguments": to_json(list(arguments)), "keywords": {k: to_json(v) for k, v in keywords.items()}}
        note = functools.partial(self._note, command=name, part=part.name, **document)
        try:
            answer = getattr(part, name)(*arguments, **keywords)
        except RobotError as error:
            note(**error_to_json(error))
            raise
        if not isinstance(answer, Motion):
            note()
            return answer
        with self._lock:
            self._commands += 1
            motion = RecordedMotion(answer, functools.partial(self._note, ended=self._commands))
            self._pending.append(motion)
            number = self._commands
        note(motion=number)
        return motion

    def _note_ends(self) -> None:
        with self._lock:
            pending = tuple(self._pending)
        ended = {id(motion) for motion in pending if motion.done}  # looking is what writes it down
        with self._lock:
            self._pending = [motion for motion in self._pending if id(motion) not in ended]

    def _note(self, **line: Any) -> None:
        with self._lock:  # with the time: lines are in its order, whichever thread they come from
            if not self._file.closed:
                self._write({"t": self._robot.clock.now(), **line})

    def _write(self, line: dict[str, Any]) -> None:
        try:
            self._file.write(json.dumps(line, separators=(",", ":")) + "\n")
        except OSError as error:
            self._failed(error)
            with suppress(OSError):
                self._file.close()


class RecordedMotion(Motion[Any]):
    """A motion whose result is recorded when a caller first observes its end."""

    def __init__(self, motion: Motion[Any], note: Callable[..., None]) -> None:
        super().__init__()
        self._motion, self._note = motion, note

    def cancel(self) -> None:
        """Stop the part."""
        self._motion.cancel()

    def _look(self) -> None:
        motion = self._motion
        if motion.done:
            self.end(motion.status, motion.failure, motion.result)
            self._note(status=to_json(motion.status), why=to_json(motion.failure))


def _told_on(part: Part, name: str) -> Callable[..., Any]:
    return lambda seen, *arguments, **keywords: getattr(part, name)(*arguments, **keywords)
