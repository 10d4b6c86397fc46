"""The stop over all parts of a robot: who may clear it, and which one nobody may."""

from __future__ import annotations

from hal.api import Robot, RobotError

HELD = "somebody asked for this stop: it holds until the run has ended"


class RobotStop:
    """Tells whether the robot is stopped, and clears it: a controller that waits for a person stays stopped.

    A stop that a person asks for (``hold``) cannot be cleared here; it ends with the session that this belongs to.
    """

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        self._held = False

    def hold(self) -> None:
        """Stop the robot for somebody who asks for it; safe from any thread, at once in effect."""
        self._held = True
        self._robot.stop()

    @property
    def latched(self) -> bool:
        """Whether the robot refuses commands until the stop is cleared."""
        return self._robot.stopped

    def clear(self) -> str:
        """Accept commands again; nothing moves by itself. Empty, or why the robot stays stopped, in words.

        A real robot connects again what was lost, which takes seconds.
        """
        if self._held:
            return HELD
        try:
            self._robot.clear_stop()
        except RobotError as error:
            return str(error)
        if self._held:  # asked for meanwhile: it may be what was cleared, and nobody has commanded anything yet
            self._robot.stop()
            return HELD
        return "it was stopped again at once" if self._robot.stopped else ""
