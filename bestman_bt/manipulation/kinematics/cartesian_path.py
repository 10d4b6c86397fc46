"""Straight motion of the tool: inverse kinematics along a line, without jumps between branches."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bestman_bt.manipulation.joint_values import joint_vector
from bestman_bt.manipulation.kinematics.base import InverseKinematics
from bestman_bt.messages import Pose


@dataclass(frozen=True, eq=False)
class CartesianPath:
    """A joint path ``path`` (N, n), radians, as far as possible. ``fraction``: reached fraction of the line, 1 if
    complete.

    ``failure``: why it ended early; empty if complete.
    """

    path: NDArray[np.float64]
    fraction: float
    failure: str = ""

    @property
    def complete(self) -> bool:
        """Whether the path reaches the goal."""
        return not self.failure


def cartesian_path(
    kinematics: InverseKinematics,
    start: ArrayLike,
    base_from_goal: Pose,
    is_valid: Callable[[NDArray[np.float64]], bool] | None = None,
    max_translation: float = 0.01,
    max_rotation: float = 0.05,
) -> CartesianPath:
    """Move the tool straight from its pose at ``start`` (n,) to ``base_from_goal``, with uniform rotation.

    ``is_valid``: called at every waypoint but the first, for example ``CollisionWorld.is_free``. ``max_translation``,
    ``max_rotation``: metres and radians between waypoints. Raises the errors of ``InverseKinematics.track``.
    """
    q = joint_vector(start, len(kinematics.joint_names), "start of a Cartesian path")
    base_from_start = kinematics.tool_pose(q)
    translation = float(np.linalg.norm(base_from_goal.position - base_from_start.position))
    rotation = rotation_angle(base_from_start, base_from_goal)
    count = max(1, math.ceil(max(translation / max_translation, rotation / max_rotation)))
    waypoints = [q]
    for i in range(1, count + 1):
        following = kinematics.track(interpolate(base_from_start, base_from_goal, i / count), q)
        fraction = (i - 1) / count
        if following is None:
            return CartesianPath(np.array(waypoints), fraction, f"no smooth inverse kinematics after {fraction:.0%}")
        if is_valid is not None and not is_valid(following):
            return CartesianPath(np.array(waypoints), fraction, f"refused by the validity check after {fraction:.0%}")
        waypoints.append(following)
        q = following
    return CartesianPath(np.array(waypoints), 1.0)


def rotation_angle(a: Pose, b: Pose) -> float:
    """Return the angle between two orientations, radians."""
    return 2.0 * math.acos(min(1.0, abs(float(a.quaternion @ b.quaternion))))


def interpolate(a: Pose, b: Pose, fraction: float) -> Pose:
    """Return the pose at ``fraction``: linear in position, spherical linear in orientation (the shorter way)."""
    position = (1.0 - fraction) * a.position + fraction * b.position
    cosine = float(a.quaternion @ b.quaternion)
    end = b.quaternion if cosine >= 0.0 else -b.quaternion
    angle = math.acos(min(1.0, abs(cosine)))
    if angle < 1e-6:
        quaternion = (1.0 - fraction) * a.quaternion + fraction * end
    else:
        quaternion = (math.sin((1.0 - fraction) * angle) * a.quaternion + math.sin(fraction * angle) * end) / math.sin(
            angle
        )
    return Pose(position, quaternion / np.linalg.norm(quaternion))
