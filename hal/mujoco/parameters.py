"""Parameters of MuJoCo's physics; docs/engines.md explains each of them."""

from __future__ import annotations

from dataclasses import dataclass

from hal.simulation.parameters import SimulationParameters


@dataclass(frozen=True)
class MujocoParameters(SimulationParameters):
    """Parameters of MuJoCo.

    ``contact_time``: seconds in which an overlap is resolved. ``friction_stiffness``: stiffness of friction relative to
    pressure (``impratio``): larger values reduce creeping of held objects. ``gear_time``: time constant of coupled
    fingers, seconds. ``support_friction``: friction of the furniture for which the friction of objects is tuned: MuJoCo
    uses one of the two coefficients of a contact, Bullet their product. Spinning frictions: metres. ``wheel_armature``:
    inertia of a wheel's motor at the wheel, as a fraction of the inertia that the wheel drives. ``finger_armature``:
    inertia of the motor of a finger's joint, as a multiple of the inertia of the finger. MuJoCo solves contacts without
    the stiffness of the servos: a wheel that is light relative to its servo slips, a finger vibrates on a handle.
    """

    step_rate: float = 480.0
    control_every: int = 8
    monitor_every: int = 8
    solver_iterations: int = 50
    contact_time: float = 0.005
    friction_stiffness: float = 100.0
    gear_time: float = 0.005
    finger_spinning_friction: float = 0.02
    object_spinning_friction: float = 0.01
    support_friction: float = 0.8
    wheel_armature: float = 0.5
    finger_armature: float = 30.0
    wheel_friction: float = 1.0
    floor_friction: float = 1.0
    link_friction: float = 0.5
