"""A recording, read: what each part told when, and what it was commanded."""

from __future__ import annotations

import bisect
import contextlib
import gzip
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from hal.api import MotionError, MotionStatus
from hal.hardware import ConnectionFailedError
from hal.replay.encoding import from_json

TAPE_NAME = "readings.jsonl.gz"


@dataclass
class Readings:
    """Of one method of one part: times, ascending, and what was told, as JSON."""

    times: list[float] = field(default_factory=list)
    told: list[dict[str, Any]] = field(default_factory=list)

    def at(self, moment: float, tolerance: float) -> tuple[float, dict[str, Any]]:
        """The newest until ``moment`` (and ``tolerance`` seconds more), or the first one if that is later."""
        index = max(0, bisect.bisect_right(self.times, moment + tolerance) - 1)
        return self.times[index], self.told[index]

    def after(self, moment: float) -> float | None:
        """When the first one after ``moment`` was told."""
        index = bisect.bisect_right(self.times, moment)
        return self.times[index] if index < len(self.times) else None


@dataclass
class RecordedCommand:
    """``arguments``, ``keywords``: decoded. ``refusal``: as JSON, None where it was accepted.

    ``end``: when its motion ended and how; None where it has none, or it went on to the end of the recording.
    """

    time: float
    arguments: tuple[Any, ...]
    keywords: Mapping[str, Any]
    motion: int | None
    refusal: dict[str, Any] | None
    end: tuple[float, MotionStatus, MotionError | None] | None = None


@dataclass(frozen=True)
class Tape:
    """``parts``: name → kind and description. ``readings``, ``commands``: by part and method. Seconds of the robot."""

    robot: str
    start: float
    time_step: float
    end: float
    parts: Mapping[str, tuple[str, Mapping[str, Any]]]
    readings: Mapping[tuple[str, str], Readings]
    commands: Mapping[tuple[str, str], list[RecordedCommand]]

    def stream_starts(self, key: tuple[str, str], pause: float) -> list[float]:
        """When commands of one method of one part began to come, after none for ``pause`` seconds."""
        times = [command.time for command in self.commands.get(key, [])]
        return [time for before, time in zip([-math.inf, *times], times, strict=False) if time - before > pause]


def read_tape(path: Path) -> Tape:
    """The tape in a run folder, or a file; ConnectionFailedError says why there is none."""
    file = path / TAPE_NAME if path.is_dir() else path
    try:
        with gzip.open(file, "rt", encoding="utf-8") as lines:
            header = json.loads(next(lines))
            readings: dict[tuple[str, str], Readings] = {}
            commands: dict[tuple[str, str], list[RecordedCommand]] = {}
            motions: dict[int, RecordedCommand] = {}
            end = float(header["start"])
            with contextlib.suppress(EOFError, json.JSONDecodeError):  # a run that was killed ends in mid-line
                for text in lines:
                    line = json.loads(text)
                    end = float(line["t"])
                    _take(line, readings, commands, motions)
    except FileNotFoundError as error:
        text = f"{path} holds no readings; record a run with --record"
        raise ConnectionFailedError(text) from error
    except (OSError, EOFError, ValueError, KeyError, StopIteration) as error:
        raise ConnectionFailedError(f"{file} is no recording of a robot: {type(error).__name__}: {error}") from error
    parts = {
        name: (told["kind"], {what: from_json(value) for what, value in told["description"].items()})
        for name, told in header["parts"].items()
    }
    return Tape(header["robot"], header["start"], header["time_step"], end, parts, readings, commands)


def _take(
    line: dict[str, Any],
    readings: dict[tuple[str, str], Readings],
    commands: dict[tuple[str, str], list[RecordedCommand]],
    motions: dict[int, RecordedCommand],
) -> None:
    moment = float(line["t"])
    if "read" in line:
        column = readings.setdefault((line["part"], line["read"]), Readings())
        column.times.append(moment)
        column.told.append(line)
    elif "command" in line:
        command = RecordedCommand(
            moment,
            tuple(from_json(line["arguments"])),
            {name: from_json(value) for name, value in line["keywords"].items()},
            line.get("motion"),
            line if "error" in line else None,
        )
        commands.setdefault((line["part"], line["command"]), []).append(command)
        if command.motion is not None:
            motions[command.motion] = command
    elif line["ended"] in motions:
        motions[line["ended"]].end = moment, from_json(line["status"]), from_json(line["why"])
