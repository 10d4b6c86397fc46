"""Simulated encoders: what a robot tells of its joints and wheels, with their rate, latency, noise and faults."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bestman_bt.robot_model import EncodersConfig
from hal.simulation.sensor_pipeline import SensorPipeline
from hal.simulation.simulation import Simulation

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class EncoderReading:
    """Positions (n,), rad or m, and speeds (m,) of the same joints or of the first of them, per second."""

    positions: Array
    speeds: Array


class Encoders(SensorPipeline[EncoderReading]):
    """The encoders of one part. ``fault`` makes them fail; drives go on, they have encoders of their own."""

    def __init__(self, name: str, model: EncodersConfig, step_rate: float, rng: np.random.Generator) -> None:
        super().__init__(f"{name} (encoders)", model.rate or step_rate, model.latency, on_demand=model.rate is None)
        self._model, self._rng = model, rng

    def attach(self, simulation: Simulation, take: Callable[[], EncoderReading]) -> None:
        """``take``: what the joints do now, without noise."""
        self.start(simulation, lambda: self._measure(take()))

    def _measure(self, true: EncoderReading) -> EncoderReading:
        model = self._model
        return EncoderReading(self._noisy(true.positions, model.noise), self._noisy(true.speeds, model.noise_speed))

    def _noisy(self, values: Array, deviation: float) -> Array:
        return values + deviation * self._rng.standard_normal(values.shape) if deviation else values
