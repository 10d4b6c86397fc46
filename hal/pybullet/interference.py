"""What a script does to the world of a run: the watchers do not take it for the robot's doing, and the run tells it."""

from __future__ import annotations

from dataclasses import dataclass, field

from hal.pybullet.honesty_record import Finding


@dataclass
class Interference:
    """``log``: what was done, each with its time. Only what is told there is forgiven.

    ``put_down``: objects that somebody has put elsewhere since the monitor's last look. ``slippery``: objects that have
    no friction at the moment. ``falling``: objects on their way out of the hand until they rest: what they hit, however
    hard, is none of the robot's doing. ``pushed``: body and joint of the doors and drawers that somebody has a hand at.
    """

    log: list[Finding] = field(default_factory=list)
    put_down: set[int] = field(default_factory=set)
    slippery: set[int] = field(default_factory=set)
    falling: set[int] = field(default_factory=set)
    pushed: set[tuple[int, int]] = field(default_factory=set)
