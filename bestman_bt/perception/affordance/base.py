"""Affordances: where doors and drawers can be taken, and how they are likely to move."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np

from bestman_bt.messages import Handle
from bestman_bt.perception.segmentation.base import SupportPlane
from bestman_bt.perception.view import View


@dataclass(frozen=True, eq=False)
class HandleScene:
    """``handles``: most confident first. ``fronts``: the upright planes that were searched, largest first.

    ``reason``: in words, why there is nothing where there is nothing; else empty.
    """

    handles: tuple[Handle, ...]
    fronts: tuple[SupportPlane, ...]
    reason: str = ""


class HandleDetector(ABC):
    """Finds handles on upright fronts."""

    @abstractmethod
    def detect(self, view: View, rng: np.random.Generator) -> HandleScene:
        """All handles in ``view``, in its frame (z up). Equal input and generator state give equal output.

        Raises PerceptionError for an image that cannot be used (no depth at all, wrong shapes).
        """
