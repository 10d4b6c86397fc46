"""Moves joints that are outside their configured range slowly back into it, under supervision."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hal.api import MotionStatus, Robot
from hal.parts.streamed_joints import StreamedJointGroup

SPEED = 0.05
"""Fraction of the joints' speed limits."""
MARGIN = 0.02
"""Distance of the final joint positions from the end of the range, radians or metres."""
POLL = 0.05


@dataclass(frozen=True, eq=False)
class ReturnMotion:
    """A motion of one part back into its joint range. ``joints``: its n joints, which move from ``here`` to ``there``,
    (n,) radians or metres each; those within the range stay.
    """

    part: str
    joints: tuple[str, ...]
    here: NDArray[np.float64]
    there: NDArray[np.float64]

    def __str__(self) -> str:
        """Return the joints and their ranges for display."""
        moved = zip(self.joints, self.here, self.there, strict=True)
        return ", ".join(f"{joint} from {here:.4f} to {there:.4f}" for joint, here, there in moved if here != there)


def admit_outside(robot: Robot) -> None:
    """Allow ``robot`` to connect with joints outside their range; call it before ``connect()``."""
    for part in robot.parts.values():
        if isinstance(part, StreamedJointGroup):
            part.comes_into_limits = True


def return_motions(robot: Robot) -> Iterator[ReturnMotion]:
    """Yield a motion for each part of a connected robot that has joints outside their range."""
    for name, part in robot.parts.items():
        if not isinstance(part, StreamedJointGroup):
            continue
        here, lower, upper = part.positions(), part.model.lower, part.model.upper
        outside = (here < lower) | (here > upper)
        if np.any(outside):
            margin = np.minimum(MARGIN, (upper - lower) / 2)
            yield ReturnMotion(
                name, part.joint_names, here, np.where(outside, np.clip(here, lower + margin, upper - margin), here)
            )


def execute_return(robot: Robot, way: ReturnMotion) -> str:
    """Execute the motion slowly; return why it did not arrive, or an empty text."""
    part = robot.part(way.part, StreamedJointGroup)
    motion = part.move_to(way.there, SPEED)
    while not motion.done:
        robot.clock.sleep(POLL)
    return "" if motion.status is MotionStatus.SUCCEEDED else str(motion.failure)
