"""Small motions, mainly for recovery: Spin, BackUp, DriveOnHeading, Wait; the Cancel… nodes, which end a motion."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Annotated, ClassVar

from annotated_types import Ge, Le

from behaviours.computation import Until
from behaviours.nav2.ports import SERVER, Nav2Errors, are_literals, without_meaning
from behaviours.skill import InstantSkill, Skill, SkillCoroutine, SkillFailure
from bestman_bt.engine import RUNNING, In, NotZero
from bestman_bt.messages.shapes import NonNegative
from bestman_bt.world_model.world_model import BasePose

if TYPE_CHECKING:
    from bestman_bt.control import Motion

TURN_AT_ONCE = math.pi / 2
"""Largest single turn, radians; longer turns are split, because a base turns within ±pi."""
Turns = Annotated[float, Ge(-100.0), Le(100.0)]
"""Radians: at most sixteen turns; larger values are probably in another unit."""
Moving = Annotated[float, NotZero()]
"""Metres or m/s, not 0."""
COLLISION_CHECKS = without_meaning("disable_collision_checks")
"""The collision monitor is always active."""


class _Motion(Nav2Errors, Skill):
    """A motion that may take no longer than ``time_allowance``."""

    INPUT_PORTS: ClassVar = {**SERVER, **COLLISION_CHECKS}
    time_allowance = In(float, "seconds, then it fails as timeout; 0 or less: no limit", default=10.0)
    FAILS: ClassVar = {"timeout": "retry with more time_allowance"}

    def in_time(self, motion: Motion[BasePose], end: float) -> SkillCoroutine[None]:
        """Wait for a motion, until ``end`` seconds at most."""
        yield Until(lambda: self.skills.clock.now() >= end, motion)
        if not motion.done:
            motion.cancel()
            raise SkillFailure("timeout", f"not done within {self.time_allowance:g} s")
        yield motion

    def end(self) -> float:
        """Return the time at which the motion times out, seconds."""
        allowed = self.time_allowance
        return self.skills.clock.now() + allowed if allowed > 0.0 else math.inf


class Spin(_Motion):
    """Turn in place by odometry, which also works while the base is not localised."""

    REQUIRES = ("base", "lidar")
    INPUT_PORTS: ClassVar = {**without_meaning("is_recovery")}
    spin_dist = In[float](Turns, "radians, to the left", default=1.57)

    def execute(self) -> SkillCoroutine[None]:
        """Turn in steps of at most 90°."""
        left, end = self.spin_dist, self.end()
        while left:
            step = math.copysign(min(abs(left), TURN_AT_ONCE), left)
            yield from self.in_time(self.skills.base.turn(step), end)
            left -= step


class DriveOnHeading(_Motion):
    """Drive straight on; the collision monitor stops the base before obstacles, which ends the action as blocked."""

    REQUIRES = ("base", "lidar")
    dist_to_travel = In[float](Moving, "metres, backwards where it is negative", default=0.15)
    speed = In[float](Moving, "m/s, of the distance's sign", default=0.025)

    def on_load(self) -> None:
        """Check the signs if both ports are literals. Raises ValueError."""
        if are_literals(self, "dist_to_travel", "speed") and (words := self._of_two_signs()):
            raise ValueError(words)

    def _of_two_signs(self) -> str:
        """Return the fault if distance and speed have opposite signs, else an empty text."""
        distance, speed = self.dist_to_travel, self.speed
        if distance * speed > 0.0:
            return ""
        return f"dist_to_travel is {distance} m and speed {speed} m/s; they should have the same sign"

    def execute(self) -> SkillCoroutine[None]:
        """Drive the distance."""
        if words := self._of_two_signs():
            raise SkillFailure("bad_input", words)
        distance, speed = self.dist_to_travel, abs(self.speed)
        yield from self.in_time(self.skills.base.drive(distance, speed), self.end())


class BackUp(_Motion):
    """Drive straight back."""

    REQUIRES = ("base", "lidar")
    backup_dist = In[float](Moving, "metres", default=0.15)
    backup_speed = In[float](Moving, "m/s", default=0.025)

    def execute(self) -> SkillCoroutine[None]:
        """Drive the distance."""
        distance, speed = abs(self.backup_dist), abs(self.backup_speed)
        yield from self.in_time(self.skills.base.drive(-distance, speed), self.end())


class Wait(Nav2Errors, Skill):
    """Wait for a duration."""

    INPUT_PORTS: ClassVar = {**SERVER}
    wait_duration = In[float](NonNegative, "seconds", default=1.0)

    def execute(self) -> SkillCoroutine[None]:
        """Wait for the duration."""
        duration = self.wait_duration
        yield self.skills.computation.submit(lambda: None, duration)


class _Cancel(InstantSkill):
    """Cancel the motions of all running leaves of a kind in the tree; SUCCESS also if there are none."""

    INPUT_PORTS: ClassVar = {**SERVER}
    LEAVES: ClassVar[tuple[str, ...]] = ()

    def act(self) -> None:
        """Cancel."""
        for node in self.owner.nodes:
            if isinstance(node, Skill) and node.state == RUNNING and node.type_id in self.LEAVES:
                node.cancel()
                self.feedback_message = f"{node.path} is cancelled"


class CancelControl(_Cancel):
    """Cancel FollowPath."""

    LEAVES: ClassVar = ("FollowPath",)


class CancelBackUp(_Cancel):
    """Cancel BackUp."""

    LEAVES: ClassVar = ("BackUp",)


class CancelDriveOnHeading(_Cancel):
    """Cancel DriveOnHeading."""

    LEAVES: ClassVar = ("DriveOnHeading",)


class CancelSpin(_Cancel):
    """Cancel Spin."""

    LEAVES: ClassVar = ("Spin",)


class CancelWait(_Cancel):
    """Cancel Wait."""

    LEAVES: ClassVar = ("Wait",)


class CancelAssistedTeleop(_Cancel):
    """Do nothing: teleoperation is not supported."""


class CancelComputeAndTrackRoute(_Cancel):
    """Do nothing: route tracking is not supported."""


class CancelFollowObject(_Cancel):
    """Do nothing: following objects is not supported."""
