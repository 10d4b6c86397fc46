"""A door that moves when the robot approaches: a scripted disturbance."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class MovingDoor:
    """``leaf``: ``furniture/name``. It moves ``to``, radians open, once the robot's middle is ``within`` metres of it.

    That is measured from the middle of the frame. ``speed``: rad/s. ``torque``: N m that it is pushed with at most,
    beyond the friction of its hinge.
    """

    leaf: str
    to: float
    within: float
    speed: float
    torque: float
