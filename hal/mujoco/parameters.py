"""The numbers behind MuJoCo's physics; docs/engines.md says what each of them is for."""

from __future__ import annotations

from dataclasses import dataclass

from hal.simulation.parameters import SimulationParameters


@dataclass(frozen=True)
class MujocoParameters(SimulationParameters):
    """``contact_time``: seconds in which an overlap is pushed out. ``friction_stiffness``: of friction, as a multiple
    of that of pressure (``impratio``): what is held creeps the less, the larger it is. ``gear_time``: seconds in which
    coupled fingers come together. ``support_friction``: of the furniture that the friction of objects is meant for:
    MuJoCo takes one of the two coefficients of a contact where Bullet takes their product. Spinning frictions: metres.
    ``wheel_armature``: inertia of a wheel's motor at the wheel, as a share of that of what the wheel drives. MuJoCo
    solves contacts without the stiffness of the servos: a wheel that is light beside its servo slides as on rollers.
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
    wheel_friction: float = 1.0
    floor_friction: float = 1.0
    link_friction: float = 0.5
