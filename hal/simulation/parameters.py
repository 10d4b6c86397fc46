"""Parameters of a simulated robot for all engines; docs/simulation.md explains each of them."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class SimulationParameters:
    """Parameters of the simulation, SI units. A control period is ``control_every`` physics steps of 1 / ``step_rate``
    s.

    ``joint_gain``, ``wheel_hold_gain``, ``steering_gain``: see ``Engine.track``. ``stream_reserve``: see ``Tracking``.
    ``gripper_holding_force``: maximum force with which idle fingers hold their width, newtons.
    ``odometry_calibration``: standard deviation of the relative errors of the wheel radii and the track in odometry,
    drawn once from the robot's seed. ``contact_turn``: rotation of a hand with its object, radians, within which their
    contacts are refreshed (see ``ContactRefresh``).
    """

    step_rate: float = 240.0
    control_every: int = 4
    monitor_every: int = 4
    settle_time: float = 0.5
    joint_gain: float = 0.3
    wheel_hold_gain: float = 0.1
    steering_gain: float = 0.3
    gripper_holding_force: float = 40.0
    stream_reserve: float = 1.0
    contact_turn: float = math.radians(20.0)
    odometry_calibration: float = 0.005
    initial_postures: tuple[str, ...] = ("carry", "home")

    @property
    def time_step(self) -> float:
        """Length of one physics step, seconds."""
        return 1.0 / self.step_rate

    @property
    def control_period(self) -> float:
        """Time between two set-points, seconds."""
        return self.control_every / self.step_rate
