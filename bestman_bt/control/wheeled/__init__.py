"""Control of wheeled bases."""

from bestman_bt.control.wheeled.base_controller import BaseController, Driving
from bestman_bt.control.wheeled.collision_monitor import (
    CollisionMonitor,
    MonitorAction,
    MonitoredCommand,
)
from bestman_bt.control.wheeled.localisation_cycle import LocalisationCycle, Localising
from bestman_bt.control.wheeled.turning_slip import TurningSlip, measure_turning_slip

__all__ = [
    "BaseController",
    "CollisionMonitor",
    "Driving",
    "LocalisationCycle",
    "Localising",
    "MonitorAction",
    "MonitoredCommand",
    "TurningSlip",
    "measure_turning_slip",
]
