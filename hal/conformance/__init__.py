"""Conformance checks for implementations of the Robotics API.

``CHECKS`` receive a connected robot at rest with 1 m of free space around it, and ``settle`` is called after each.
``LIFE_CHECKS`` each receive a new robot that is not connected. A violated requirement raises ConformanceError.
``Check.why_not`` returns why a check does not apply to a robot, based on the features that it declares.

Run them with pytest, on any driver: ``pytest --pyargs hal.conformance --driver my_package:MyRobot``.
"""

from hal.conformance.base_checks import BASE_CHECKS
from hal.conformance.clock_checks import CLOCK_CHECKS
from hal.conformance.connection_checks import CONNECTION_CHECKS
from hal.conformance.description_checks import DESCRIPTION_CHECKS
from hal.conformance.limit_checks import LIMIT_CHECKS
from hal.conformance.motion_checks import GRIPPER_CHECKS, MOTION_CHECKS
from hal.conformance.sensor_checks import SENSOR_CHECKS
from hal.conformance.stop_checks import STOP_CHECKS
from hal.conformance.subject import COMMANDS, Check, ConformanceError, settle

CHECKS = CLOCK_CHECKS + SENSOR_CHECKS + LIMIT_CHECKS + MOTION_CHECKS + GRIPPER_CHECKS + BASE_CHECKS + STOP_CHECKS
LIFE_CHECKS = DESCRIPTION_CHECKS + CONNECTION_CHECKS

__all__ = ["CHECKS", "COMMANDS", "LIFE_CHECKS", "Check", "ConformanceError", "settle"]
