"""The numbers behind the simulation; docs/simulation.md tells what each of them cures."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class PhysicsParameters:
    """SI units. Rates are whole fractions of ``step_rate``: a control period is ``control_every`` physics steps.

    ``gripper_holding_force``: newtons at most with which fingers hold their width while nothing is asked of them.
    ``odometry_calibration``: standard deviation of the relative errors of the wheel radii and the track that odometry
    believes, drawn once from the robot's seed.
    ``object_sleep_speed``: objects that stay slower (m/s, rad/s) for two seconds are left out of the solver until
    something that moves touches them. ``contact_turn``: radians that a hand and what it holds turn until the contacts
    between them have been found afresh (see contact_refresh).
    """

    step_rate: float = 240.0
    solver_iterations: int = 50
    control_every: int = 4
    monitor_every: int = 4
    settle_time: float = 0.5

    joint_position_gain: float = 0.3
    joint_velocity_gain: float = 1.0

    gripper_holding_force: float = 40.0
    finger_stiffness: float = 3e5
    finger_damping: float = 1e4
    finger_spinning_friction: float = 0.02
    contact_turn: float = math.radians(20.0)
    finger_gear_force: float = 50.0
    finger_gear_erp: float = 0.1
    linkage_force: float = 1000.0
    linkage_erp: float = 0.5

    wheel_friction: float = 1.0
    wheel_hold_gain: float = 0.1
    caster_friction: float = 0.0
    floor_friction: float = 1.0
    odometry_calibration: float = 0.005

    object_spinning_friction: float = 0.01
    object_sleep_speed: float = 0.01
    initial_postures: tuple[str, ...] = ("carry", "home")

    @property
    def time_step(self) -> float:
        """Length of one physics step, seconds."""
        return 1.0 / self.step_rate

    @property
    def control_period(self) -> float:
        """Time between two set-points, seconds."""
        return self.control_every / self.step_rate
