"""Time scaling of joint motions, to slow down and wait without leaving the path."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
MARGIN = 0.9
"""Fraction of the acceleration limits to use: the path's acceleration is known only from the previous step."""
STANDING = 1e-6
"""rad/s below which a joint does not limit the change of the scale."""


class TimeScale:
    """The scale of time, 0 to 1, for set-points.

    A path q(s) whose time passes at the rate r has the acceleration r² q'' + r' q': ``approach`` changes r as fast as
    the ``acceleration`` (n,) of the joints allows, as in online time scaling (Dahl and Nielsen, 1990).
    """

    def __init__(self, acceleration: Array) -> None:
        self._limit = MARGIN * acceleration
        self.rest(1.0)

    def rest(self, share: float) -> None:
        """Set the scale to ``share`` while the joints are at rest, where no acceleration limit applies."""
        self.share = share
        self._velocity: Array = np.zeros_like(self._limit)
        self._acceleration: Array = np.zeros_like(self._limit)

    def took(self, velocity: Array, dt: float) -> None:
        """Record that the set-points advanced by ``dt`` seconds of their time, to ``velocity`` (n,)."""
        self._velocity, self._acceleration = velocity, (velocity - self._velocity) / dt

    def approach(self, wanted: float, dt: float) -> float:
        """Return the scale for the next ``dt`` seconds, approaching ``wanted``."""
        if self.share != wanted:
            moving = np.abs(self._velocity) > STANDING
            speed = np.abs(self._velocity[moving])
            path = np.sign(self._velocity[moving]) * self.share**2 * self._acceleration[moving]
            most = np.min((self._limit[moving] - path) / speed, initial=np.inf)
            least = np.max((-self._limit[moving] - path) / speed, initial=-np.inf)
            change = float(np.clip(wanted - self.share, min(least, 0.0) * dt, max(most, 0.0) * dt))
            self.share = float(np.clip(self.share + change, 0.0, 1.0))
        return self.share
