"""Strips of a bumper along the footprint of a base."""

from __future__ import annotations

import itertools
import math

import numpy as np
from numpy.typing import NDArray

from bestman_bt.robot_model.model import BaseModel, WheeledBaseModel
from bestman_bt.robot_model.sensor_parts import BumperPart, MountedBumper


def mounted_bumper(bumper: BumperPart, base: BaseModel) -> MountedBumper:
    """Strips of equal length, counter-clockwise, from the front right corner on."""
    joints = base.part.driven_joints if isinstance(base, WheeledBaseModel) else ()
    corners = np.array(base.footprint)
    begin = int(np.argmin(np.abs(np.arctan2(corners[:, 1], corners[:, 0]) + math.pi / 4)))
    outline = np.vstack([np.roll(corners, -begin, axis=0), corners[begin]])
    lengths = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(outline, axis=0), axis=1)))
    marks = np.linspace(0.0, lengths[-1], bumper.zones + 1)
    ends = np.column_stack([np.interp(marks, lengths, outline[:, axis]) for axis in (0, 1)])
    zones = tuple((_pair(start), _pair(end)) for start, end in itertools.pairwise(ends))
    return MountedBumper(bumper, joints, zones)


def _pair(point: NDArray[np.float64]) -> tuple[float, float]:
    return round(float(point[0]), 4), round(float(point[1]), 4)
