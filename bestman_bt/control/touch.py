"""Contact sensing of the hand: wrist readings without the hand's weight and the sensor's offset."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bestman_bt.control.joint_state import JointStateSensor
from bestman_bt.manipulation.kinematics.link_hulls import ForwardKinematics
from bestman_bt.messages import GRAVITY, Pose, Wrench
from bestman_bt.robot_model.payload import payload
from hal.api import Clock, ForceTorque, RobotError, Tactile, Timer


@dataclass(eq=False)
class TactileSensor:
    """One pad of taxels, read like sensors of the DIGIT class.

    ``pressed_force``: total newtons above which a pad counts as pressed. ``full_scale``: newtons per taxel shown as
    white. ``slip_speed``: m/s above which a contact slips.
    """

    pad: Tactile
    pressed_force: float = 0.2
    full_scale: float = 2.0
    slip_speed: float = 0.003

    def __post_init__(self) -> None:
        self.name = self.pad.name

    def force(self) -> float:
        """Return the sum of the normal forces of all taxels, newtons."""
        return float(self.pad.read().pressure.sum())

    def pressed(self) -> bool:
        """Return whether something touches the pad."""
        return self.force() > self.pressed_force

    def image(self) -> NDArray[np.uint8]:
        """Return the pressure as a grey image, (rows, columns) uint8: 0 none, 255 ``full_scale`` or more."""
        shares = np.clip(self.pad.read().pressure / self.full_scale, 0.0, 1.0)
        return np.round(255 * shares).astype(np.uint8)

    def centre(self) -> NDArray[np.float64] | None:
        """Return the centre of pressure on the picture, (row, column) in taxels, or None without contact."""
        pressure = np.maximum(self.pad.read().pressure, 0.0)
        if pressure.sum() <= self.pressed_force:
            return None
        rows, columns = np.indices(pressure.shape)
        moments = np.array([(rows * pressure).sum(), (columns * pressure).sum()])
        return np.asarray(moments / pressure.sum())

    def slipping(self) -> bool:
        """Return whether the contact slides over the pad."""
        reading = self.pad.read()
        pressed = reading.pressure.sum() > self.pressed_force
        return bool(pressed and np.hypot(*reading.sliding) > self.slip_speed)


@dataclass(eq=False)
class WristWrench:
    """Wrist wrenches without gravity, from forward kinematics and the URDF's masses, and without the sensor's offset.

    All wrenches are those of the world on the hand. Inertia is not removed: a hand of 1 kg that accelerates with 5 m/s²
    measures 5 N. ``tare_time``: seconds of readings for an offset. ``tare_period``: seconds between two of them.
    ``still``: newtons; readings that vary more than this give no offset.
    """

    sensor: ForceTorque
    kinematics: ForwardKinematics
    joints: JointStateSensor
    clock: Clock
    tare_time: float = 0.25
    tare_period: float = 1.0 / 60.0
    still: float = 1.5

    def __post_init__(self) -> None:
        self._payload = payload(self.kinematics.robot, self.sensor.frame)
        self.frame = self.sensor.frame
        self._offset: NDArray[np.float64] = np.zeros(6)
        self._tared = False
        self._readings: list[NDArray[np.float64]] = []
        self._timer: Timer | None = None

    @property
    def tared(self) -> bool:
        """Whether the offset is known."""
        return self._tared

    @property
    def taring(self) -> bool:
        """Whether the offset is being measured."""
        return self._timer is not None

    def tare(self) -> None:
        """Start measuring the offset: for ``tare_time`` seconds the arm must rest without contact.

        A held object counts as part of the offset. ``taring`` shows the end; if the hand was not still, the previous
        offset and ``tared`` are unchanged.
        """
        if self._timer is None:
            self._readings = []
            self._timer = self.clock.every(self.tare_period, self._gather)

    def contact(self) -> Wrench:
        """Return the contact wrench on the hand about the origin of ``frame``, in its axes."""
        reading = self.sensor.wrench()
        values = np.concatenate([reading.force, reading.torque]) - self._weight(self._base_from_sensor()) - self._offset
        return Wrench(values[:3], values[3:], reading.stamp)

    def contact_at(self, base_from_tool: Pose) -> Wrench:
        """Return the contact wrench about the origin of the tool, in the axes of the base."""
        wrench, base_from_sensor = self.contact(), self._base_from_sensor()
        force = base_from_sensor.rotation @ wrench.force
        torque = base_from_sensor.rotation @ wrench.torque
        torque = torque + np.cross(base_from_sensor.position - base_from_tool.position, force)
        return Wrench(force, torque, wrench.stamp)

    def hand_weight(self) -> NDArray[np.float64]:
        """Return the weight of the hand at its current pose, (3,) newtons, in the axes of ``frame``, from the model."""
        return self._weight(self._base_from_sensor())[:3]

    def _base_from_sensor(self) -> Pose:
        return self.kinematics.pose(self.sensor.frame, self.joints.positions())

    def _weight(self, base_from_sensor: Pose) -> NDArray[np.float64]:
        """Return the wrench of the hand's weight in the sensor's frame, (6,); the base stands level."""
        force = base_from_sensor.rotation.T @ np.array([0.0, 0.0, -self._payload.mass * GRAVITY])
        return np.concatenate([force, np.cross(self._payload.centre, force)])

    def _gather(self) -> None:
        try:
            reading = self.sensor.wrench()
        except RobotError:
            self._end_taring()  # who reads it next hears why
            return
        weight = self._weight(self._base_from_sensor())
        self._readings.append(np.concatenate([reading.force, reading.torque]) - weight)
        if len(self._readings) * self.tare_period >= self.tare_time:
            self._end_taring()
            readings = np.array(self._readings)
            if np.abs(readings - readings.mean(axis=0))[:, :3].max() <= self.still:
                self._offset, self._tared = readings.mean(axis=0), True

    def _end_taring(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
