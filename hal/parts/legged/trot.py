"""A trot: diagonal legs swing together, and the footholds follow the commanded speed.

M. Raibert, "Legged robots that balance", 1986: a foot set down half a stance ahead keeps the speed; a foothold shifted
along the speed error corrects it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bestman_bt.robot_model.model import LeggedBaseModel

# Kinematics of legs with three joints: a hip that turns about x, thigh and knee that turn about y; pure.
# All legs at once: joint angles, feet and forces are (n, 3), radians, metres and newtons in the frame of the trunk.


Array = NDArray[np.float64]


class LegKinematics:
    """Kinematics of a base's n legs with knees that bend backwards (negative angles) and spherical feet."""

    def __init__(self, base: LeggedBaseModel) -> None:
        legs = base.legs
        self.hips: Array = np.array([leg.hip for leg in legs])
        self._offset = np.array([leg.thigh_offset for leg in legs])
        self._thigh = np.array([leg.thigh_length for leg in legs])
        self._calf = np.array([leg.calf_length for leg in legs])
        self._radius = base.part.foot_radius

    def below_hips(self, height: float) -> Array:
        """Return the feet (n, 3), metres, with straight hips, ``height`` metres below the trunk."""
        feet = self.hips.copy()
        feet[:, 1] += self._offset
        feet[:, 2] = -height
        return feet

    def feet(self, angles: Array) -> Array:
        """Return the centres of the feet (n, 3), metres, for joint ``angles`` (n, 3): forward kinematics."""
        x, down = self._in_plane(angles)
        sine, cosine = np.sin(angles[:, 0]), np.cos(angles[:, 0])
        y, z = self._offset * cosine - down * sine, self._offset * sine + down * cosine
        return np.asarray(self.hips + np.column_stack([x, y, z]))

    def angles(self, feet: Array) -> Array:
        """Return the joint angles (n, 3) of ``feet`` (n, 3): inverse kinematics; unreachable feet are moved into
        reach.
        """
        x, y, z = (feet - self.hips).T
        down = -np.sqrt(np.maximum(y**2 + z**2 - self._offset**2, 1e-6))
        hip = np.arctan2(z, y) - np.arctan2(down, self._offset)
        hip = (hip + np.pi) % (2 * np.pi) - np.pi
        reach = (x**2 + down**2 - self._thigh**2 - self._calf**2) / (2.0 * self._thigh * self._calf)
        knee = -np.arccos(np.clip(reach, -0.95, 0.999))
        bent = np.arctan2(self._calf * np.sin(knee), self._thigh + self._calf * np.cos(knee))
        return np.column_stack([hip, np.arctan2(-x, -down) - bent, knee])

    def jacobians(self, angles: Array) -> Array:
        """Return the Jacobians of the feet by the joint angles, (n, 3, 3)."""
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
        """Return the velocities of the foot centres, (n, 3) m/s, when feet roll on the floor without slipping.

        ``speeds``: of the joints, (n, 3) rad/s; ``rate``: angular velocity of the trunk, ``up``: the vertical, both
        (3,) in its frame.
        """
        bending = speeds[:, 1] + speeds[:, 2]
        spins = np.column_stack([speeds[:, 0], bending * np.cos(angles[:, 0]), bending * np.sin(angles[:, 0])])
        return np.asarray(np.cross(spins + rate, up) * self._radius)

    def _in_plane(self, angles: Array) -> tuple[Array, Array]:
        """Return the positions of the feet along x, and along z before the hip turns."""
        thigh, lower = angles[:, 1], angles[:, 1] + angles[:, 2]
        x = -self._thigh * np.sin(thigh) - self._calf * np.sin(lower)
        return x, -self._thigh * np.cos(thigh) - self._calf * np.cos(lower)


OFFSETS = np.array([0.0, 0.5, 0.5, 0.0])
"""Phase offsets of the legs: front right, front left, rear right, rear left."""


@dataclass(eq=False)
class Trot:
    """Targets of the four feet in the trunk's level frame; standing until a velocity is commanded.

    ``nominal``: (4, 3) metres, the feet when standing. ``period``: of one step of all legs, seconds; ``duty``: fraction
    of it with a foot on the floor, above 0.5. ``clearance``: metres that feet are lifted. ``press``: metres below the
    floor at which a foot is set down, to ensure contact. ``velocity_gain``: seconds; shift of a foothold per speed
    error. ``longest_step``: largest horizontal distance of a foot from its hip, metres.
    """

    nominal: Array
    period: float = 0.3
    duty: float = 0.6
    clearance: float = 0.07
    press: float = 0.005
    velocity_gain: float = 0.06
    longest_step: float = 0.14

    def __post_init__(self) -> None:
        self.feet: Array = self.nominal.copy()
        self.stance: NDArray[np.bool_] = np.ones(4, bool)
        self.landed_for: Array = np.full(4, self.period)
        self._lifted_at: Array = self.nominal.copy()
        self._phase = 0.0
        self.walking = False

    def update(self, command: Array, velocity: Array, period: float) -> None:
        """Advance by ``period`` seconds; ``command``: vx, vy, wz (m/s, rad/s); ``velocity``: (2,), measured, m/s."""
        moving = bool(np.any(np.abs(command) > 1e-6))
        if moving and not self.walking:
            self.walking, self._phase = True, self.duty - 0.5  # both pairs stand, one is about to lift
        if not self.walking:
            return
        self._step(command, velocity, period)
        if not moving and self.stance.all():
            self.walking = False

    def _step(self, command: Array, velocity: Array, period: float) -> None:
        self._phase = (self._phase + period / self.period) % 1.0
        phases = (self._phase + OFFSETS) % 1.0
        stance = phases < self.duty
        lifting = self.stance & ~stance
        self._lifted_at[lifting] = self.feet[lifting]
        self.landed_for = np.where(stance, np.where(self.stance, self.landed_for + period, 0.0), 0.0)
        self.stance = stance
        ways = self._velocities_of_feet(command, self.feet)
        self.feet[stance, :2] -= ways[stance] * period
        self.feet[stance, 2] = self.nominal[stance, 2]
        share = (phases - self.duty) / (1.0 - self.duty)
        targets = self._touchdowns(command, velocity)
        for leg in np.flatnonzero(~stance):
            s = float(share[leg])
            eased = s - math.sin(2.0 * math.pi * s) / (2.0 * math.pi)  # a cycloid: at rest at both ends
            start = self._lifted_at[leg]
            self.feet[leg, :2] = start[:2] + eased * (targets[leg] - start[:2])
            lift = self.clearance * (1.0 - math.cos(2.0 * math.pi * s)) / 2.0
            self.feet[leg, 2] = self.nominal[leg, 2] + lift - self.press * eased

    def _touchdowns(self, command: Array, velocity: Array) -> Array:
        ahead = self._velocities_of_feet(command, self.nominal) * (self.duty * self.period / 2.0)
        offset = ahead + self.velocity_gain * (velocity - command[:2])
        length = np.linalg.norm(offset, axis=1, keepdims=True)
        return np.asarray(self.nominal[:, :2] + offset * np.minimum(1.0, self.longest_step / np.maximum(length, 1e-9)))

    @staticmethod
    def _velocities_of_feet(command: Array, feet: Array) -> Array:
        """Return the velocities of the foot positions as points of the trunk, (4, 2)."""
        vx, vy, wz = command
        return np.column_stack([vx - wz * feet[:, 1], vy + wz * feet[:, 0]])
