"""What the channels to simulated actuators share: the simulation that they act in."""

from __future__ import annotations

from hal.api import NotConnectedError
from hal.pybullet.simulation import Simulation


class SimulatedChannel:
    """A channel of ``hal.parts`` that is attached to a running simulation while the robot is connected."""

    _attached_to: Simulation | None = None

    @property
    def simulation(self) -> Simulation:
        """The running simulation; NotConnectedError without one."""
        if self._attached_to is None:
            raise NotConnectedError("the robot is not connected; call connect()")
        return self._attached_to

    def attach(self, simulation: Simulation) -> None:
        """Act in a running simulation from now on; the actuator holds where it is."""
        self._attached_to = simulation

    def detach(self) -> None:
        """Let go of the simulation; idempotent."""
        self._attached_to = None
