"""Bring-up of a real robot: steps that pass or fail with figures, signed into a file beside the robot's."""

from bestman_bt.bringup.brought_up_robot import BroughtUpRobot
from bestman_bt.bringup.finding import Finding, StepResult
from bestman_bt.bringup.procedure import STEPS, Step, begun, bring_up, left, run_step

__all__ = ["STEPS", "BroughtUpRobot", "Finding", "Step", "StepResult", "begun", "bring_up", "left", "run_step"]
