"""Who came into whom where the robot touches somebody who walks."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hal.pybullet.observation import BodyState, Observation
from hal.pybullet.simulation import Contact

CLOSING = 0.02
"""Metres per second towards the other, just before they touch, from which on a contact is the robot's doing."""
PUSHING = 0.01
"""Metres towards the other, while they touch, from which on it is; what is shoved springs back by less."""
APART = 0.25
"""Seconds after which they have parted."""

Pair = tuple[int, int]  # a link of the robot and the other body


@dataclass
class _Touch:
    """``ours``: it is the robot's doing. ``way``: metres that it has moved towards the other, ``least`` so far."""

    ours: bool
    stamp: float
    way: float = 0.0
    least: float = 0.0


class ApproachWatcher:
    """Takes the contacts of a look one by one; the robot is judged by the motion of its body.

    The blow itself changes velocities, so what counts at the first touch is how they moved at the look before, 1/60 s
    ago. Later, what counts is how far the body has moved on towards the other.
    """

    def __init__(self, robot: int) -> None:
        self._robot = robot
        self._before: BodyState | None = None
        self._touches: dict[Pair, _Touch] = {}

    def take(self, contact: Contact, observation: Observation, period: float) -> None:
        """A contact between the robot and a walker, as pybullet tells it, whichever of them comes first."""
        _, body_a, body_b, link_a, link_b, on_a, _, normal_on_b, *_ = contact
        first = body_a == self._robot
        pair = (link_a, body_b) if first else (link_b, body_a)
        # From the robot to the other: pybullet's normal points from its second body to its first.
        towards = -np.array(normal_on_b) if first else np.array(normal_on_b)
        state = self._before or observation.bodies[self._robot]
        closing = _closing(state, np.array(on_a), towards)
        touch = self._touches.get(pair)
        if touch is None or observation.stamp - touch.stamp > APART:
            self._touches[pair] = _Touch(closing > CLOSING, observation.stamp)
            return
        if observation.stamp > touch.stamp:
            touch.way += closing * period
            touch.least = min(touch.least, touch.way)
            touch.ours = touch.ours or touch.way - touch.least > PUSHING
            touch.stamp = observation.stamp

    def ours(self, link: int, other: int) -> bool:
        """Whether the present contact of a link with ``other`` is the robot's doing."""
        touch = self._touches.get((link, other))
        return touch is None or touch.ours

    def look_ends(self, observation: Observation) -> None:
        """The next contacts belong to the next look."""
        self._before = observation.bodies[self._robot]


def _closing(state: BodyState, point: NDArray[np.float64], towards: NDArray[np.float64]) -> float:
    """Speed of a point of the robot's body towards the other, m/s."""
    return float(towards @ (np.array(state.linear) + np.cross(state.angular, point - np.array(state.position))))
