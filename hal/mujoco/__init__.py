"""MuJoCo as an engine of the simulated robot: the same worlds, robots, sensors and audit as in PyBullet."""

from hal.mujoco.parameters import MujocoParameters
from hal.mujoco.robot import MujocoRobot

__all__ = ["MujocoParameters", "MujocoRobot"]
