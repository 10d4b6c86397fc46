"""How fast the time of a joint motion passes, so that it slows down and waits without leaving its path."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
MARGIN = 0.9
"""Share of the acceleration limits that is used: that of the path is known as of the step before."""
STANDING = 1e-6
"""rad/s below which a joint bounds no change of the scale."""


class TimeScale:
    """The share, 0 to 1, of real time that passes for set-points.

    A path q(s) whose time passes at the rate r has the acceleration r² q'' + r' q': ``approach`` changes r as fast as
    the ``acceleration`` (n,) of the joints allows, as online time scaling does (Dahl and Nielsen, 1990).
    """

    def __init__(self, acceleration: Array) -> None:
        self._limit = MARGIN * acceleration
        self.rest(1.0)

    def rest(self, share: float) -> None:
        """The joints rest: time may pass at any rate from now on."""
        self.share = share
        self._velocity: Array = np.zeros_like(self._limit)
        self._acceleration: Array = np.zeros_like(self._limit)

    def took(self, velocity: Array, dt: float) -> None:
        """The set-points went on by ``dt`` seconds of their own time, and have ``velocity`` (n,) by it now."""
        self._velocity, self._acceleration = velocity, (velocity - self._velocity) / dt

    def approach(self, wanted: float, dt: float) -> float:
        """The share for the next ``dt`` seconds, on the way to the ``wanted`` one."""
        if self.share != wanted:
            moving = np.abs(self._velocity) > STANDING
            speed = np.abs(self._velocity[moving])
            path = np.sign(self._velocity[moving]) * self.share**2 * self._acceleration[moving]
            most = np.min((self._limit[moving] - path) / speed, initial=np.inf)
            least = np.max((-self._limit[moving] - path) / speed, initial=-np.inf)
            change = float(np.clip(wanted - self.share, min(least, 0.0) * dt, max(most, 0.0) * dt))
            self.share = float(np.clip(self.share + change, 0.0, 1.0))
        return self.share
