"""Joint drives as a channel: position motors that interpolate at the physics rate, torques, encoders."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from bestman_bt.robot_model import JointedModel
from hal.parts import JointChannel, JointReading
from hal.simulation.parameters import SimulationParameters
from hal.simulation.sensor_pipeline import EncoderReading, Encoders
from hal.simulation.simulation import SimulatedChannel, Simulation

Array = NDArray[np.float64]


class JointMotors(SimulatedChannel, JointChannel):
    """The drives of one group of joints, and the ``encoders`` that programs read."""

    takes_efforts = True

    def __init__(
        self, name: str, model: JointedModel, parameters: SimulationParameters, rng: np.random.Generator
    ) -> None:
        self._model, self._parameters = model, parameters
        self.encoders = Encoders(name, model.part.encoders, parameters.step_rate, rng)
        self._indices: list[int] = []
        self._slots: NDArray[np.intp] = np.zeros(0, np.intp)
        self._sent_to: Array = np.zeros(0)
        self._step, self._steps_left = self._sent_to, 0  # of the physics, to the set-point
        self._torques: Array | None = None

    def attach(self, simulation: Simulation) -> None:
        """Hold where the joints are."""
        super().attach(simulation)
        self._indices = simulation.joints(self._model.joint_names)
        self._slots = simulation.slots(self._model.joint_names)
        self.encoders.attach(simulation, lambda: EncoderReading(self._measured(0), self._measured(1)))
        self._torques, self._steps_left, self._sent_to = None, 0, self._measured(0)
        self._drive(self._sent_to, np.zeros_like(self._sent_to))
        simulation.effort_controls += (self._interpolate, self._apply_torques)

    def detach(self) -> None:
        """Let go."""
        super().detach()
        self.encoders.detach()

    def read(self) -> JointReading:
        """What the drives know by encoders of their own."""
        return JointReading(*self.simulation.joint_states()[:, self._slots])

    def published(self) -> JointReading:
        """What the encoders tell, with their rate, latency, noise and faults; NoDataError where they tell nothing."""
        reading = self.encoders.read()
        return JointReading(reading.positions, reading.speeds, self.simulation.efforts()[self._slots])

    def send(self, positions: Array, velocities: Array) -> None:
        """One set-point, to be reached by the next control period: drives go there in steps of the physics.

        Steps at the control rate would shake what the hand holds, and it would work its way out of the fingers.
        """
        if self._torques is not None:
            self._torques = None
            self.simulation.torques[self._slots] = np.nan
            self._sent_to = self._measured(0)
        self._steps_left = self._parameters.control_every
        self._step = (positions - self._sent_to) / self._steps_left
        self._sent_to = positions

    def exert(self, efforts: Array) -> None:
        """Torques from the next step of the physics on."""
        simulation = self.simulation
        if self._torques is None:
            simulation.release(self._indices)
        self._torques, self._steps_left = efforts, 0
        simulation.torques[self._slots] = efforts

    def _interpolate(self) -> None:
        if self._steps_left:
            self._steps_left -= 1
            self._drive(self._sent_to - self._steps_left * self._step, self._step * self._parameters.step_rate)

    def _apply_torques(self) -> None:
        if self._torques is not None:
            self.simulation.engine.exert(self._indices, self._torques)

    def _drive(self, position: Array, velocity: Array) -> None:
        efforts, gain = self._model.effort.tolist(), self._parameters.joint_gain
        self.simulation.engine.track(self._indices, position, velocity, efforts, gain)

    def _measured(self, row: int) -> Array:
        values: Array = self.simulation.joint_states()[row, self._slots]
        return values
