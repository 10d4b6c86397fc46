"""What every implementation of the Robotics API owes, as checks that any test runner can run.

``CHECKS`` get a connected robot that stands still with free space of 1 m around it and ``settle`` is called after
each. ``LIFE_CHECKS`` get a robot of their own that is not connected. A broken promise raises ConformanceError.
"""

from hal.conformance.clock_checks import CLOCK_CHECKS
from hal.conformance.life_checks import LIFE_CHECKS
from hal.conformance.limit_checks import LIMIT_CHECKS
from hal.conformance.motion_checks import MOTION_CHECKS
from hal.conformance.requirement import ConformanceError
from hal.conformance.stop_checks import STOP_CHECKS
from hal.conformance.subject import Check, settle

CHECKS = CLOCK_CHECKS + LIMIT_CHECKS + MOTION_CHECKS + STOP_CHECKS

__all__ = ["CHECKS", "LIFE_CHECKS", "Check", "ConformanceError", "settle"]
