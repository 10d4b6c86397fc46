"""Simulated bases on legs: joint torques at the physics rate, odometry from legs and inertial unit."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import Pose2D, Twist2D
from bestman_bt.robot_model import BaseModel, Payload
from hal.api import Imu, NoDataError, NotConnectedError
from hal.parts.legged import Walker, WalkerParameters
from hal.pybullet.mobile_base import SimulatedMobileBase
from hal.pybullet.package import pybullet
from hal.pybullet.parameters import PhysicsParameters
from hal.pybullet.simulation import Simulation

ARRIVED = 0.005
LEGS_CANNOT = {
    "velocities of a base lapse": "legs tell the mean over a step of 0.3 s, longer than the dead-man waits",
    "a base moves in its own frame": "legs sway: by up to 3 cm aside in the second after their first two steps",
    "a base drives and turns by odometry": "legs stop where feet land, within 2 cm, and wander by up to 4 cm in a turn",
    "a motion of a base can be cancelled": "legs sway for up to 0.7 s after cancel(), by up to 0.03 m/s or rad/s",
}
"""What of the Robotics API, or of its conformance checks, is not in the power of this walker → why."""


class SimulatedLeggedBase(SimulatedMobileBase):
    """A base that trots. It knows its joints and its inertial unit, nothing else. ``body``: of the whole robot.

    Without an inertial unit that delivers it takes itself for level, and may fall.
    """

    def __init__(
        self,
        name: str,
        model: BaseModel,
        parameters: PhysicsParameters,
        stopped: Callable[[], bool],
        imu: Imu,
        body: Payload,
        walking: WalkerParameters | None = None,
    ) -> None:
        super().__init__(name, model, parameters, stopped, ARRIVED, parameters.legged_stop_time)
        self._imu, self._body, self._walking = imu, body, walking or WalkerParameters()
        self._slots: NDArray[np.intp] = np.zeros(0, np.intp)
        self._indices: list[int] = []
        self._walker = self._new_walker()

    # Measurements

    def odometry(self) -> Pose2D:
        """Dead reckoning since connecting: paths from the feet on the floor, headings from the gyroscope."""
        self._update_odometry()
        return self._walker.odometry.pose

    def velocity(self) -> Twist2D:
        """Mean velocity over one step of all legs, by legs and gyroscope."""
        self._update_odometry()
        vx, vy, wz = self._walker.velocity
        return Twist2D(float(vx), float(vy), float(wz))

    # The simulation's side

    def attach(self, simulation: Simulation) -> None:
        """Stand, with odometry at zero."""
        self._connection.attach(simulation)
        self._slots = simulation.slots(self._model.joint_names)
        self._indices = simulation.indices(self._model.joint_names)
        self._walker = self._new_walker()
        # Bullet's own motors would work against the torques.
        simulation.client.setJointMotorControlArray(
            simulation.built.robot,
            self._indices,
            pybullet.VELOCITY_CONTROL,
            forces=[0.0] * len(self._indices),
        )
        self._begin(simulation)
        simulation.effort_controls.append(lambda: self._exert(simulation))

    def _exert(self, simulation: Simulation) -> None:
        angles, speeds, _ = simulation.joint_states()[:, self._slots]
        try:
            reading = self._imu.read()
            turning, force = reading.angular_velocity, reading.linear_acceleration
        except NoDataError:  # before its first reading, and where it is switched off
            turning, force = np.zeros(3), np.array([0.0, 0.0, 9.81])
        shape = (len(self._model.legs), 3)
        torques = self._walker.update(
            np.array(self._commanded),
            angles.reshape(shape),
            speeds.reshape(shape),
            turning,
            force,
            self._parameters.time_step,
        ).ravel()
        simulation.torques[self._slots] = torques
        simulation.client.setJointMotorControlArray(
            simulation.built.robot, self._indices, pybullet.TORQUE_CONTROL, forces=torques.tolist()
        )

    def _move(self, period: float) -> None:
        self._commanded = self._accelerated(period)

    def _rest(self, period: float) -> None:
        """It stands by itself."""

    def _new_walker(self) -> Walker:
        legs = self._model.legs
        height = self._model.stand_height - legs[0].foot_radius
        return Walker(legs, height, self._body, self._walking)

    @property
    def _heading(self) -> float:
        return self._walker.odometry.heading

    @property
    def _travelled(self) -> float:
        return self._walker.odometry.travelled

    def _update_odometry(self) -> None:
        if not self._connection.present:
            raise NotConnectedError(f"{self.name} was used while the robot is not connected; call connect()")
