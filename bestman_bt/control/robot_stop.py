"""The stop over all parts of a robot, for those who may clear it."""

from __future__ import annotations

from hal.api import Robot, RobotError


class RobotStop:
    """Tells whether the robot is stopped, and clears it: where a controller stopped by itself, that unlocks it."""

    def __init__(self, robot: Robot) -> None:
        self._robot = robot

    @property
    def latched(self) -> bool:
        """Whether the robot refuses commands until the stop is cleared."""
        return self._robot.stopped

    def clear(self) -> str:
        """Accept commands again; nothing moves by itself. Empty, or why the robot stays stopped, in words.

        A real robot connects again what was lost and unlocks its controllers, which takes seconds.
        """
        try:
            self._robot.clear_stop()
        except RobotError as error:
            return str(error)
        return "it was stopped again at once" if self._robot.stopped else ""
