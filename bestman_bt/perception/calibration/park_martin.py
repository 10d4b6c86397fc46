"""Hand-eye calibration on the Euclidean group.

Park & Martin, "Robot sensor calibration: solving AX = XB on the Euclidean group", IEEE Transactions on Robotics and
Automation 1994.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from bestman_bt.messages import Pose
from bestman_bt.perception.calibration.hand_eye import HandEye, RelativeMotions


@dataclass(frozen=True)
class ParkMartin(HandEye):
    """Rotation first, from the logarithms of the motions; then the translation, by linear least squares."""

    def closed_form(self, motions: RelativeMotions) -> Pose:
        """X from relative motions."""
        turn_a, turn_b = motions.carrier[:, :3, :3], motions.eye[:, :3, :3]
        alpha, beta = Rotation.from_matrix(turn_a).as_rotvec(), Rotation.from_matrix(turn_b).as_rotvec()
        # alpha = R beta for all pairs: R = (MᵀM)^(-1/2) Mᵀ with M = Σ beta alphaᵀ, by the singular values of M.
        u, _, vt = np.linalg.svd(beta.T @ alpha)
        rotation = vt.T @ np.diag([1.0, 1.0, np.linalg.det(vt.T @ u.T)]) @ u.T
        left = (turn_a - np.eye(3)).reshape(-1, 3)
        right = (motions.eye[:, :3, 3] @ rotation.T - motions.carrier[:, :3, 3]).ravel()
        position = np.linalg.lstsq(left, right, rcond=None)[0]
        return Pose(position, Rotation.from_matrix(rotation).as_quat())
