"""Parameters of PyBullet's physics; docs/simulation.md explains each of them."""

from __future__ import annotations

from dataclasses import dataclass

from hal.simulation.parameters import SimulationParameters


@dataclass(frozen=True)
class PhysicsParameters(SimulationParameters):
    """Parameters of PyBullet.

    ``object_sleep_speed``: objects slower than this (m/s, rad/s) for two seconds are excluded from the solver until a
    moving body touches them. Stiffness in N/m, damping in N s/m, forces in N; ``erp``: fraction of an error corrected
    per step.
    """

    solver_iterations: int = 50
    joint_velocity_gain: float = 1.0
    finger_stiffness: float = 3e5
    finger_damping: float = 1e4
    finger_spinning_friction: float = 0.02
    finger_gear_force: float = 50.0
    finger_gear_erp: float = 0.1
    linkage_force: float = 1000.0
    linkage_erp: float = 0.5
    wheel_friction: float = 1.0
    caster_friction: float = 0.0
    floor_friction: float = 1.0
    object_spinning_friction: float = 0.01
    object_sleep_speed: float = 0.01
