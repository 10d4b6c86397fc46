"""Forward kinematics of many joint positions at once, by the product of exponentials.

Brockett, "Robotic manipulators and the product of exponentials formula", 1984.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bestman_bt.manipulation.kinematics.base import InverseKinematics


@dataclass(frozen=True, eq=False)
class ScrewChain:
    """``screws``: (n, 6) linear over angular part of each joint's axis in the base frame, at joint positions zero.

    ``rotation`` (3, 3), ``position`` (3,): of the tool there.
    """

    screws: NDArray[np.float64]
    rotation: NDArray[np.float64]
    position: NDArray[np.float64]

    @classmethod
    def of(cls, kinematics: InverseKinematics) -> ScrewChain:
        """Read off an arm's kinematics: its Jacobian at zero, taken to the base frame."""
        zero = np.zeros(len(kinematics.joint_names))
        tool = kinematics.tool_pose(zero)
        jacobian = kinematics.jacobian(zero)
        angular = tool.rotation @ jacobian[3:]
        linear = tool.rotation @ jacobian[:3] - np.cross(angular.T, tool.position).T
        return cls(np.vstack([linear, angular]).T, tool.rotation, tool.position)

    @property
    def joints(self) -> int:
        """How many joints there are."""
        return len(self.screws)

    def reach(
        self, positions: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """At (N, n) joint positions: tool positions (N, 3), tool z axes (N, 3), manipulabilities (N,)."""
        count = len(positions)
        rotation, translation = np.tile(np.eye(3), (count, 1, 1)), np.zeros((count, 3))
        jacobian = np.empty((count, 6, self.joints))
        for i, screw in enumerate(self.screws):
            angular = rotation @ screw[3:]
            jacobian[:, 3:, i] = angular
            jacobian[:, :3, i] = rotation @ screw[:3] + np.cross(translation, angular)
            turn, shift = _exponential(screw, positions[:, i])
            translation = translation + np.einsum("nij,nj->ni", rotation, shift)
            rotation = rotation @ turn
        # The determinant does not depend on the point that the Jacobian refers to.
        squared = np.linalg.det(jacobian @ np.swapaxes(jacobian, 1, 2))
        tool = translation + rotation @ self.position
        return tool, rotation @ self.rotation[:, 2], np.sqrt(np.maximum(squared, 0.0))


def _exponential(
    screw: NDArray[np.float64], angles: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """exp of a unit screw at ``angles`` (N,): rotations (N, 3, 3) and translations (N, 3)."""
    x, y, z = screw[3:]
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    square = cross @ cross
    sine, versine = np.sin(angles)[:, None, None], (1.0 - np.cos(angles))[:, None, None]
    rotation = np.eye(3) + sine * cross + versine * square
    linear = screw[:3]
    shift = (
        angles[:, None] * linear
        + versine[:, 0] * (cross @ linear)
        + (angles[:, None] - np.sin(angles)[:, None]) * (square @ linear)
    )
    return rotation, shift
