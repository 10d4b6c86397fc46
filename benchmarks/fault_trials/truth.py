"""Where the robot of the twins truly is, and when it came to rest."""

from __future__ import annotations

import time

import numpy as np
from numpy.typing import NDArray

from hal.twins.process import TwinProcess

STILL = 5e-4
"""Radians or metres within ``WINDOW`` seconds."""
WINDOW = 0.05


def place(twin: TwinProcess) -> NDArray[np.float64]:
    """Joints of the arm, pose of the base, width of the hand."""
    base = twin.judge("base_pose")
    joints = twin.judge("joints", "arm")["positions"]
    return np.array([*joints, *base["position"], *base["quaternion"], twin.judge("width", "gripper")])


def moves(twin: TwinProcess, within: float) -> bool:
    """Whether it begins to move within so many seconds."""
    start, deadline = place(twin), time.monotonic() + within
    while np.max(np.abs(place(twin) - start)) < 0.05:
        if time.monotonic() > deadline:
            return False
        time.sleep(WINDOW)
    return True


def rests_at(twin: TwinProcess, within: float) -> float:
    """When, by the monotonic clock, it came to rest; infinity where it still moves after ``within`` seconds."""
    deadline = time.monotonic() + within
    at, before = time.monotonic(), place(twin)
    while time.monotonic() < deadline:
        time.sleep(WINDOW)
        now = time.monotonic(), place(twin)
        if np.max(np.abs(now[1] - before)) < STILL:
            return at
        at, before = now
    return float("inf")
