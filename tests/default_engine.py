"""The robot that tests simulate: in the default engine of this Python, so that together they hold for either."""

from __future__ import annotations

from bestman_bt.extras import DEFAULT_SIMULATOR
from bestman_bt.registry import DRIVERS
from hal.simulation.robot import SimulatedRobot

DefaultRobot: type[SimulatedRobot] = DRIVERS.resolve(DEFAULT_SIMULATOR)
