"""The suite over the driver of the command line: ``pytest --pyargs hal.conformance --driver my_package:MyRobot``."""

from __future__ import annotations

import pytest

from hal.conformance.command_line import ROBOT_UNDER_TEST
from hal.conformance.promises import MakeRobot, PromisesAboutConnecting, PromisesOfAConnectedRobot


@pytest.fixture(scope="module")
def make_robot(pytestconfig: pytest.Config) -> MakeRobot:
    """Return a function that creates the robot given by the options."""
    return pytestconfig.stash[ROBOT_UNDER_TEST]


class TestConnecting(PromisesAboutConnecting):
    """Before, at the beginning and at the end of a connection."""


class TestConnected(PromisesOfAConnectedRobot):
    """Checks of a connected robot."""
