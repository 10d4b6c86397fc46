"""Control of wheeled bases."""

from bestman_bt.control.wheeled.base_controller import BaseController, BaseControllerParameters
from bestman_bt.control.wheeled.collision_monitor import (
    CollisionMonitor,
    CollisionMonitorParameters,
    MonitorAction,
    MonitoredCommand,
)
from bestman_bt.control.wheeled.turning_slip import TurningSlip, TurningSlipParameters, measure_turning_slip

__all__ = [
    "BaseController",
    "BaseControllerParameters",
    "CollisionMonitor",
    "CollisionMonitorParameters",
    "MonitorAction",
    "MonitoredCommand",
    "TurningSlip",
    "TurningSlipParameters",
    "measure_turning_slip",
]
