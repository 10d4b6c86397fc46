"""Kinematics of driven wheels, and odometry from their encoders; pure.

Siegwart, Nourbakhsh and Scaramuzza, "Introduction to Autonomous Mobile Robots", 2011, chapter 3; skid steering by an
effective track: Mandow et al., "Experimental kinematics for wheeled skid-steer mobile robots", IROS 2007.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import Pose2D, wrap_angle
from bestman_bt.robot_model import WheeledBaseModel

Array = NDArray[np.float64]
Velocity = tuple[float, float, float]
"""vx, vy, wz: m/s and rad/s in the base frame; or a path: metres and radians."""


class Drive(ABC):
    """Between the velocity of a base and the motion of its wheels; (n,) wheels, (k,) steering joints, radians."""

    @abstractmethod
    def wheel_speeds(self, velocity: Velocity, steering: Array) -> Array:
        """Speeds of the wheels (n,), rad/s, for a velocity, where they point as ``steering`` (k,) says."""

    @abstractmethod
    def motion(self, wheels: Array, steering: Array) -> Velocity:
        """The velocity from speeds of the wheels (n,), rad/s, or the path from their angles, rad."""

    def steering_angles(self, velocity: Velocity, present: Array) -> Array:
        """Where the steering joints should point (k,), the nearer of the two ways to it; without any, none."""
        return present


@dataclass(frozen=True)
class SideDrive(Drive):
    """Wheels on the left and right side in turns: left, right, left, right; metres.

    The radii may differ (calibration errors). ``track``: of two wheels, the distance between them; wheels that are
    dragged over the floor in turns (skid steering) behave as if it were larger.
    """

    left_radius: float
    right_radius: float
    track: float
    wheels: int = 2

    def wheel_speeds(self, velocity: Velocity, steering: Array) -> Array:
        """Alike on each side; the sideways part of the velocity is not in its power."""
        vx, _, wz = velocity
        half = wz * self.track / 2.0
        return np.array([(vx - half) / self.left_radius, (vx + half) / self.right_radius] * (self.wheels // 2))

    def motion(self, wheels: Array, steering: Array) -> Velocity:
        """From the mean of each side."""
        left_path = float(wheels[0::2].mean()) * self.left_radius
        right_path = float(wheels[1::2].mean()) * self.right_radius
        return (left_path + right_path) / 2.0, 0.0, (right_path - left_path) / self.track


@dataclass(frozen=True, eq=False)
class SteeredDrive(Drive):
    """Wheels that each turn about a vertical axis above them: ``places`` (n, 2) metres in the base, ``radii`` (n,).

    At a steering angle of zero a wheel rolls along x. Steering joints turn without end.
    """

    places: Array
    radii: Array

    def steering_angles(self, velocity: Velocity, present: Array) -> Array:
        """A wheel turns by at most a quarter: else it rolls the other way round. Standing, it stays as it is."""
        ways = self._wheel_velocities(velocity)
        wanted = np.arctan2(ways[:, 1], ways[:, 0])
        turn = (wanted - present + np.pi / 2) % np.pi - np.pi / 2
        return np.where(np.hypot(*ways.T) > 1e-4, present + turn, present)

    def wheel_speeds(self, velocity: Velocity, steering: Array) -> Array:
        """What of each wheel's velocity lies along the way that it points."""
        along = np.column_stack([np.cos(steering), np.sin(steering)])
        speeds: Array = np.sum(self._wheel_velocities(velocity) * along, axis=1) / self.radii
        return speeds

    def motion(self, wheels: Array, steering: Array) -> Velocity:
        """The rigid motion whose wheel velocities are nearest to those rolled, in the sense of least squares."""
        rolled = (wheels * self.radii)[:, None] * np.column_stack([np.cos(steering), np.sin(steering)])
        n = len(self.radii)
        rows = np.zeros((2 * n, 3))
        rows[0::2, 0] = rows[1::2, 1] = 1.0
        rows[0::2, 2], rows[1::2, 2] = -self.places[:, 1], self.places[:, 0]
        vx, vy, wz = np.linalg.lstsq(rows, rolled.ravel(), rcond=None)[0]
        return float(vx), float(vy), float(wz)

    def _wheel_velocities(self, velocity: Velocity) -> Array:
        vx, vy, wz = velocity
        return np.column_stack([vx - wz * self.places[:, 1], vy + wz * self.places[:, 0]])


class Odometry:
    """Dead reckoning from wheel angles (rad), midpoint rule: the pose since the first reading, and the path."""

    def __init__(self, drive: Drive, wheels: Array) -> None:
        self._drive = drive
        self._wheels = np.array(wheels)
        self.x = self.y = self.heading = self.travelled = 0.0

    @property
    def pose(self) -> Pose2D:
        """The pose in the odom frame."""
        return Pose2D(self.x, self.y, wrap_angle(self.heading))

    def update(self, wheels: Array, steering: Array) -> None:
        """Take in a reading of the wheels (n,) and the steering joints (k,)."""
        forward, left, angle = self._drive.motion(wheels - self._wheels, steering)
        self._wheels = np.array(wheels)
        middle = self.heading + angle / 2.0
        self.x += forward * math.cos(middle) - left * math.sin(middle)
        self.y += forward * math.sin(middle) + left * math.cos(middle)
        self.heading += angle
        self.travelled += forward


def make_drives(model: WheeledBaseModel, calibration: float, rng: np.random.Generator) -> tuple[Drive, Drive]:
    """The drive of a base, and what its odometry believes of it.

    ``calibration``: standard deviation of the relative errors of the believed wheel radii and track.
    """
    base = model.part
    if base.drive == "steered":
        places, radii = np.array(model.wheel_places), np.full(len(base.wheel_joints), base.wheel_radius)
        errors = 1.0 + calibration * rng.normal(size=len(radii))
        return SteeredDrive(places, radii), SteeredDrive(places, radii * errors)
    left, right, track = (1.0 + calibration * float(error) for error in rng.normal(size=3))
    radius, width, wheels = base.wheel_radius, base.track * base.turning_slip, len(base.wheel_joints)
    return (
        SideDrive(radius, radius, width, wheels),
        SideDrive(radius * left, radius * right, width * track, wheels),
    )
