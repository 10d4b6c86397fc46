"""The true motion of frames on the robot, for simulated sensors alone: from how far they went since the last look.

Bullet's own velocities of a robot's links leave out what position motors correct in a step: joints tell half their
speed, and so do the links behind them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from bestman_bt.messages import Pose
from hal.simulation.guards import Reader
from hal.simulation.simulation import Simulation

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class FrameMotion:
    """``pose`` in the map; ``linear`` (3,) m/s of its origin and ``angular`` (3,) rad/s along the map's axes."""

    pose: Pose
    linear: Array
    angular: Array

    def velocity_at(self, point: Array) -> Array:
        """Velocity (3,) m/s of the point of the body that is at ``point`` (3,) of the map."""
        velocity: Array = self.linear + np.cross(self.angular, point - self.pose.position)
        return velocity


class FrameTracker:
    """Follows one frame or link of the robot; it stands still until it is looked at for the second time."""

    def __init__(self, simulation: Simulation, reader: Reader, frame: str) -> None:
        self._simulation, self._reader, self._frame = simulation, reader, frame
        self._before: tuple[float, Pose] | None = None

    def look(self) -> FrameMotion:
        """Where the frame is now, and its mean velocity since the look before."""
        pose, now = self._simulation.link_pose(self._reader, self._frame), self._simulation.now
        before, self._before = self._before, (now, pose)
        if before is None:
            return FrameMotion(pose, np.zeros(3), np.zeros(3))
        stamp, old = before
        turned = Rotation.from_quat(pose.quaternion) * Rotation.from_quat(old.quaternion).inv()
        return FrameMotion(pose, (pose.position - old.position) / (now - stamp), turned.as_rotvec() / (now - stamp))


def body_velocity_at(reader: Reader, body: int, link: int, point: Array) -> Array:
    """Velocity (3,) m/s at ``point`` (3,) of the map of what has no position motors: an object, a door."""
    if link >= 0:
        centre, linear, angular = map(np.array, reader.link_motions(body, [link])[0])
    else:
        centre = np.array(reader.body_pose(body)[0])
        linear, angular = map(np.array, reader.body_velocity(body))
    velocity: Array = linear + np.cross(angular, point - centre)
    return velocity
