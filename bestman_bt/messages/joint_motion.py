"""How what hangs on a joint moves: the rigid motion of a door about its hinge, or of a drawer along its rail."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from bestman_bt.messages.handle import JointKind
from bestman_bt.messages.pose import Pose


def joint_motion(kind: JointKind, origin: ArrayLike, axis: ArrayLike, position: float) -> Pose:
    """Where the points of a closed leaf are when it is open by ``position``, radians or metres: frame_from_closed.

    ``origin``: (3,) metres, a point on the ``axis``, (3,) unit, both in that frame.
    """
    direction = np.asarray(axis, dtype=float)
    if kind == "prismatic":
        return Pose(position * direction)
    point = np.asarray(origin, dtype=float)
    turn = Pose(np.zeros(3), np.append(math.sin(position / 2) * direction, math.cos(position / 2)))
    return Pose(point) @ turn @ Pose(-point)
