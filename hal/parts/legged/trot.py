"""A trot: diagonal legs swing together, feet are set down where the speed asks for.

M. Raibert, "Legged robots that balance", 1986: a foot set down half a stance ahead keeps the speed, one set down
further along the speed's error corrects it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
OFFSETS = np.array([0.0, 0.5, 0.5, 0.0])
"""Of the legs' phases: front right, front left, rear right, rear left."""


@dataclass(eq=False)
class Trot:
    """Where the four feet should be, in the trunk's level frame; standing until it is asked to walk.

    ``nominal``: (4, 3) metres, where the feet stand.

    ``period`` of a whole step of all legs, seconds; ``duty``: share of it that a foot is on the floor, above 0.5.

    ``clearance``: metres that feet are lifted. ``press``: metres that a foot is set down below the floor, so that it
    lands for sure. ``velocity_gain``: seconds; how far a foot goes along the error of the speed. ``longest_step``:
    metres that a foot may be away from below its hip.
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
        """Go on by ``period`` seconds; ``command``: vx, vy, wz; ``velocity``: (2,) as measured, m/s."""
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
        """Of the places where the feet are, as points of the trunk, (4, 2)."""
        vx, vy, wz = command
        return np.column_stack([vx - wz * feet[:, 1], vy + wz * feet[:, 0]])
