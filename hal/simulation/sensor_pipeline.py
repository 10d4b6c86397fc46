"""Simulated sensors and encoders: rate, latency, and failures."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from typing import Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from bestman_bt.robot_model.part_fields import EncodersConfig
from hal.api import NoDataError, NotConnectedError, Sensor
from hal.simulation.simulation import Simulation

Array = NDArray[np.float64]
Reading = TypeVar("Reading")


class SensorFault(Enum):
    """A sensor failure: no reading, or the last one repeated; a camera: black, or without depth."""

    SILENT = "silent"
    FROZEN = "frozen"
    BLACK = "black"
    NO_DEPTH = "no_depth"


class SensorPipeline(Generic[Reading]):
    """Provides readings: measured on request, or ``rate`` times a second and available ``latency`` seconds later.

    ``on_demand``: measure on request, unless there is a latency; a first reading is then taken at the start, at rest.
    ``fault``: set it to make the sensor fail, None to repair it.
    """

    def __init__(self, name: str, rate: float, latency: float = 0.0, on_demand: bool = False) -> None:
        self.name = self._part = name
        self._rate, self._latency = rate, latency
        self._on_demand = on_demand and latency == 0.0
        self._has_first = on_demand and latency > 0.0
        self._simulation: Simulation | None = None
        self._take: Callable[[], Reading] | None = None
        self._on_their_way: deque[tuple[float, Reading]] = deque()
        self._latest: Reading | None = None
        self._taken = 0
        self.fault: SensorFault | None = None

    def start(self, simulation: Simulation, take: Callable[[], Reading]) -> None:
        """Start measuring; ``take`` returns the current measurement."""
        self._simulation, self._take = simulation, take
        self._latest = take() if self._has_first else None
        self._on_their_way.clear()
        self._taken = self._periods(simulation.now)
        if not self._on_demand:
            simulation.step_observers.append(self._sample)

    def detach(self) -> None:
        """Disconnect from the simulation."""
        self._simulation = self._take = None

    def read(self) -> Reading:
        """Return the latest reading. Raises NotConnectedError, or NoDataError without a reading."""
        if self._simulation is None or self._take is None:
            raise NotConnectedError(
                f"{self.name} was used while the robot is not connected; call connect()", self._part
            )
        if self.fault is SensorFault.SILENT:
            raise NoDataError(f"{self.name} delivers no readings", self._part)
        if self.fault is not SensorFault.FROZEN or self._latest is None:
            self._receive(self._simulation.now, self._take)
        if self._latest is None:
            raise NoDataError(f"{self.name} has measured nothing yet", self._part)
        return self._latest

    def _receive(self, now: float, take: Callable[[], Reading]) -> None:
        if self._on_demand:
            self._latest = take()
        while self._on_their_way and self._on_their_way[0][0] <= now + 1e-9:
            self._latest = self._on_their_way.popleft()[1]

    def _sample(self) -> None:
        assert self._simulation is not None
        assert self._take is not None
        now = self._simulation.now
        if self._periods(now) == self._taken:
            return
        self._taken = self._periods(now)
        self._on_their_way.append((now + self._latency, self._take()))
        # Without readers, only the newest of those that have arrived is worth keeping.
        while len(self._on_their_way) > 1 and self._on_their_way[1][0] <= now:
            self._on_their_way.popleft()

    def _periods(self, now: float) -> int:
        return math.floor(now * self._rate + 1e-6)


class SimulatedSensor(SensorPipeline[Reading], Sensor):
    """A simulated sensor; a subclass defines its measurement in ``begin``. ``fault``: see SensorPipeline."""

    @abstractmethod
    def begin(self, simulation: Simulation) -> Callable[[], Reading]:
        """Return a function that measures; called when the world has been built and is at rest."""

    def attach(self, simulation: Simulation) -> None:
        """Start measuring in ``simulation``."""
        self.start(simulation, self.begin(simulation))


@dataclass(frozen=True, eq=False)
class EncoderReading:
    """Positions (n,), rad or m, and speeds (m,) of the same joints or of the first of them, per second."""

    positions: Array
    speeds: Array


class Encoders(SensorPipeline[EncoderReading]):
    """The encoders of one part. ``fault`` makes them fail; drives have separate encoders and continue."""

    def __init__(self, name: str, model: EncodersConfig, step_rate: float, rng: np.random.Generator) -> None:
        super().__init__(f"{name} (encoders)", model.rate or step_rate, model.latency, on_demand=model.rate is None)
        self._part, self._model, self._rng = name, model, rng

    def attach(self, simulation: Simulation, take: Callable[[], EncoderReading]) -> None:
        """Start measuring; ``take`` returns the joint state without noise."""
        self.start(simulation, lambda: self._measure(take()))

    def _measure(self, true: EncoderReading) -> EncoderReading:
        model = self._model
        return EncoderReading(self._noisy(true.positions, model.noise), self._noisy(true.speeds, model.noise_speed))

    def _noisy(self, values: Array, deviation: float) -> Array:
        return values + deviation * self._rng.standard_normal(values.shape) if deviation else values
