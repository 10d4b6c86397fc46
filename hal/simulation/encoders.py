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


class Encoders:
    """The encoders of one part. ``line.fault`` makes them fail; drives go on, they have encoders of their own."""

    def __init__(self, name: str, model: EncodersConfig, step_rate: float, rng: np.random.Generator) -> None:
        self._model, self._rng = model, rng
        rate, on_demand = model.rate or step_rate, model.rate is None
        line_name = f"{name} (encoders)"
        self.line: SensorPipeline[EncoderReading] = SensorPipeline(line_name, rate, model.latency, on_demand)

    def read(self) -> EncoderReading:
        """The latest reading; NotConnectedError, NoDataError."""
        return self.line.read()

    def attach(self, simulation: Simulation, take: Callable[[], EncoderReading]) -> None:
        """``take``: what the joints do now, without noise."""
        self.line.attach(simulation, lambda: self._measure(take()))

    def detach(self) -> None:
        """Let go."""
        self.line.detach()

    def _measure(self, true: EncoderReading) -> EncoderReading:
        model = self._model
        return EncoderReading(self._noisy(true.positions, model.noise), self._noisy(true.speeds, model.noise_speed))

    def _noisy(self, values: Array, deviation: float) -> Array:
        return values + deviation * self._rng.standard_normal(values.shape) if deviation else values
