"""Runs recorded at the Robotics API, and played back through it."""

from hal.replay.recorder import RecordedRobot
from hal.replay.robot import ReplayRobot
from hal.replay.tape import TAPE_NAME, ReplayError

__all__ = ["TAPE_NAME", "RecordedRobot", "ReplayError", "ReplayRobot"]
