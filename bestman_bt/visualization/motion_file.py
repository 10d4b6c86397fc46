"""The poses of a run as a JSON Lines file, written during the run and read to render it later.

The first line names the joints and bodies, ``{"motion": 1, "joints": […], "bodies": […]}``. Each other line is a moment
and holds the changes since the line before: ``{"time": s, "tick": n, "base": [x, y, z, qx, qy, qz, qw],
"joints": {index: position}, "bodies": {index: pose}}``. Poses are in the map frame; metres, radians, seconds since the
first moment.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TextIO

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import Pose
from bestman_bt.visualization.errors import RecordingError
from bestman_bt.visualization.snapshot import RobotSnapshot

MOTION_NAME = "motion.jsonl"
VERSION = 1
MAX_BYTES = 32_000_000
"""Largest size of a file, bytes: hours of a run. Further moments are not written."""
MAX_VALUES = 20_000_000
"""Largest number of values that are read from a file."""
DECIMALS = 4
"""Decimals of metres, radians and quaternions: 0.1 mm."""


class MotionWriter:
    """Writes snapshots to ``path``; every moment has been passed to the operating system when ``write`` returns."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._file: TextIO | None = None
        self._joints: tuple[str, ...] = ()
        self._bodies: tuple[str, ...] = ()
        self._start = 0.0
        self._written = 0
        self._before: dict[str, list[list[float]]] = {}

    def write(self, snapshot: RobotSnapshot) -> None:
        """Add a moment; the first one decides on joints and bodies."""
        if self._file is None:
            self._joints, self._bodies = tuple(snapshot.joint_positions), tuple(snapshot.body_poses)
            self._start = snapshot.stamp
            self._file = self._path.open("w", encoding="utf-8", buffering=1)
            self._add({"motion": VERSION, "joints": self._joints, "bodies": self._bodies})
        line: dict[str, Any] = {"time": round(snapshot.stamp - self._start, 3), "tick": snapshot.tick}
        base = self._changed("base", [snapshot.map_from_base])
        if base:
            line["base"] = base[0]
        joints = self._changed_numbers([snapshot.joint_positions[name] for name in self._joints])
        bodies = self._changed("bodies", [snapshot.body_poses[name] for name in self._bodies])
        line |= {key: changed for key, changed in (("joints", joints), ("bodies", bodies)) if changed}
        self._add(line)

    def close(self) -> None:
        """End the file."""
        if self._file is not None:
            self._file.close()

    def _add(self, line: dict[str, Any]) -> None:
        text = json.dumps(line, separators=(",", ":")) + "\n"
        self._written += len(text)
        if self._file is not None and self._written <= MAX_BYTES:
            self._file.write(text)

    def _changed(self, key: str, poses: list[Pose]) -> dict[int, list[float]]:
        now = [[round(float(value), DECIMALS) for value in (*pose.position, *pose.quaternion)] for pose in poses]
        return self._differing(key, now)

    def _changed_numbers(self, values: list[float]) -> dict[int, float]:
        now = [[round(float(value), DECIMALS)] for value in values]
        return {index: value for index, (value,) in self._differing("joints", now).items()}

    def _differing(self, key: str, now: list[list[float]]) -> dict[int, list[float]]:
        before, self._before[key] = self._before.get(key), now
        return {i: value for i, value in enumerate(now) if before is None or value != before[i]}


@dataclass(frozen=True, eq=False)
class MotionRecord:
    """A run's moments.

    ``times``: (N,) seconds since the first, rising. ``ticks``: (N,). ``base``: (N, 7) position and quaternion xyzw,
    map_from_base. ``joint_positions``: (N, J) of ``joints``. ``body_poses``: (N, B, 7) of ``bodies``.
    """

    joints: tuple[str, ...]
    bodies: tuple[str, ...]
    times: NDArray[np.float64]
    ticks: NDArray[np.int64]
    base: NDArray[np.float64]
    joint_positions: NDArray[np.float64]
    body_poses: NDArray[np.float64]

    @property
    def duration(self) -> float:
        """Return the seconds from the first to the last moment."""
        return float(self.times[-1])

    def at(self, time: float) -> RobotSnapshot:
        """Return the state at ``time``, seconds, interpolated linearly and clamped to the first or last sample."""
        later = int(np.clip(np.searchsorted(self.times, time), 1, len(self.times) - 1)) if len(self.times) > 1 else 0
        earlier = max(later - 1, 0)
        span = self.times[later] - self.times[earlier]
        share = float(np.clip((time - self.times[earlier]) / span, 0.0, 1.0)) if span > 0 else 0.0
        joints = (1.0 - share) * self.joint_positions[earlier] + share * self.joint_positions[later]
        return RobotSnapshot(
            stamp=float(np.clip(time, 0.0, self.duration)),
            tick=int(self.ticks[later if share >= 1.0 else earlier]),
            map_from_base=_between(self.base[earlier], self.base[later], share),
            joint_positions=dict(zip(self.joints, map(float, joints), strict=True)),
            body_poses={
                name: _between(self.body_poses[earlier, i], self.body_poses[later, i], share)
                for i, name in enumerate(self.bodies)
            },
        )


def _between(before: NDArray[np.float64], after: NDArray[np.float64], share: float) -> Pose:
    """Interpolate linearly; a quaternion and its negative are the same rotation, and samples are so close that no slerp
    is needed.
    """
    sign = 1.0 if before[3:] @ after[3:] >= 0.0 else -1.0
    quaternion = (1.0 - share) * before[3:] + share * sign * after[3:]
    return Pose((1.0 - share) * before[:3] + share * after[:3], quaternion / np.linalg.norm(quaternion))


def read_motion(path: Path) -> MotionRecord:
    """Read a file; after a killed run, up to the last whole line. Raises RecordingError if it is damaged or not a
    motion file.
    """
    try:
        if path.stat().st_size > MAX_BYTES:
            raise RecordingError(f"{path} has {path.stat().st_size} bytes; at most {MAX_BYTES} are read")
        whole = path.read_bytes().rpartition(b"\n")[0].split(b"\n")
    except OSError as error:
        raise RecordingError(f"{path} cannot be read: {error.strerror}") from error
    number = 1
    try:
        joints, bodies = _names(json.loads(whole[0]))
        width = 9 + len(joints) + 7 * len(bodies)
        if len(whole) < 2:
            raise ValueError("it contains no moments")
        if width * len(whole) > MAX_VALUES:
            raise ValueError(f"{len(whole)} moments of {width} numbers each are too many")
        rows = np.empty((len(whole) - 1, width))
        row = np.full(width, np.nan)
        for number, line in enumerate(whole[1:], 2):
            _apply(row, json.loads(line), len(joints), len(bodies))
            rows[number - 2] = row
        _check(rows)
    except (ValueError, TypeError, KeyError, RecursionError) as error:
        raise RecordingError(f"{path}:{number}: no motion of a run: {error}") from error
    poses = 9 + len(joints)
    return MotionRecord(
        joints,
        bodies,
        rows[:, 0],
        rows[:, 1].astype(np.int64),
        rows[:, 2:9],
        rows[:, 9:poses],
        rows[:, poses:].reshape(len(rows), len(bodies), 7),
    )


def _names(head: Any) -> tuple[tuple[str, ...], tuple[str, ...]]:
    if not isinstance(head, Mapping) or head.get("motion") != VERSION:
        raise ValueError(f"the first line should begin with 'motion': {VERSION}")
    named = (tuple(head["joints"]), tuple(head["bodies"]))
    if any(not isinstance(name, str) for names in named for name in names):
        raise ValueError("the names of joints and bodies should be text")
    return named


def _apply(row: NDArray[np.float64], line: Any, joints: int, bodies: int) -> None:
    """Apply a line; ``row``: time, tick, base, joints, poses of bodies."""
    row[0], row[1] = float(line["time"]), int(line["tick"])
    if "base" in line:
        row[2:9] = _pose(line["base"])
    for index, value in line.get("joints", {}).items():
        row[9 + _index(index, joints, "joint")] = float(value)
    for index, pose in line.get("bodies", {}).items():
        start = 9 + joints + 7 * _index(index, bodies, "body")
        row[start : start + 7] = _pose(pose)


def _index(text: str, count: int, what: str) -> int:
    index = int(text)
    if not 0 <= index < count:
        raise ValueError(f"there is no {what} number {index}")
    return index


def _pose(values: Iterable[Any]) -> list[float]:
    pose = [float(value) for value in values]
    if len(pose) != 7 or not abs(math.hypot(*pose[3:]) - 1.0) < 1e-2:
        raise ValueError("a pose should be x, y, z and a unit quaternion")
    return pose


def _check(rows: NDArray[np.float64]) -> None:
    if not np.isfinite(rows).all():
        raise ValueError("a number is missing or not finite")
    if (np.diff(rows[:, 0]) < 0).any():
        raise ValueError("the time decreases")
