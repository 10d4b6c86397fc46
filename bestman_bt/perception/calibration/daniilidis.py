"""Hand-eye calibration by dual quaternions.

Daniilidis, "Hand-eye calibration using dual quaternions", International Journal of Robotics Research 1999.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from bestman_bt.messages import Pose
from bestman_bt.perception.calibration.errors import DegenerateMotionError
from bestman_bt.perception.calibration.hand_eye import HandEye, RelativeMotions


@dataclass(frozen=True)
class Daniilidis(HandEye):
    """Rotation and translation at once: the dual quaternion of X spans the null space of all motions."""

    def closed_form(self, motions: RelativeMotions) -> Pose:
        """X from relative motions."""
        a, a_dual = _dual_quaternions(motions.carrier)
        b, b_dual = _dual_quaternions(motions.eye)
        difference, total = a[:, 1:] - b[:, 1:], a[:, 1:] + b[:, 1:]
        difference_dual, total_dual = a_dual[:, 1:] - b_dual[:, 1:], a_dual[:, 1:] + b_dual[:, 1:]
        zero = np.zeros((len(a), 3, 4))
        real = np.concatenate([difference[:, :, None], _cross(total)], axis=2)
        dual = np.concatenate([difference_dual[:, :, None], _cross(total_dual)], axis=2)
        rows = np.concatenate([np.concatenate([real, zero], axis=2), np.concatenate([dual, real], axis=2)], axis=1)
        _, _, vt = np.linalg.svd(rows.reshape(-1, 8), full_matrices=False)
        first, second = vt[-2], vt[-1]
        q, q_dual = _unit_combination(first[:4], first[4:], second[:4], second[4:])
        rotation = Rotation.from_quat(np.append(q[1:], q[0]))
        # q_dual = t q / 2, so t = 2 q_dual q*
        position = 2.0 * (q[0] * q_dual[1:] - q_dual[0] * q[1:] - np.cross(q_dual[1:], q[1:]))
        return Pose(position, rotation.as_quat())


def _unit_combination(
    u1: NDArray[np.float64], v1: NDArray[np.float64], u2: NDArray[np.float64], v2: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The combination of two null vectors whose real part is a unit and normal to its dual part."""
    roots = np.roots([u1 @ v1, u1 @ v2 + u2 @ v1, u2 @ v2])
    ratios = roots.real if len(roots) else np.zeros(1)  # noise can make them complex: the nearest real one then
    lengths = [s * s * (u1 @ u1) + 2.0 * s * (u1 @ u2) + u2 @ u2 for s in ratios]
    best = int(np.argmax(lengths))
    if not lengths[best] > 1e-12:
        raise DegenerateMotionError("the motions leave the camera's rotation undetermined; turn about two axes")
    scale = 1.0 / np.sqrt(lengths[best])
    return scale * (ratios[best] * u1 + u2), scale * (ratios[best] * v1 + v2)


def _dual_quaternions(motions: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Real and dual parts (M, 4) of motions, scalar first and not negative, as the equations of a pair need it."""
    xyzw = Rotation.from_matrix(motions[:, :3, :3]).as_quat()
    xyzw = np.where(xyzw[:, 3:] < 0.0, -xyzw, xyzw)
    w, v, t = xyzw[:, 3], xyzw[:, :3], motions[:, :3, 3]
    real = np.column_stack([w, v])
    dual = 0.5 * np.column_stack([-np.sum(t * v, axis=1), w[:, None] * t + np.cross(t, v)])
    return real, dual


def _cross(v: NDArray[np.float64]) -> NDArray[np.float64]:
    matrices = np.zeros((len(v), 3, 3))
    matrices[:, 0, 1], matrices[:, 0, 2], matrices[:, 1, 2] = -v[:, 2], v[:, 1], -v[:, 0]
    matrices -= matrices.transpose(0, 2, 1)
    return matrices
