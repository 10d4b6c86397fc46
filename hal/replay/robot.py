"""A robot that replays a recording: it returns the recorded readings and accepts the recorded commands."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from functools import cached_property
from pathlib import Path
from types import MappingProxyType, SimpleNamespace
from typing import Any

import numpy as np
from typing_extensions import override

import hal.api
from bestman_bt.messages import JointTrajectory
from bestman_bt.robot_model.model import RobotModel
from bestman_bt.scene.scene import World
from hal.api import (
    Failure,
    Motion,
    MotionErrorCode,
    MotionStatus,
    NoDataError,
    NotConnectedError,
    Part,
    Robot,
)
from hal.parts.channels import interface_of, part_proxy
from hal.parts.part_connection import ConnectionFailedError, refusal
from hal.parts.simulated_clock import SimulatedClock
from hal.parts.stop_latch import StopLatch
from hal.replay.tape import Readings, RecordedCommand, Tape, error_from_json, from_json, read_tape

SAME_MOMENT = 1e-6
IMAGE_WAIT = 2.0
"""Seconds by which an image may be taken earlier in the program than in the recording."""
STREAM_PAUSE = 0.5
"""Seconds without velocities or set-points after which the next one begins a new stream."""
STREAM_SLACK = 1.0
"""Seconds by which a stream may begin later in the program than in the recording."""
LONGEST_GAP = 5.0
"""Maximum seconds between a request and the recorded reading that is returned for it."""


class ReplayRobot(Robot):
    """Replays the ``recording`` of a run: a run folder, or the file in it. Time is simulated.

    A motion equal to the next recorded motion of its part is accepted and ends as recorded; the recording then
    continues from there, so that different computation times do not matter. Any other motion is refused with an
    explanation. Velocities and set-points are accepted where they were recorded, without effect; at the start of a
    stream, or at an image, the recording continues from the next recorded one. ``world``, ``seed`` and ``gui`` are for
    simulated drivers and have no effect here.
    """

    def __init__(
        self, model: RobotModel, world: World | None = None, *, recording: Path, seed: int = 0, gui: bool = False
    ) -> None:
        self.model, self._recording = model, Path(recording)
        self._connected, self._latch = False, StopLatch()
        self._offset = 0.0  # of the recording's time from the clock's
        self._used: dict[tuple[str, str], int] = {}
        self._motions: dict[str, ReplayedMotion] = {}
        self._streamed: dict[tuple[str, str], float] = {}  # when the program last sent a velocity or set-point
        self._stream_begun: dict[tuple[str, str], float] = {}  # where in the recording the present stream began

        self._seen: dict[str, float] = {}  # camera → when its last image was taken

    @cached_property
    def clock(self) -> SimulatedClock:  # type: ignore[override] # a property: read from the recording on first use
        """Simulated time, in the steps of the recording."""
        return SimulatedClock(self.tape.time_step)

    @cached_property
    def tape(self) -> Tape:
        """The recording. Raises ReplayError if it is missing or damaged."""
        return read_tape(self._recording)

    @cached_property
    def parts(self) -> Mapping[str, Part]:  # type: ignore[override] # a property: read from the recording on first use
        """The parts of the recorded robot."""
        return MappingProxyType({name: self._part(name) for name in self.tape.parts})

    @property
    def unsupported(self) -> Mapping[str, str]:
        """Return the unsupported features: commands other than those of the recording."""
        return {"commands": "a replay accepts only the recorded commands"}

    @property
    def stopped(self) -> bool:
        """Return whether the stop is latched."""
        return bool(self._latch)

    def connect(self) -> None:
        """Start the replay; idempotent. Raises ConnectionFailedError if there is no recording, or one of another
        robot.
        """
        if self._connected:
            return
        if self.tape.robot != self.model.name:
            raise ConnectionFailedError(f"this is a recording of {self.tape.robot!r}, not of {self.model.name!r}")
        self._offset = self.tape.start - self.clock.now()
        self._used, self._motions, self._streamed, self._stream_begun, self._seen = {}, {}, {}, {}, {}
        self.clock.step = lambda: None
        self._connected = True

    def disconnect(self) -> None:
        """End motions and periodic calls; idempotent."""
        if self._connected:
            self._end_motions(MotionStatus.FAILED, MotionErrorCode.DISCONNECTED, "the robot was disconnected")
            self._connected = False
            self.clock.step = None
            self.clock.cancel_timers()

    def stop(self) -> None:
        """End motions and refuse commands; the recording continues."""
        self._latch.set()
        self._end_motions(MotionStatus.CANCELED, MotionErrorCode.STOPPED, "stopped")

    @override
    def clear_stop(self) -> None:
        self._latch.clear()

    @override
    def diagnostics(self) -> dict[str, str]:
        return {
            "implementation": "replay",
            "connected": "yes" if self._connected else "no",
            "stopped": "yes" if self._latch else "no",
            "time": f"{self.moment():.2f} s of {self.tape.end:.2f} s recorded" if self._connected else "",
            "recording": "its end is missing: the run was killed" if self.tape.cut else "whole",
        }

    def moment(self) -> float:
        """Return the position in the recording, seconds of the recorded robot's clock."""
        return self.clock.now() + self._offset

    def _part(self, name: str) -> Part:
        kind_name, description = self.tape.parts[name]
        interface = interface_of(getattr(hal.api, kind_name))

        def reading(what: str) -> Callable[[Part], Any]:
            return lambda part: self._read(name, what)

        def command(what: str) -> Callable[..., Any]:
            return lambda part, *arguments, **keywords: self._command(name, what, arguments, keywords)

        members: dict[str, Any] = {what: reading(what) for what in interface.readings}
        members |= {what: command(what) for what in interface.commands}
        members["stop"] = lambda part: self._end_motion(name, MotionStatus.CANCELED, MotionErrorCode.STOPPED, "stopped")
        attributes = {attribute: description[attribute] for attribute in interface.attributes}
        described = SimpleNamespace(model=self.model.parts[name], **attributes)
        return part_proxy("Replayed", interface, name, members, described)

    def _read(self, part: str, what: str) -> Any:
        self._check_connected(part)
        found = self.tape.readings.get((part, what))
        if found is None:
            raise NoDataError(f"{part}: {what}() was never read in this recording", part)
        if what == "capture":
            self._go_on_to_image(part, found)
        moment = self.moment()
        taken, entry = found.at(moment, SAME_MOMENT)
        if what == "trajectory_time" and part in self._motions and not self._motions[part].holds(taken):
            return None  # it is that of the motion before
        if abs(taken - moment) > LONGEST_GAP:
            end = "; its end is missing" if self.tape.cut else ""
            raise NoDataError(
                f"{part}: the recording has no {what}() near {moment:.2f} s, the nearest is at {taken:.2f} s{end}", part
            )
        if "error" in entry:
            raise error_from_json(entry)
        value = from_json(entry["value"])
        shift = self.clock.now() - taken
        if abs(shift) > SAME_MOMENT and hasattr(value, "stamp"):
            return dataclasses.replace(value, stamp=value.stamp + shift)
        return value

    def _go_on_to_image(self, camera: str, images: Readings) -> None:
        """Advance to the next image, if it is soon: images are rare."""
        taken = images.after(max(self._seen.get(camera, 0.0), self.moment() - SAME_MOMENT))
        if taken is not None and taken - self.moment() <= IMAGE_WAIT:
            self._seen[camera] = taken
            self._offset = taken - self.clock.now()

    def _command(self, part: str, what: str, arguments: tuple[Any, ...], keywords: Mapping[str, Any]) -> Any:
        self._check_connected(part)
        self._latch.check(part, what)
        recorded = self.tape.commands.get((part, what), [])
        if not recorded:
            raise refusal(part, what, "the recording has no such command")
        if all(command.motion is None and command.refusal is None for command in recorded):
            self._supersede(part)
            self._go_on_with_streams((part, what))
            return None
        used = self._used.get((part, what), 0)
        asked = describe_command(what, arguments, keywords)
        if used == len(recorded):
            raise refusal(part, asked, f"the recording holds no further {what}")
        command = recorded[used]
        if not same_target(arguments, command.arguments):
            held = describe_command(what, command.arguments, command.keywords)
            raise refusal(part, asked, f"at {command.time:.2f} s the recording holds {held}")
        self._used[part, what] = used + 1
        self._offset = command.time - self.clock.now()
        if command.refusal is not None:
            raise error_from_json(command.refusal)
        self._supersede(part)
        self._motions[part] = motion = ReplayedMotion(part, self, command)
        return motion

    def _go_on_with_streams(self, key: tuple[str, str]) -> None:
        """Move the recording to the start of a stream of commands when the program starts one."""
        now, last = self.clock.now(), self._streamed.get(key, -LONGEST_GAP)
        self._streamed[key] = now
        if now - last <= STREAM_PAUSE:
            return
        earliest = max(self.moment() - STREAM_SLACK, self._stream_begun.get(key, 0.0) + SAME_MOMENT)
        begin = next((time for time in self.tape.stream_starts(key, STREAM_PAUSE) if time >= earliest), None)
        if begin is not None:
            self._stream_begun[key] = begin
            self._offset = begin - now

    def _check_connected(self, part: str) -> None:
        if not self._connected:
            raise NotConnectedError(f"{part} was used while the robot is not connected; call connect()", part)

    def _supersede(self, part: str) -> None:
        self._end_motion(part, MotionStatus.CANCELED, MotionErrorCode.SUPERSEDED, "a newer command took over")

    def _end_motion(self, part: str, status: MotionStatus, code: MotionErrorCode, text: str) -> None:
        motion = self._motions.pop(part, None)
        if motion is not None and not motion.done:
            motion.end(status, Failure(code, text))

    def _end_motions(self, status: MotionStatus, code: MotionErrorCode, text: str) -> None:
        for part in tuple(self._motions):
            self._end_motion(part, status, code, text)


class ReplayedMotion(Motion[None]):
    """A motion that ends with the result and at the time of the recorded one."""

    def __init__(self, part: str, robot: ReplayRobot, command: RecordedCommand) -> None:
        super().__init__(part)
        self._robot, self._command = robot, command

    def holds(self, moment: float) -> bool:
        """Return whether a moment of the recording is after the start of this motion."""
        return moment >= self._command.time - SAME_MOMENT

    def _look(self) -> None:
        moment, end = self._robot.moment(), self._command.end
        if end is not None and moment >= end[0] - SAME_MOMENT:
            self.end(end[1], end[2])
        elif moment > self._robot.tape.end:
            self.fail(MotionErrorCode.DISCONNECTED, "the recording ends before this motion does")


POSITION_TOLERANCE = 0.05
"""Radians or metres by which targets may differ: motion planning may choose another path to the same target."""


def same_target(asked: tuple[Any, ...], recorded: tuple[Any, ...]) -> bool:
    """Return whether the first arguments (targets) of two commands agree; others (speeds, forces) may differ."""
    if not asked or not recorded:
        return len(asked) == len(recorded)
    return _near(_target(asked[0]), _target(recorded[0]))


def describe_command(name: str, arguments: tuple[Any, ...], keywords: Mapping[str, Any]) -> str:
    """Return a command as readable text."""
    texts = [_short(value) for value in arguments] + [f"{key}={_short(value)}" for key, value in keywords.items()]
    return f"{name}({', '.join(texts)})"


def _target(value: Any) -> Any:
    return value.positions[-1] if isinstance(value, JointTrajectory) else value


def _near(asked: Any, recorded: Any) -> bool:
    try:
        a, b = np.asarray(asked, dtype=float), np.asarray(recorded, dtype=float)
    except (TypeError, ValueError):
        return False
    return a.shape == b.shape and bool(np.all(np.abs(a - b) <= POSITION_TOLERANCE))


def _short(value: Any) -> str:
    target = _target(value)
    if isinstance(target, (np.ndarray, list, tuple)):
        return "[" + ", ".join(f"{float(number):.2f}" for number in np.ravel(target)) + "]"
    return f"{target:.3f}" if isinstance(target, float) else repr(target)
