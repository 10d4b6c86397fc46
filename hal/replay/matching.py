"""Whether a command is the one that was recorded."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from bestman_bt.messages import JointTrajectory

POSITION_TOLERANCE = 0.05
"""Radians or metres by which targets may differ: motion planning may take another way, the place is the same."""


def same_target(asked: tuple[Any, ...], recorded: tuple[Any, ...]) -> bool:
    """Whether the first arguments of two commands, which say where to, agree; others (speeds, forces) may differ."""
    if not asked or not recorded:
        return len(asked) == len(recorded)
    return _near(_target(asked[0]), _target(recorded[0]))


def in_words(name: str, arguments: tuple[Any, ...], keywords: Mapping[str, Any]) -> str:
    """A command, for people."""
    told = [_short(value) for value in arguments] + [f"{key}={_short(value)}" for key, value in keywords.items()]
    return f"{name}({', '.join(told)})"


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
