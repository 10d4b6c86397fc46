"""Simulated batteries: consumption of the motors and remaining charge."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from bestman_bt.robot_model.sensor_parts import BatteryPart
from hal.api import Battery, BatteryReading
from hal.simulation.sensor_pipeline import SimulatedSensor
from hal.simulation.simulation import Simulation


class SimulatedBattery(SimulatedSensor[BatteryReading], Battery):
    """A battery discharged in every step by the power of electronics and motors; braking motors do not recover energy.

    A motor draws its mechanical power divided by the drives' efficiency, and the heat of its windings, proportional to
    its squared torque. Current and voltage are those of the mean power since the previous reading. ``fault``: makes
    readings fail.
    """

    def __init__(self, name: str, model: BatteryPart, rng: np.random.Generator) -> None:
        super().__init__(name, model.rate, model.latency)
        self._model, self._rng = model, rng
        self._energy = model.charge * model.capacity
        self._drawn = self._drawn_for = 0.0  # since the last reading, joules and seconds
        self._most: NDArray[np.float64] = np.zeros(0)

    def begin(self, simulation: Simulation) -> Callable[[], BatteryReading]:
        """Start with the charge of the description."""
        self._energy = self._model.charge * self._model.capacity
        self._drawn = self._drawn_for = 0.0
        most = simulation.built.max_efforts
        self._most = np.array([most[joint] or math.inf for joint in simulation.joints(simulation.joint_names)])
        simulation.step_observers.append(lambda: self._draw(simulation))
        return lambda: self._measure(simulation)

    def _draw(self, simulation: Simulation) -> None:
        model = self._model
        velocities, efforts = simulation.joint_states()[1], simulation.efforts()
        moving = np.maximum(velocities * efforts, 0.0).sum() / model.drive_efficiency
        holding = model.holding_power * ((efforts / self._most) ** 2).sum()
        step = simulation.parameters.time_step
        self._drawn += (model.idle_power + float(moving + holding)) * step
        self._drawn_for += step

    def _measure(self, simulation: Simulation) -> BatteryReading:
        model, power = self._model, self._drawn / self._drawn_for
        self._energy = max(0.0, self._energy - self._drawn)
        self._drawn = self._drawn_for = 0.0
        charge = self._energy / model.capacity
        unloaded = model.voltage_empty + (model.voltage_full - model.voltage_empty) * charge
        # A load of constant power P on a source with the resistance R: V² - V0 V + P R = 0.
        discriminant = unloaded**2 - 4.0 * power * model.internal_resistance
        voltage = (unloaded + math.sqrt(max(discriminant, 0.0))) / 2.0
        voltage_noise, charge_noise = self._rng.standard_normal(2) * (model.noise_voltage, model.noise_charge)
        return BatteryReading(
            charge=float(min(1.0, max(0.0, charge + charge_noise))),
            voltage=float(voltage + voltage_noise),
            current=power / voltage,
            charging=False,
            stamp=simulation.now,
        )
