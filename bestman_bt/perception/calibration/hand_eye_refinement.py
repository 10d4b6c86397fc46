"""Refinement of a hand-eye calibration: weighted least squares on all views at once, with the result's covariance.

The unknowns are both ends, camera on carrier and target in world, as in Dornaika & Horaud, "Simultaneous robot-world
and hand-eye calibration", IEEE Transactions on Robotics and Automation 1998; each view is weighted by the propagated
noise of its two poses.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from bestman_bt.messages import Pose


@dataclass(frozen=True)
class HandEyeNoise:
    """Standard deviations per axis: of the carrier's poses and of the target's poses in the camera; metres, radians."""

    carrier_position: float = 0.0003
    carrier_rotation: float = math.radians(0.05)
    eye_position: float = 0.0003
    eye_rotation: float = math.radians(0.05)


@dataclass(frozen=True, eq=False)
class Refined:
    """Both ends; ``covariance`` (6, 6) of the first; ``residuals`` (N, 6): metres, then radians, in the camera."""

    carrier_from_eye: Pose
    world_from_target: Pose
    covariance: NDArray[np.float64]
    residuals: NDArray[np.float64]

    def of_all(self, world_from_carrier: Sequence[Pose], eye_from_target: Sequence[Pose]) -> Refined:
        """Return the result with the residuals of these views."""
        carriers, seen = (np.array([pose.matrix for pose in poses]) for poses in (world_from_carrier, eye_from_target))
        return replace(self, residuals=_residuals(carriers, seen, self.carrier_from_eye, self.world_from_target))


def mean_target(world_from_carrier: Sequence[Pose], eye_from_target: Sequence[Pose], end: Pose) -> Pose:
    """Return the mean pose of the target over the views, with the camera at ``end`` of its carrier."""
    placed = np.array(
        [
            carrier.matrix @ end.matrix @ seen.matrix
            for carrier, seen in zip(world_from_carrier, eye_from_target, strict=True)
        ]
    )
    return Pose(placed[:, :3, 3].mean(axis=0), Rotation.from_matrix(placed[:, :3, :3]).mean().as_quat())


def refine(
    world_from_carrier: Sequence[Pose],
    eye_from_target: Sequence[Pose],
    start: Pose,
    noise: HandEyeNoise,
    move: bool = True,
) -> Refined:
    """Minimise the weighted residuals from ``start``; without ``move``, only the target pose is estimated, as the
    mean.
    """
    seen = np.array([pose.matrix for pose in eye_from_target])
    carriers = np.array([pose.matrix for pose in world_from_carrier])
    target = mean_target(world_from_carrier, eye_from_target, start)
    weights = _weights(seen, start, noise)

    def weighted(x: NDArray[np.float64]) -> NDArray[np.float64]:
        residuals = _residuals(carriers, seen, changed(start, x[:6]), changed(target, x[6:]))
        return np.asarray(np.einsum("nij,nj->ni", weights, residuals)).ravel()

    zero = np.zeros(12)
    solved = least_squares(weighted, zero, method="lm", xtol=1e-14, ftol=1e-14, max_nfev=None if move else 1)
    x = solved.x if move else zero
    end, target = changed(start, x[:6]), changed(target, x[6:])
    freedom = max(solved.fun.size - 12, 1)
    variance = 2.0 * solved.cost / freedom
    covariance = variance * np.linalg.inv(solved.jac.T @ solved.jac)[:6, :6]
    return Refined(end, target, covariance, _residuals(carriers, seen, end, target))


def whitened(
    world_from_carrier: Sequence[Pose], eye_from_target: Sequence[Pose], end: Pose, target: Pose, noise: HandEyeNoise
) -> NDArray[np.float64]:
    """Return the error (N,) of each view in standard deviations: the norm of its six residuals divided by their
    noise.
    """
    seen = np.array([pose.matrix for pose in eye_from_target])
    residuals = _residuals(np.array([pose.matrix for pose in world_from_carrier]), seen, end, target)
    norms: NDArray[np.float64] = np.linalg.norm(np.einsum("nij,nj->ni", _weights(seen, end, noise), residuals), axis=1)
    return norms


def changed(pose: Pose, x: NDArray[np.float64]) -> Pose:
    """Return the pose displaced by ``x`` (6,): translation in metres and rotation vector in radians, in the pose's
    parent frame.
    """
    turn = Pose(np.zeros(3), Rotation.from_rotvec(x[3:]).as_quat())
    rotated = turn @ Pose(np.zeros(3), pose.quaternion)
    return Pose(pose.position + x[:3], rotated.quaternion)


def _residuals(
    carriers: NDArray[np.float64], seen: NDArray[np.float64], end: Pose, target: Pose
) -> NDArray[np.float64]:
    """Return (N, 6) the deviation of the target from its predicted pose, in the camera frame."""
    expected = np.linalg.inv(carriers @ end.matrix) @ target.matrix
    turn = seen[:, :3, :3] @ expected[:, :3, :3].transpose(0, 2, 1)
    return np.hstack([seen[:, :3, 3] - expected[:, :3, 3], Rotation.from_matrix(turn).as_rotvec()])


def _weights(seen: NDArray[np.float64], end: Pose, noise: HandEyeNoise) -> NDArray[np.float64]:
    """Return (N, 6, 6) whitening matrices. A rotation of the carrier moves the target on a lever: from carrier to
    target.
    """
    carrier_in_eye = end.inverse().position
    identity = np.eye(6)
    weights = []
    for matrix in seen:
        lever = matrix[:3, 3] - carrier_in_eye
        effect = identity.copy()
        effect[:3, 3:] = -_cross(lever)
        of_carrier = np.diag([noise.carrier_position**2] * 3 + [noise.carrier_rotation**2] * 3)
        of_eye = np.diag([noise.eye_position**2] * 3 + [noise.eye_rotation**2] * 3)
        covariance = effect @ of_carrier @ effect.T + of_eye
        weights.append(np.linalg.inv(np.linalg.cholesky(covariance)))
    return np.array(weights)


def _cross(v: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])
