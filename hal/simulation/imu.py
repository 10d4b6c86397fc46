"""Simulated inertial measurement units."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import GRAVITY
from bestman_bt.robot_model.sensor_parts import ImuPart
from hal.api import Imu, ImuReading
from hal.simulation.guards import ReadPurpose
from hal.simulation.joint_motors import FrameTracker
from hal.simulation.sensor_pipeline import SimulatedSensor
from hal.simulation.simulation import Simulation

FREE_FALL = np.array([0.0, 0.0, -GRAVITY])


class SimulatedImu(SimulatedSensor[ImuReading], Imu):
    """An IMU that measures angular velocity and specific force at its rate, as means since the previous reading.

    Each axis has its own bias, drawn once, and normal noise. ``fault``: makes readings fail.
    """

    def __init__(self, name: str, model: ImuPart, rng: np.random.Generator) -> None:
        super().__init__(name, model.rate, model.latency)
        self.frame, self._model, self._rng = model.frame, model, rng
        self._deviations = np.repeat([model.noise_angular_velocity, model.noise_acceleration], 3)
        self._most = np.repeat([model.max_angular_velocity, model.max_acceleration], 3)
        bias = np.repeat([model.bias_angular_velocity, model.bias_acceleration], 3)
        self._bias = bias * rng.standard_normal(6)
        self._before: tuple[float, NDArray[np.float64]] | None = None

    def begin(self, simulation: Simulation) -> Callable[[], ImuReading]:
        """Return the mean motion since the reading before."""
        reader = simulation.reader(ReadPurpose.SENSOR)
        tracker = FrameTracker(simulation, reader, self._model.frame)
        self._before = None
        return lambda: self._measure(tracker, simulation.now)

    def _measure(self, tracker: FrameTracker, now: float) -> ImuReading:
        motion = tracker.look()
        acceleration = np.zeros(3)
        if self._before is not None:
            stamp, velocity = self._before
            acceleration = (motion.linear - velocity) / (now - stamp)
        self._before = now, motion.linear
        sensor_from_map = motion.pose.rotation.T
        true = np.concatenate([sensor_from_map @ motion.angular, sensor_from_map @ (acceleration - FREE_FALL)])
        values = true + self._bias + self._deviations * self._rng.standard_normal(6)
        values = np.clip(values, -self._most, self._most)
        return ImuReading(values[:3], values[3:], now)
