"""Going along with a door or drawer, for skills that want to know how far it came also where it failed."""

from __future__ import annotations

from typing import TYPE_CHECKING

from behaviours.skill import SkillFailure, StepsTo

if TYPE_CHECKING:
    from bestman_bt.control import Motion
    from bestman_bt.control.arm import FollowedMotion, FollowEnd

FOLLOWING_FAILS = {
    "locked": "it does not move at all: BelieveLocked, and take another one",
    "jammed": "it got stuck on the way: Close or Open it the other way, then again",
    "grip_lost": "the hand slipped off: FindLookStand, DetectHandle, then again",
    "obstacle": "something pushes the hand aside: look again, from another stand",
    "out_of_reach": "stand elsewhere: FindOpenStand or FindCloseStand, NavigateTo",
}
"""Failure codes of going along with a door or drawer; ``timeout`` is one of all skills."""


def error_code(end: FollowEnd, reached: str = "") -> str:
    """What skills report where a following failed, and where it ``reached`` its end and more was asked."""
    from bestman_bt.control.arm import FollowEnd

    codes = {
        FollowEnd.REACHED: reached,
        FollowEnd.LOCKED: "locked",
        FollowEnd.JAMMED: "jammed",
        FollowEnd.GRIP_LOST: "grip_lost",
        FollowEnd.OBSTACLE: "obstacle",
        FollowEnd.ARM_LIMIT: "out_of_reach",
        FollowEnd.TIMEOUT: "timeout",
    }
    return codes[end]


def followed(following: Motion[FollowedMotion]) -> StepsTo[tuple[FollowedMotion, SkillFailure | None]]:
    """The motion, and what ended it early; SkillFailure where there was none."""
    failure: SkillFailure | None = None
    try:
        yield following
    except SkillFailure as error:
        if following.result is None:
            raise
        failure = error
    assert following.result is not None
    return following.result, failure
