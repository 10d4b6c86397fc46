"""Tactile pads: whether and how something presses on them, and whether it slips."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hal.api import Tactile


@dataclass(eq=False)
class TactileSensor:
    """One pad of taxels, read as sensors of the DIGIT class are: a picture, and what can be told from it.

    ``pressed_force``: newtons in all above which a pad counts as pressed.

    ``full_scale``: newtons on one taxel that are white in the picture. ``slip_speed``: m/s above which what presses
    on the pad slips.
    """

    pad: Tactile
    pressed_force: float = 0.2
    full_scale: float = 2.0
    slip_speed: float = 0.003

    def __post_init__(self) -> None:
        self.name = self.pad.name

    def force(self) -> float:
        """Sum of the normal forces of all taxels, newtons."""
        return float(self.pad.read().pressure.sum())

    def pressed(self) -> bool:
        """Whether something touches the pad."""
        return self.force() > self.pressed_force

    def image(self) -> NDArray[np.uint8]:
        """The pressure as a grey picture, (rows, columns): 0 nothing, 255 ``full_scale`` or more."""
        shares = np.clip(self.pad.read().pressure / self.full_scale, 0.0, 1.0)
        return np.round(255 * shares).astype(np.uint8)

    def centre(self) -> NDArray[np.float64] | None:
        """Where on the picture the pressure is in the mean, (row, column) in taxels; None if nothing presses."""
        pressure = np.maximum(self.pad.read().pressure, 0.0)
        if pressure.sum() <= self.pressed_force:
            return None
        rows, columns = np.indices(pressure.shape)
        moments = np.array([(rows * pressure).sum(), (columns * pressure).sum()])
        return np.asarray(moments / pressure.sum())

    def slipping(self) -> bool:
        """Whether what presses on the pad slides over it."""
        reading = self.pad.read()
        pressed = reading.pressure.sum() > self.pressed_force
        return bool(pressed and np.hypot(*reading.sliding) > self.slip_speed)
