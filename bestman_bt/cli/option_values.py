"""Checks of option values that typer does not do, their error, and the confirmation that ``--yes`` replaces."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

import typer

from bestman_bt.configuration.errors import ConfigurationError, Problem
from bestman_bt.configuration.quantity import parse_quantity

if TYPE_CHECKING:
    from bestman_bt.messages import Pose


def wrong_input(source: str, message: str) -> ConfigurationError:
    """Return the error for an option, or a file, that is wrong."""
    return ConfigurationError([Problem(source, None, "", message)])


def number(option: str, text: str, *dimensions: str, allow_zero: bool = False) -> float:
    """Return a quantity above 0 in SI units, such as ``5mm`` of the dimension ``length``. Raises ConfigurationError."""
    try:
        value = parse_quantity(text, *dimensions)
    except ValueError as error:
        raise wrong_input(option, str(error)) from error
    if value < 0.0 or (value == 0.0 and not allow_zero):
        raise wrong_input(option, f"should be {'0 or more' if allow_zero else 'more than 0'}, got {text}")
    return value


def pose(option: str, text: str) -> Pose:
    """Return the pose of ``x y z roll pitch yaw``, metres and radians. Raises ConfigurationError."""
    from bestman_bt.messages import Pose

    try:
        x, y, z, roll, pitch, yaw = (float(word) for word in text.replace(",", " ").split())
    except ValueError as error:
        message = f"should be six numbers, x y z in metres, roll pitch yaw in radians: {error}"
        raise wrong_input(f"{option} {text}", message) from error
    return Pose.from_xyz_rpy((x, y, z), (roll, pitch, yaw))


def confirmed(question: str) -> bool:
    """Ask ``question`` in the terminal and return whether the user agrees. Raises ConfigurationError without a
    terminal."""
    if not sys.stdin.isatty():
        raise wrong_input("--yes", "is required without a terminal, where no confirmation is possible")
    return typer.confirm(question, err=True)
