"""The walking controller: from a velocity to joint torques, and from joints and inertial unit to odometry."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from bestman_bt.messages import GRAVITY, Pose2D, wrap_angle
from bestman_bt.robot_model.model import LeggedBaseModel
from bestman_bt.robot_model.payload import Payload
from hal.parts.legged.trot import LegKinematics, Trot

# Attitude from an inertial unit: a complementary filter.
# R. Mahony, T. Hamel and J.-M. Pflimlin, "Nonlinear complementary filters on the special orthogonal group", 2008: the
# gyroscope turns the estimate, the direction of gravity pulls it upright; what is left over at rest is the gyroscope's
# bias.


Array = NDArray[np.float64]


@dataclass(eq=False)
class Attitude:
    """Estimates the trunk's orientation; its heading starts at 0 and drifts with the gyroscope.

    ``gain``: rate at which gravity corrects the tilt, 1/s. ``bias_time``: time constant of the bias estimate at rest,
    that is, at rates below ``still`` rad/s, seconds.
    """

    gain: float = 0.3
    bias_time: float = 2.0
    still: float = 0.03

    def __post_init__(self) -> None:
        self._rotation = Rotation.identity()
        self._bias = np.zeros(3)
        self.rate: Array = np.zeros(3)

    @property
    def odom_from_trunk(self) -> Array:
        """The rotation odom_from_trunk, (3, 3)."""
        return np.asarray(self._rotation.as_matrix())

    @property
    def heading(self) -> float:
        """Yaw, radians in (-π, π]."""
        forward = self.odom_from_trunk[:, 0]
        return math.atan2(forward[1], forward[0])

    @property
    def level_from_trunk(self) -> Array:
        """Return the rotation matrix (3, 3) to the level frame with the trunk's heading."""
        return np.asarray((Rotation.from_euler("z", -self.heading) * self._rotation).as_matrix())

    def update(self, angular_velocity: Array, specific_force: Array, period: float, standing: bool) -> None:
        """Process a reading of angular velocity (3,) rad/s and specific force (3,) m/s² in the trunk frame."""
        self.rate = angular_velocity - self._bias
        if standing and float(np.abs(self.rate).max()) < self.still:
            self._bias = self._bias + min(1.0, period / self.bias_time) * (angular_velocity - self._bias)
        # Steps shake the trunk by several g, but in the mean they hold it up: whole readings, never chosen ones.
        up = self.odom_from_trunk[2]
        turn = self.rate + self.gain * np.cross(specific_force / GRAVITY, up)
        self._rotation = self._rotation * Rotation.from_rotvec(turn * period)


# Odometry of a walking robot: feet on the floor roll and do not slip, so the trunk moves as the legs tell.
# M. Bloesch et al., "State estimation for legged robots", 2012, without its filter: headings come from the gyroscope.


class LegOdometry:
    """The planar pose since the start, and the trunk's velocity (3,) m/s in its level frame."""

    def __init__(self) -> None:
        self.x = self.y = self.travelled = 0.0
        self.heading = 0.0  # without end
        self.velocity: Array = np.zeros(3)

    @property
    def pose(self) -> Pose2D:
        """The pose in the odom frame."""
        return Pose2D(self.x, self.y, wrap_angle(self.heading))

    def update(self, velocities: Array, heading: float, period: float, smoothing: float) -> None:
        """Integrate the trunk velocities (k, 3) m/s, one from each foot on the floor; with none, the last velocity
        holds.

        ``smoothing``: time constant of the low-pass filter of the velocity for the gait, seconds.
        """
        before = self.velocity
        measured = velocities.mean(axis=0) if len(velocities) else before
        self.heading += wrap_angle(heading - self.heading)
        self.x += (measured[0] * math.cos(heading) - measured[1] * math.sin(heading)) * period
        self.y += (measured[0] * math.sin(heading) + measured[1] * math.cos(heading)) * period
        self.travelled += float(measured[0]) * period
        self.velocity = before + min(1.0, period / smoothing) * (measured - before)


@dataclass(eq=False)
class TrotGait:
    """Stands and trots. Joint angles, speeds and torques are (4, 3): front right, front left, rear right, rear left.

    ``body``: mass and centre of mass of the standing robot, in the trunk's frame. ``joint_…``: gains of the joints (N
    m/rad, N m s/rad).

    The gains of the trunk are those of a virtual spring and damper that keep it level at its height: ``height_…`` N/m
    and N s/m, ``tilt_…`` N m/rad and N m s/rad (J. Pratt et al., "Virtual model control", 2001); ``turn_damping`` N m
    s/rad and ``speed_gain`` N s/m keep its velocity; its forces stay within ``friction``. ``…_integral``: integral gain
    on the mean velocity, 1/s, limited to ``most_correction`` (m/s, m/s, rad/s), because feet slip and yield.
    ``settled``: seconds after landing from which a foot counts for the odometry. ``smoothing``: time constant of the
    velocity filter, seconds. While standing, without landing feet, ``standing_smoothing`` and the higher damping
    ``standing_speed_gain`` bring the robot to rest.
    """

    base: LeggedBaseModel
    body: Payload
    joint_gain: float = 60.0
    joint_damping: float = 1.5
    height_gain: float = 600.0
    height_damping: float = 60.0
    tilt_gain: float = 150.0
    tilt_damping: float = 8.0
    turn_damping: float = 4.0
    speed_gain: float = 40.0
    standing_speed_gain: float = 400.0
    speed_integral: float = 1.5
    turn_integral: float = 1.5
    most_correction: tuple[float, float, float] = (0.12, 0.1, 0.25)
    friction: float = 0.5
    settled: float = 0.04
    smoothing: float = 0.05
    standing_smoothing: float = 0.005

    def __post_init__(self) -> None:
        part = self.base.part
        self.kinematics = LegKinematics(self.base)
        self._efforts = np.array(part.limits.effort).reshape(-1, 3)
        self.height = part.stand_height - part.foot_radius  # of the trunk's frame above the centres of the feet
        self.attitude = Attitude()
        self.odometry = LegOdometry()
        below_body = self.kinematics.below_hips(self.height)
        below_body[:, :2] += self.body.centre[:2]
        self.trot = Trot(below_body)
        self.wanted_angles: Array | None = None
        self._window: deque[Array] = deque()
        self.correction = np.zeros(3)

    @property
    def velocity(self) -> Array:
        """Return vx, vy, wz averaged over one step of all legs, or over a tenth of that time while standing."""
        return np.asarray(np.mean(self._window, axis=0)) if self._window else np.zeros(3)

    def update(
        self, command: Array, angles: Array, speeds: Array, turning: Array, specific_force: Array, period: float
    ) -> Array:
        """Return the joint torques (4, 3), N m, for a ``command`` (vx, vy, wz) and readings of joints and inertial
        unit.
        """
        attitude, trot = self.attitude, self.trot
        attitude.update(turning, specific_force, period, standing=not trot.walking)
        level = attitude.level_from_trunk
        feet, jacobians = self.kinematics.feet(angles), self.kinematics.jacobians(angles)
        moving = np.einsum("nij,nj->ni", jacobians, speeds) + np.cross(attitude.rate, feet)
        rolling = self.kinematics.rolling(angles, speeds, attitude.rate, level[2])
        firm = trot.stance & (trot.landed_for >= self.settled)
        smoothing = self.smoothing if trot.walking else self.standing_smoothing
        self.odometry.update(((rolling - moving) @ level.T)[firm], attitude.heading, period, smoothing)
        trot.update(self._corrected(command, period), self.odometry.velocity[:2], period)
        self._window.append(np.array([*self.odometry.velocity[:2], attitude.rate[2]]))
        while len(self._window) > trot.period / period * (1.0 if trot.walking else 0.1):
            self._window.popleft()
        wanted = self.kinematics.angles(trot.feet @ level)
        before = wanted if self.wanted_angles is None else self.wanted_angles
        self.wanted_angles = wanted
        torques = self.joint_gain * (wanted - angles) + self.joint_damping * ((wanted - before) / period - speeds)
        forces = self._floor_forces(command, feet @ level.T, level)
        torques -= np.einsum("nji,nj->ni", jacobians, forces @ level)
        return np.clip(torques, -self._efforts, self._efforts)

    def _corrected(self, command: Array, period: float) -> Array:
        """Return the corrected command that brings the mean velocity to ``command``."""
        if not self.trot.walking or not command.any():
            self.correction = np.zeros(3)
            return command
        gains, most = (
            np.array([self.speed_integral, self.speed_integral, self.turn_integral]),
            np.array(self.most_correction),
        )
        step = gains * (command - self.velocity) * period
        self.correction = np.clip(self.correction + step, -most, most)
        return command + self.correction

    def _floor_forces(self, command: Array, feet: Array, level: Array) -> Array:
        """Return the desired floor forces on the feet, (4, 3) newtons in the trunk's level frame."""
        stance = self.trot.stance
        velocity, rate = self.odometry.velocity, level @ self.attitude.rate
        height = -float(feet[stance, 2].mean())
        speed_gain = self.speed_gain if self.trot.walking else self.standing_speed_gain
        up = level.T @ np.array([0.0, 0.0, 1.0])  # the vertical in the trunk's axes: level when it is z
        force = np.array(
            [
                speed_gain * (command[0] - velocity[0]),
                speed_gain * (command[1] - velocity[1]),
                self.body.mass * GRAVITY
                + self.height_gain * (self.height - height)
                - self.height_damping * velocity[2],
            ]
        )
        tilt = level @ np.cross(np.array([0.0, 0.0, 1.0]), up)
        moment = self.tilt_gain * tilt - self.tilt_damping * rate
        moment[2] = self.turn_damping * (command[2] - rate[2])
        wrench = np.concatenate([force, moment])
        columns = []
        for foot in feet[stance]:
            x, y, z = foot - level @ self.body.centre
            columns.append(np.vstack([np.eye(3), [[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]]]))
        matrix = np.hstack(columns)
        # Forces count for more than moments: what two feet cannot do about the line between them is left undone.
        weights = np.array([1.0, 1.0, 1.0, 8.0, 8.0, 4.0])
        regular = matrix.T @ (weights[:, None] * matrix) + 1e-3 * np.eye(matrix.shape[1])
        solved = np.linalg.solve(regular, matrix.T @ (weights * wrench)).reshape(-1, 3)
        solved[:, 2] = np.maximum(solved[:, 2], 0.0)
        most = self.friction * solved[:, 2:3]
        sideways = np.linalg.norm(solved[:, :2], axis=1, keepdims=True)
        solved[:, :2] *= np.minimum(1.0, most / np.maximum(sideways, 1e-9))
        forces = np.zeros((len(stance), 3))
        forces[stance] = solved
        return forces
