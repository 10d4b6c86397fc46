"""What controllers tell of themselves and of their arms, to be compared with the robot's file."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import Pose


@dataclass(frozen=True)
class Identity:
    """Which controller that is; empty where it does not tell."""

    model: str = ""
    serial_number: str = ""
    firmware: str = ""


@dataclass(frozen=True, eq=False)
class ArmFacts:
    """An arm as its controller knows it; None where that is not told. SI units.

    ``positions``: (n,) of the joints. ``tool_pose``: of the controller's tool at these positions, in the ``base_frame``
    of the robot's arm. ``tool_offset``: of that tool from the flange, the tip of the arm's part. ``joint_limits``:
    (n, 2). ``payload``: kg at the flange. ``gravity``: (3,), its direction in the ``base_frame``.
    """

    positions: NDArray[np.float64]
    tool_pose: Pose
    tool_offset: Pose | None = None
    joint_limits: NDArray[np.float64] | None = None
    payload: float | None = None
    gravity: NDArray[np.float64] | None = None
