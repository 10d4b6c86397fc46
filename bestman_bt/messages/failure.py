"""The failure record, passed from the controller of a part to the result of a run."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum


class MotionErrorCode(StrEnum):
    """Error codes of a motion or of a controller's action that failed or was cancelled."""

    STOPPED = "stopped"  # the robot or the part was stopped
    SUPERSEDED = "superseded"  # a newer command took the part over
    CANCELED = "canceled"  # the one who asked for it cancelled it
    REFUSED = "refused"  # the part refused the command; nothing moved
    DECLINED = "declined"  # a person who was asked did not want it; nothing moved
    TRACKING = "tracking"  # the part did not follow within its tolerance
    BLOCKED = "blocked"  # commanded to move, but stalled
    LOST = "lost"  # the robot does not know well enough where it is
    TOLERANCE = "tolerance"  # it came to rest too far from the goal
    UNREACHABLE = "unreachable"  # the target is beyond the part's limits
    GUARDED = "guarded"  # a guard objected: what was to hold during the action no longer does
    OTHER_ARM_IN_THE_WAY = (
        "other_arm_in_the_way"  # another arm of the robot rests on its way, or moved there for too long
    )
    TIMEOUT = "timeout"  # the target was not reached in time
    COLLISION = "collision"  # a collision, or a protective stop of the controller
    DISCONNECTED = "disconnected"
    NO_DATA = "no_data"  # a sensor is silent or switched off
    FAULT = "fault"  # any other fault of the part


class MotionStage(StrEnum):
    """The stage at which a motion failed."""

    STAND = "base placement"
    REACH = "inverse kinematics"
    START = "start"
    GOAL = "goal"
    PATH = "path"
    TIMED_MOTION = "timed motion"
    EXECUTION = "execution"


@dataclass(frozen=True)
class MotionObstacle:
    """The cause of a failed motion: collision, joint limit or reach.

    ``pairs``: names of colliding bodies, the most important first. ``joint``: the joint at its limit, or away from its
    set-point. ``beyond``: the excess of that joint, or the distance by which the target is out of reach; radians or
    metres. ``positions``: joint name → radians or metres, the last configuration tried.
    """

    stage: MotionStage
    pairs: tuple[tuple[str, str], ...] = ()
    joint: str = ""
    beyond: float | None = None
    positions: Mapping[str, float] = field(default_factory=dict, hash=False)

    def __str__(self) -> str:
        """Return one sentence, such as ``path: panda_hand and table are in each other's way``."""
        if self.pairs:
            one, other = self.pairs[0]
            more = f", as are {len(self.pairs) - 1} other pairs" if len(self.pairs) > 1 else ""
            said = f"{one} and {other} are in each other's way{more}"
        elif self.joint:
            said = self.joint if self.beyond is None else f"{self.joint} is off by {self.beyond:.3f}"
        else:
            said = "no details are known" if self.beyond is None else f"out of reach by {self.beyond:.3f} m"
        return f"{self.stage}: {said}"


@dataclass(frozen=True)
class Failure:
    """A failure. ``code``: for programs, a MotionErrorCode or a code that a skill declares; ``text``: for people.

    ``part``: the name of the robot's part, or empty. ``vendor_code``: the vendor's own code, such as ``C31``.
    ``obstacle``: the cause of a failed motion, if known.
    """

    code: str
    text: str
    part: str = ""
    vendor_code: str = ""
    obstacle: MotionObstacle | None = None

    def __str__(self) -> str:
        """Return one sentence, such as ``arm: the joints are held (C31)``."""
        named = not self.part or self.text.startswith(self.part)
        words = self.text if named else f"{self.part}: {self.text}"
        code = f"({self.vendor_code})"
        return f"{words} {code}" if self.vendor_code and code not in words else words
