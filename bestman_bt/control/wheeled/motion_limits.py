"""The limits of a base as path followers want them."""

from __future__ import annotations

import numpy as np

from bestman_bt.navigation.global_planning import Footprint
from bestman_bt.navigation.local_planning import MotionLimits
from bestman_bt.robot_model import BaseModel
from hal.api import BaseDescription


def motion_limits(base: BaseDescription) -> MotionLimits:
    """What a path follower must know of a base."""
    return MotionLimits(
        vx=base.max_vx,
        vy=base.max_vy,
        wz=base.max_wz,
        acceleration=base.max_acceleration,
        angular_acceleration=base.max_angular_acceleration,
        jerk=base.max_jerk,
        angular_jerk=base.max_angular_jerk,
        footprint=footprint_of(base),
    )


def footprint_of(base: BaseDescription | BaseModel) -> Footprint:
    """What planners must know of the outline of a base."""
    return Footprint(np.array(base.footprint), base.turning_drift)
