"""Recovery from a stop."""

from __future__ import annotations

from typing import ClassVar

from behaviours.skill import Skill, SkillCoroutine, SkillFailure
from bestman_bt.engine import In
from bestman_bt.messages.shapes import Count, NonNegative


class ClearStop(Skill):
    """Clear the robot's stop, so that the tree can retry interrupted actions; no motion is started.

    Meant for stops caused by a controller: a lost connection, a program that has ended. A protective stop waits for a
    person (``bestman-bt robot release NAME``), an emergency button is released at the robot. A stop requested by a
    person ends the run and cannot be cleared from here.
    """

    attempts = In[int](Count, "number of attempts", default=3)
    wait = In[float](NonNegative, "seconds between attempts, for the controllers to recover", default=5.0)
    FAILS: ClassVar = {"still_stopped": "a person has to check the robot: the message gives the cause of the stop"}

    def execute(self) -> SkillCoroutine[None]:
        """Try to clear the stop, with waits in between; succeed immediately if the robot is not stopped."""
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
        tried = "1 attempt" if attempts == 1 else f"{attempts} attempts"
        raise SkillFailure("still_stopped", f"the robot is still stopped after {tried}: {why}")
