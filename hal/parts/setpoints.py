"""Generators of joint set-points within velocity and acceleration limits; pure, stepped by the control period."""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import JointTrajectory

Array = NDArray[np.float64]
AT_REST = 1e-6


class Setpoints(ABC):
    """A sequence of set-points; positions and velocities are (n,).

    ``waits``: whether it follows a path and waits for the joints. ``brakes``: whether joints brake as for a stop.
    ``scaled``: whether its time is scaled by the operator's speed.
    """

    finished = False
    waits = False
    brakes = False
    scaled = True

    @abstractmethod
    def advance(self, dt: float) -> tuple[Array, Array]:
        """Return position and velocity (n,) ``dt`` seconds later."""

    def continue_from(self, position: Array, velocity: Array) -> bool:
        """Continue from the admitted position and velocity, which differ from the requested ones. Return whether this
        is possible.
        """
        return False


class _FromState(Setpoints):
    """Set-points that are decided in each step from the current state of the joints."""

    def __init__(self, position: Array, velocity: Array) -> None:
        self._position, self._velocity = position, velocity

    def continue_from(self, position: Array, velocity: Array) -> bool:
        """Continue from the given state; always possible."""
        self._position, self._velocity, self.finished = position, velocity, False
        return True


class Hold(Setpoints):
    """Holds ``position``."""

    finished = True
    scaled = False

    def __init__(self, position: Array) -> None:
        self._position = position

    def advance(self, dt: float) -> tuple[Array, Array]:
        """Return the held position and zero velocity."""
        return self._position, np.zeros_like(self._position)


class Brake(_FromState):
    """Braking from ``position`` and ``velocity`` to rest, each joint with its ``deceleration``.

    It stays within [lower, upper], or moves no further outside.
    """

    brakes = True
    scaled = False

    def __init__(self, position: Array, velocity: Array, deceleration: Array, lower: Array, upper: Array) -> None:
        super().__init__(position, velocity)
        self._deceleration = deceleration
        self._lower, self._upper = np.minimum(lower, position), np.maximum(upper, position)
        self.finished = bool(np.all(np.abs(velocity) < AT_REST))

    def advance(self, dt: float) -> tuple[Array, Array]:
        """Return the next braking set-point."""
        speed = np.maximum(np.abs(self._velocity) - self._deceleration * dt, 0.0)
        velocity = np.sign(self._velocity) * speed
        self._position = np.clip(self._position + (self._velocity + velocity) / 2 * dt, self._lower, self._upper)
        self._velocity = velocity
        self.finished = bool(np.all(speed < AT_REST))
        return self._position, self._velocity


class Reach(_FromState):
    """Moves each joint independently to ``target`` as fast as its limits allow; joints may be moving at the start."""

    def __init__(self, position: Array, velocity: Array, target: Array, speed: Array, acceleration: Array) -> None:
        super().__init__(position, velocity)
        self._target, self._speed, self._acceleration = target, speed, acceleration

    def advance(self, dt: float) -> tuple[Array, Array]:
        """Return the next set-point; the speed is limited so that the joint can stop at the target, in discrete
        time.
        """
        error = self._target - self._position
        step = self._acceleration * dt
        stopping = step * (np.sqrt(0.25 + 2.0 * np.abs(error) / (step * dt)) - 0.5)
        wanted = np.sign(error) * np.minimum(self._speed, stopping)
        self._velocity = self._velocity + np.clip(wanted - self._velocity, -step, step)
        self._position = self._position + self._velocity * dt
        near = np.abs(self._target - self._position) < 1e-5
        if np.all(near & (np.abs(self._velocity) < step + AT_REST)):
            self.finished = True
            self._position, self._velocity = self._target, np.zeros_like(self._target)
        return self._position, self._velocity


class Trapezoid(Setpoints):
    """A straight line in joint space with a trapezoidal speed profile: all joints start and end together, at rest."""

    waits = True

    def __init__(self, start: Array, target: Array, speed: Array, acceleration: Array) -> None:
        self._start, self._delta = start, target - start
        distance = np.maximum(np.abs(self._delta), 1e-12)
        self._acceleration = float(np.min(acceleration / distance))
        self._speed = min(float(np.min(speed / distance)), self._acceleration**0.5)
        self._rise = self._speed / self._acceleration
        self.duration = 1.0 / self._speed + self._rise
        self._time = 0.0

    def advance(self, dt: float) -> tuple[Array, Array]:
        """Return position and velocity (n,) of the next set-point on the line, ``dt`` seconds later."""
        self._time = min(self._time + dt, self.duration)
        self.finished = self._time >= self.duration
        t, left = self._time, self.duration - self._time
        if t < self._rise:
            share, rate = 0.5 * self._acceleration * t * t, self._acceleration * t
        elif left < self._rise:
            share, rate = 1.0 - 0.5 * self._acceleration * left * left, self._acceleration * left
        else:
            share, rate = self._speed * (t - self._rise / 2), self._speed
        return self._start + share * self._delta, rate * self._delta


class Follow(Setpoints):
    """A trajectory, Hermite-interpolated; an ``offset`` at the start decays within ``fade`` seconds."""

    waits = True

    def __init__(self, trajectory: JointTrajectory, offset: Array, fade: float) -> None:
        self._trajectory, self._offset, self._fade = trajectory, offset, min(fade, trajectory.duration)
        self._time = 0.0

    @property
    def time(self) -> float:
        """The elapsed time of the trajectory, seconds."""
        return min(self._time, self._trajectory.duration)

    def advance(self, dt: float) -> tuple[Array, Array]:
        """Return the next set-point of the trajectory."""
        self._time += dt
        position, velocity = self._trajectory.sample(self._time)
        self.finished = self._time >= self._trajectory.duration
        if self._time < self._fade:
            s = self._time / self._fade
            position = position + self._offset * (1.0 - s * s * (3.0 - 2.0 * s))
            velocity = velocity - self._offset * 6.0 * s * (1.0 - s) / self._fade
        return position, velocity


class Drift(_FromState):
    """A velocity, reached within the acceleration limits and held until a joint reaches its limit."""

    def __init__(
        self, position: Array, velocity: Array, target: Array, acceleration: Array, lower: Array, upper: Array
    ) -> None:
        super().__init__(position, velocity)
        self._target, self._acceleration = target, acceleration
        self._lower, self._upper = np.minimum(lower, position), np.maximum(upper, position)

    def advance(self, dt: float) -> tuple[Array, Array]:
        """Return the next set-point, slowing down in time for the limits."""
        step = self._acceleration * dt
        room = np.where(self._target > 0, self._upper - self._position, self._position - self._lower)
        stopping = step * (np.sqrt(0.25 + 2.0 * np.maximum(room, 0.0) / (step * dt)) - 0.5)
        wanted = np.sign(self._target) * np.minimum(np.abs(self._target), stopping)
        self._velocity = self._velocity + np.clip(wanted - self._velocity, -step, step)
        self._position = np.clip(self._position + self._velocity * dt, self._lower, self._upper)
        return self._position, self._velocity


class Stream(Setpoints):
    """One streamed set-point, approached at constant velocity over ``interval`` seconds and then held.

    The caller that streams determines the speed; see ``Part.speed_share``.
    """

    scaled = False

    def __init__(self, position: Array, target: Array, interval: float) -> None:
        self._start, self._target, self._interval = position, target, interval
        self._time = 0.0

    def advance(self, dt: float) -> tuple[Array, Array]:
        """Return the next set-point towards the streamed position."""
        self._time += dt
        if self._time >= self._interval - 1e-9:
            at_end = self._time < self._interval + dt / 2
            velocity = (self._target - self._start) / self._interval if at_end else np.zeros_like(self._target)
            self.finished = not at_end
            return self._target, velocity
        share = self._time / self._interval
        return self._start + share * (self._target - self._start), (self._target - self._start) / self._interval


class BrakeThenMove(Setpoints):
    """Brakes to rest, then moves along a trapezoidal profile from there."""

    def __init__(self, brake: Brake, target: Array, speed: Array, acceleration: Array) -> None:
        self._brake, self._target, self._limits = brake, target, (speed, acceleration)
        self._move: Trapezoid | None = None
        self.brakes, self.scaled = True, False

    def continue_from(self, position: Array, velocity: Array) -> bool:
        """Continue braking from the given state; the straight line afterwards is unchanged."""
        return self._move is None and self._brake.continue_from(position, velocity)

    def advance(self, dt: float) -> tuple[Array, Array]:
        """Return the next set-point of the braking or the motion."""
        if self._move is None:
            if not self._brake.finished:
                return self._brake.advance(dt)
            start, _ = self._brake.advance(0.0)
            self._move = Trapezoid(start, self._target, *self._limits)
            self.waits, self.brakes, self.scaled = True, False, True
        result = self._move.advance(dt)
        self.finished = self._move.finished
        return result
