"""Odometry of a walking robot: feet on the floor roll and do not slip, so the trunk moves as the legs tell.

M. Bloesch et al., "State estimation for legged robots", 2012, without its filter: headings come from the gyroscope.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import Pose2D, wrap_angle

Array = NDArray[np.float64]


class LegOdometry:
    """Pose since the start in the plane, and the trunk's velocity (3,) m/s in its own level frame."""

    def __init__(self) -> None:
        self.x = self.y = self.travelled = 0.0
        self.heading = 0.0  # without end
        self.velocity: Array = np.zeros(3)

    @property
    def pose(self) -> Pose2D:
        """The pose in the odom frame."""
        return Pose2D(self.x, self.y, wrap_angle(self.heading))

    def update(self, velocities: Array, heading: float, period: float, smoothing: float) -> None:
        """``velocities``: of the trunk by what each foot on the floor tells, (k, 3) m/s; none: it flies on.

        ``smoothing``: seconds of the first-order low-pass over the velocity that the gait looks at.
        """
        before = self.velocity
        measured = velocities.mean(axis=0) if len(velocities) else before
        self.heading += wrap_angle(heading - self.heading)
        self.x += (measured[0] * math.cos(heading) - measured[1] * math.sin(heading)) * period
        self.y += (measured[0] * math.sin(heading) + measured[1] * math.cos(heading)) * period
        self.travelled += float(measured[0]) * period
        self.velocity = before + min(1.0, period / smoothing) * (measured - before)
