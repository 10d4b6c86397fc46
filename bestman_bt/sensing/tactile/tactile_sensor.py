"""Tactile pads: whether something presses on them."""

from __future__ import annotations

from hal.api import Tactile

PRESSED = 0.2
"""Newtons in all above which a pad counts as pressed."""


class TactileSensor:
    """One pad of taxels."""

    def __init__(self, pad: Tactile) -> None:
        self._pad = pad

    @property
    def name(self) -> str:
        """The pad's name in its robot."""
        return self._pad.name

    def force(self) -> float:
        """Sum of the normal forces of all taxels, newtons."""
        return float(self._pad.read().sum())

    def pressed(self) -> bool:
        """Whether something touches the pad."""
        return self.force() > PRESSED
