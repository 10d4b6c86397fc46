"""Kinematics of legs with three joints: a hip that turns about x, thigh and knee that turn about y; pure.

All legs at once: joint angles, feet and forces are (n, 3), radians, metres and newtons in the frame of the trunk.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from bestman_bt.robot_model import LegModel

Array = NDArray[np.float64]


class LegKinematics:
    """Of n legs whose knees bend backwards (their angles are negative); feet are balls."""

    def __init__(self, legs: Sequence[LegModel]) -> None:
        self.hips: Array = np.array([leg.hip for leg in legs])
        self._offset = np.array([leg.thigh_offset for leg in legs])
        self._thigh = np.array([leg.thigh_length for leg in legs])
        self._calf = np.array([leg.calf_length for leg in legs])
        self._radius = np.array([leg.foot_radius for leg in legs])

    def below_hips(self, height: float) -> Array:
        """Where the feet stand with straight hips, ``height`` below the trunk."""
        feet = self.hips.copy()
        feet[:, 1] += self._offset
        feet[:, 2] = -height
        return feet

    def feet(self, angles: Array) -> Array:
        """Forward kinematics: the middles of the feet."""
        x, down = self._in_plane(angles)
        sine, cosine = np.sin(angles[:, 0]), np.cos(angles[:, 0])
        y, z = self._offset * cosine - down * sine, self._offset * sine + down * cosine
        return np.asarray(self.hips + np.column_stack([x, y, z]))

    def angles(self, feet: Array) -> Array:
        """Inverse kinematics; feet out of reach are taken back to where the legs reach them."""
        x, y, z = (feet - self.hips).T
        down = -np.sqrt(np.maximum(y**2 + z**2 - self._offset**2, 1e-6))
        hip = np.arctan2(z, y) - np.arctan2(down, self._offset)
        hip = (hip + np.pi) % (2 * np.pi) - np.pi
        reach = (x**2 + down**2 - self._thigh**2 - self._calf**2) / (2.0 * self._thigh * self._calf)
        knee = -np.arccos(np.clip(reach, -0.95, 0.999))
        bent = np.arctan2(self._calf * np.sin(knee), self._thigh + self._calf * np.cos(knee))
        return np.column_stack([hip, np.arctan2(-x, -down) - bent, knee])

    def jacobians(self, angles: Array) -> Array:
        """Of the feet by the joint angles, (n, 3, 3)."""
        x, down = self._in_plane(angles)
        lower = angles[:, 1] + angles[:, 2]
        calf_x, calf_down = -self._calf * np.sin(lower), -self._calf * np.cos(lower)
        sine, cosine = np.sin(angles[:, 0]), np.cos(angles[:, 0])
        jacobians = np.zeros((len(x), 3, 3))
        jacobians[:, 1, 0] = -self._offset * sine - down * cosine
        jacobians[:, 2, 0] = self._offset * cosine - down * sine
        for joint, (dx, ddown) in ((1, (down, -x)), (2, (calf_down, -calf_x))):
            jacobians[:, 0, joint] = dx
            jacobians[:, 1, joint], jacobians[:, 2, joint] = -ddown * sine, ddown * cosine
        return jacobians

    def rolling(self, angles: Array, speeds: Array, rate: Array, up: Array) -> Array:
        """How fast the middles of feet move that roll on the floor without slipping, (n, 3) m/s.

        ``speeds``: of the joints; ``rate``: of the trunk's turning, ``up``: the vertical, both (3,) in its frame.
        """
        bending = speeds[:, 1] + speeds[:, 2]
        spins = np.column_stack([speeds[:, 0], bending * np.cos(angles[:, 0]), bending * np.sin(angles[:, 0])])
        return np.asarray(np.cross(spins + rate, up) * self._radius[:, None])

    def _in_plane(self, angles: Array) -> tuple[Array, Array]:
        """Of the feet along x, and along z before the hip turns."""
        thigh, lower = angles[:, 1], angles[:, 1] + angles[:, 2]
        x = -self._thigh * np.sin(thigh) - self._calf * np.sin(lower)
        return x, -self._thigh * np.cos(thigh) - self._calf * np.cos(lower)
