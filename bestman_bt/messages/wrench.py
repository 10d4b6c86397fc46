"""Forces and torques."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages.frozen_array import frozen_array


@dataclass(frozen=True, eq=False)
class Wrench:
    """``force``: (3,) newtons, ``torque``: (3,) newton metres, in the sensor frame, at ``stamp`` seconds."""

    force: NDArray[np.float64]
    torque: NDArray[np.float64]
    stamp: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "force", frozen_array(self.force, (3,), "Wrench force"))
        object.__setattr__(self, "torque", frozen_array(self.torque, (3,), "Wrench torque"))
