"""Contact where none is expected: a hand that feels a force, or joints that lag behind their set-points."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bestman_bt.control.force_torque import WristWrench
from bestman_bt.messages import JointTrajectory
from hal.api import Arm, Clock


@dataclass(frozen=True)
class ContactLimits:
    """What counts as contact.

    ``force``: newtons that inertia of hand and load never reaches. ``lag``: radians behind the set-point.
    ``samples``: in a row that must agree. ``period``: seconds between two looks. ``latency``: seconds by which encoders
    follow set-points in undisturbed motion, at least; the arm's own may be longer.
    """

    force: float = 30.0
    lag: float = 0.04
    samples: int = 2
    period: float = 1.0 / 60.0
    latency: float = 0.02


class ContactMonitor:
    """Watches one free motion; ``objection`` is asked every ``period`` and has a text when something was touched.

    The force counts from what the wrist felt at the start, so that a held object's weight is no contact.
    """

    def __init__(
        self,
        arm: Arm,
        clock: Clock,
        wrist: WristWrench | None,
        trajectory: JointTrajectory | None = None,
        limits: ContactLimits = ContactLimits(),
    ) -> None:
        self._arm, self._clock, self._wrist, self._trajectory = arm, clock, wrist, trajectory
        self._limits = limits
        self._began = clock.now()
        self._initial = None if wrist is None else np.linalg.norm(wrist.contact().force)
        self._in_a_row = 0

    def objection(self) -> str | None:
        """What was touched, in words, or None."""
        found = self._force() or self._lag()
        self._in_a_row = self._in_a_row + 1 if found else 0
        return found if self._in_a_row >= self._limits.samples else None

    def _force(self) -> str | None:
        if self._wrist is None or self._initial is None:
            return None
        force = float(np.linalg.norm(self._wrist.contact().force) - self._initial)
        if force <= self._limits.force:
            return None
        return f"contact where none is expected: {force:.0f} N at the wrist"

    def _lag(self) -> str | None:
        if self._trajectory is None:
            return None
        p, passed = self._limits, self._arm.trajectory_time()
        if passed is None:
            passed = self._clock.now() - self._began
        latency = max(p.latency, self._arm.latency)
        now, before = (self._trajectory.sample(max(0.0, t))[0] for t in (passed, passed - latency))
        measured = self._arm.positions()
        # Anywhere between the two set-points is no lag.
        lag = np.maximum(np.minimum(now, before) - measured, measured - np.maximum(now, before))
        worst = int(np.argmax(lag))
        if lag[worst] <= p.lag:
            return None
        joint = self._arm.joint_names[worst]
        return f"contact where none is expected: {joint} is {lag[worst]:.3f} rad off its way"
