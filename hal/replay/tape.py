"""A recording in memory: timed readings and commands of each part."""

from __future__ import annotations

import base64
import binascii
import bisect
import dataclasses
import gzip
import json
import math
import zlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from enum import Enum
from pathlib import Path
from typing import Any, TextIO

import numpy as np

import bestman_bt.messages
import hal.api
from hal.api import Failure, MotionStatus, Part, PartError, RobotError
from hal.parts.part_connection import ConnectionFailedError

_MODULES = (bestman_bt.messages, hal.api)
_TYPES: dict[str, type] = {
    name: found for module in _MODULES for name, found in vars(module).items() if isinstance(found, type)
}


def to_json(value: Any) -> Any:
    """Return dataclasses of ``bestman_bt.messages`` and ``hal.api``, arrays, enumerations, tuples and plain values as
    JSON.
    """
    if isinstance(value, np.ndarray):
        packed = base64.b64encode(zlib.compress(np.ascontiguousarray(value).tobytes(), 1)).decode("ascii")
        return {"array": packed, "dtype": str(value.dtype), "shape": list(value.shape)}
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, Enum):
        return {"enum": type(value).__name__, "value": value.value}
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        fields = {field.name: to_json(getattr(value, field.name)) for field in dataclasses.fields(value) if field.init}
        return {"type": type(value).__name__, "fields": fields}
    if isinstance(value, (tuple, list)):
        return {"items": [to_json(item) for item in value], "list": isinstance(value, list)}
    if value is None or isinstance(value, (bool, int, float, str)):
        return value
    raise TypeError(f"a {type(value).__name__} cannot be recorded")


def from_json(document: Any) -> Any:
    """Return the value that ``to_json`` encoded. Raises LookupError for an unknown type."""
    if not isinstance(document, dict):
        return document
    if "array" in document:
        kind, shape = np.dtype(document["dtype"]), tuple(int(size) for size in document["shape"])
        expected = math.prod(shape) * kind.itemsize
        if not 0 <= expected <= LARGEST_ARRAY:
            raise ValueError(f"an array of {expected} bytes; at most {LARGEST_ARRAY} are read")
        data = zlib.decompressobj().decompress(base64.b64decode(document["array"]), expected + 1)
        return np.frombuffer(data, kind).reshape(shape)
    if "enum" in document:
        return _TYPES[document["enum"]](document["value"])
    if "type" in document:
        fields = {name: from_json(value) for name, value in document["fields"].items()}
        return _TYPES[document["type"]](**fields)
    items = [from_json(item) for item in document["items"]]
    return items if document["list"] else tuple(items)


def error_to_json(error: RobotError) -> dict[str, str]:
    """Return class, message and vendor's code of an error; the part is in the line that contains it."""
    code = error.failure.vendor_code if isinstance(error, PartError) else ""
    return {"error": type(error).__name__, "words": str(error), **({"vendor_code": code} if code else {})}


def error_from_json(document: dict[str, str]) -> RobotError:
    """Return the error decoded from JSON."""
    kind = _TYPES.get(document["error"], RobotError)
    if issubclass(kind, PartError):
        return kind(document["words"], document.get("part", ""), document.get("vendor_code", ""))
    return kind(document["words"]) if issubclass(kind, RobotError) else RobotError(document["words"])


TAPE_NAME = "readings.jsonl.gz"
LARGEST_ARRAY = 64 << 20
"""Maximum bytes of one array."""
SMALL_TAPE, MOST_TIMES = 64 << 20, 100
"""Characters to which any tape may decompress, and the largest ratio beyond that: readings compress by 2 to 20."""
MALFORMED = (ValueError, TypeError, LookupError, AttributeError, binascii.Error, zlib.error)
"""Exceptions that parsing an invalid line may raise."""


class ReplayError(ConnectionFailedError):
    """Raised for a recording that cannot be played; the message names the file and the line, if known."""


@dataclass
class Readings:
    """The readings of one method of one part: times, ascending, and the recorded lines with their values."""

    times: list[float] = field(default_factory=list)
    lines: list[dict[str, Any]] = field(default_factory=list)

    def at(self, moment: float, tolerance: float) -> tuple[float, dict[str, Any]]:
        """Return the newest reading at ``moment`` (plus ``tolerance`` seconds), or the first one if it is later."""
        index = max(0, bisect.bisect_right(self.times, moment + tolerance) - 1)
        return self.times[index], self.lines[index]

    def after(self, moment: float) -> float | None:
        """Return the time of the first reading after ``moment``."""
        index = bisect.bisect_right(self.times, moment)
        return self.times[index] if index < len(self.times) else None


@dataclass
class RecordedCommand:
    """A recorded command. ``arguments``, ``keywords``: decoded. ``refusal``: as JSON, None if it was accepted.

    ``end``: time and status at the end of its motion; None without a motion, or if it ran until the end of the
    recording.
    """

    time: float
    arguments: tuple[Any, ...]
    keywords: Mapping[str, Any]
    motion: int | None
    refusal: dict[str, Any] | None
    end: tuple[float, MotionStatus, Failure | None] | None = None


@dataclass(frozen=True)
class Tape:
    """A recording. ``parts``: name → kind and description. ``readings``, ``commands``: by part and method. Times are
    seconds of the robot's clock.

    ``cut``: whether its end is missing, as after a killed run.
    """

    robot: str
    start: float
    time_step: float
    end: float
    parts: Mapping[str, tuple[str, Mapping[str, Any]]]
    readings: Mapping[tuple[str, str], Readings]
    commands: Mapping[tuple[str, str], list[RecordedCommand]]
    cut: bool = False

    def stream_starts(self, key: tuple[str, str], pause: float) -> list[float]:
        """Return the times, seconds, at which streams of one command of one part began, after a pause of ``pause``
        seconds.
        """
        times = [command.time for command in self.commands.get(key, [])]
        return [time for before, time in zip([-math.inf, *times], times, strict=False) if time - before > pause]


def read_tape(path: Path) -> Tape:
    """Return the tape in a run folder, or a file. Raises ReplayError if it is missing or damaged.

    The recording of a killed run may end in mid-line: it is played up to there, and ``cut`` is set.
    """
    file = path / TAPE_NAME if path.is_dir() else path
    try:
        with gzip.open(file, "rt", encoding="utf-8") as stream:
            return _TapeReader(file).read(_bounded(stream, max(SMALL_TAPE, MOST_TIMES * file.stat().st_size)))
    except FileNotFoundError as error:
        raise ReplayError(f"{path} holds no readings; record a run with --record") from error
    except (OSError, EOFError, zlib.error, UnicodeDecodeError) as error:
        raise ReplayError(
            f"{file} is not a recording of a robot, or damaged: {type(error).__name__}: {error}"
        ) from error


def _bounded(stream: TextIO, most: int) -> Iterator[str]:
    """Yield the lines of a tape. Raises OSError if they unfold to more than ``most`` characters."""
    while line := stream.readline(most + 1):
        most -= len(line)
        if most < 0:
            raise OSError("it decompresses to more data than a recording of its size can contain")
        yield line


class _TapeReader:
    """Takes the lines of one file apart."""

    def __init__(self, file: Path) -> None:
        self._file = file
        self._readings: dict[tuple[str, str], Readings] = {}
        self._commands: dict[tuple[str, str], list[RecordedCommand]] = {}
        self._motions: dict[int, RecordedCommand] = {}
        self._cut = False

    def read(self, stream: Iterator[str]) -> Tape:
        robot, start, time_step, parts = self._header(next(stream, ""))
        end = start
        for number, text in self._following(stream):
            try:
                line = json.loads(text)
            except ValueError as error:
                if not text.endswith("\n"):
                    self._cut = True
                    break
                raise self._error(number, "is not JSON") from error
            try:
                moment = _number(line, "t")
                if "ended" not in line and line["part"] not in parts:
                    raise ValueError(f"the robot has no part {line['part']!r}")
                self._take(line, moment)
            except MALFORMED as error:
                raise self._error(number, f"is malformed: {type(error).__name__}: {error}") from error
            if moment < end:
                raise self._error(number, f"is of {moment:.4f} s, after one of {end:.4f} s: time goes back")
            end = moment
        return Tape(robot, start, time_step, end, parts, self._readings, self._commands, self._cut)

    def _header(self, text: str) -> tuple[str, float, float, dict[str, tuple[str, Mapping[str, Any]]]]:
        try:
            header = json.loads(text)
            parts: dict[str, tuple[str, Mapping[str, Any]]] = {
                str(name): (_kind(part), {what: from_json(value) for what, value in part["description"].items()})
                for name, part in header["parts"].items()
            }
            robot, start, time_step = str(header["robot"]), _number(header, "start"), _number(header, "time_step")
        except MALFORMED as error:
            words = f"is not a description of a robot: {type(error).__name__}: {error}"
            raise self._error(1, words) from error
        if time_step <= 0.0:
            raise self._error(1, f"gives a time step of {time_step} s; it should be above 0")
        return robot, start, time_step, parts

    def _following(self, stream: Iterator[str]) -> Iterator[tuple[int, str]]:
        """Yield number and text of the lines after the header."""
        number = 2
        while True:
            try:
                text = next(stream, None)
            except EOFError:  # the compressed data have no end
                self._cut = True
                return
            if text is None:
                return
            yield number, text
            number += 1

    def _take(self, line: dict[str, Any], moment: float) -> None:
        if "read" in line:
            if "value" not in line and "error" not in line:
                raise KeyError("value")
            column = self._readings.setdefault((line["part"], line["read"]), Readings())
            column.times.append(moment)
            column.lines.append(line)
        elif "command" in line:
            command = RecordedCommand(
                moment,
                tuple(from_json(line["arguments"])),
                {name: from_json(value) for name, value in line["keywords"].items()},
                line.get("motion"),
                line if "error" in line else None,
            )
            self._commands.setdefault((line["part"], line["command"]), []).append(command)
            if command.motion is not None:
                self._motions[command.motion] = command
        else:
            self._motions[line["ended"]].end = moment, from_json(line["status"]), from_json(line["why"])

    def _error(self, number: int, what: str) -> ReplayError:
        return ReplayError(f"{self._file}, line {number} {what}")


def _number(line: Any, key: str) -> float:
    value = line[key]
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
        raise ValueError(f"{key} is {value!r}; a finite number is possible")
    return float(value)


def _kind(part: Any) -> str:
    """Return the kind of a part, one of those of ``hal.api``."""
    kind = part["kind"]
    found = getattr(hal.api, kind, None)
    if not (isinstance(found, type) and issubclass(found, Part)):
        raise ValueError(f"no part is a {kind!r}")
    return str(kind)
