"""The emergency stop of a robot: which stops can be cleared by a tree, and which cannot."""

from __future__ import annotations

from hal.api import Robot, RobotError

HELD = "this stop was requested by a person: it holds until the run has ended"


class RobotStop:
    """Reports whether the robot is stopped, and clears the stop unless a controller waits for a person.

    A stop requested by a person (``hold``) cannot be cleared here; it ends with the session.
    """

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        self._held = False

    def hold(self) -> None:
        """Stop the robot at a person's request; thread-safe and immediate."""
        self._held = True
        self._robot.stop()

    @property
    def latched(self) -> bool:
        """Whether the robot refuses commands until the stop is cleared."""
        return self._robot.stopped

    def clear(self) -> str:
        """Accept commands again, without starting a motion. Return why the robot remains stopped, or an empty text.

        A real robot reconnects lost connections, which takes seconds.
        """
        if self._held:
            return HELD
        try:
            self._robot.clear_stop()
        except RobotError as error:
            return str(error)
        if self._held:  # asked for meanwhile: it may be what was cleared, and there was no command yet
            self._robot.stop()
            return HELD
        return "it was stopped again immediately" if self._robot.stopped else ""
