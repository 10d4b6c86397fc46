"""What an expert showed in one episode."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bestman_bt.manipulation.policy.base import Observation


@dataclass(frozen=True, eq=False)
class Demonstration:
    """One episode of N chunks: what was seen before each, and the H actions that followed.

    ``chunks``: (N, H, n) joint deltas, radians; (N, H, n + 1) with the gripper: +1 open, -1 closed.
    """

    observations: tuple[Observation, ...]
    chunks: NDArray[np.float64]
