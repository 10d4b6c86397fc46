"""Going on after a stop."""

from __future__ import annotations

from typing import ClassVar

from behaviours.skill import Skill, SkillFailure, Steps
from bestman_bt.engine import In
from bestman_bt.messages.shapes import Count, NonNegative


class ClearStop(Skill):
    """Clear the robot's stop, so that the tree can try again what the stop has ended; nothing moves by itself.

    It is meant for stops that a controller makes of its own accord: a lost connection, a program that has ended. A
    protective stop waits for a person (``bestman-bt robot release NAME``), a button is released at the robot. Who asks
    for a stop ends the run: it cannot be cleared from here.
    """

    attempts = In[int](Count, "how often it is tried", default=3)
    wait = In[float](NonNegative, "seconds between attempts: controllers want time", default=5.0)
    FAILS: ClassVar = {"still_stopped": "somebody has to look: the message says what stops the robot"}

    def execute(self) -> Steps:
        """Try, wait, try again; at once done where the robot is not stopped."""
        stop = self.skills.stop
        attempts, wait = self.attempts, self.wait
        if not stop.latched:
            self.feedback_message = "the robot was not stopped"
            return
        why = ""
        for attempt in range(attempts):
            if attempt:
                yield self.skills.computation.submit(lambda: None, wait)
            why = yield self.compute("clear_stop", stop.clear)
            if not why:
                self.feedback_message = f"cleared at attempt {attempt + 1}"
                return
        times = "once" if attempts == 1 else f"{attempts} times"
        raise SkillFailure("still_stopped", f"the robot stays stopped, tried {times}: {why}")
