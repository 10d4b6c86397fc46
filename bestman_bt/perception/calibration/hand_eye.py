"""Hand-eye calibration: the pose of a camera on its carrier, from poses of the carrier and of an observed target."""

from __future__ import annotations

import itertools
import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation
from typing_extensions import override

from bestman_bt.messages import Pose
from bestman_bt.perception.calibration.boards import CalibrationError, ContradictingViewsError, DegenerateMotionError
from bestman_bt.perception.calibration.hand_eye_refinement import HandEyeNoise, Refined, mean_target, refine, whitened

LARGEST_ANGLE = math.radians(170.0)
"""Largest rotation of a used motion: near half a turn, the sign of its axis is arbitrary."""


@dataclass(frozen=True, eq=False)
class HandEyeResult:
    """The solution: poses ``carrier_from_eye`` of the camera and ``world_from_target`` of the target.

    ``covariance``: (6, 6) of ``carrier_from_eye``: position (metres), then rotation vector (radians), both in the
    carrier frame. ``position_residuals`` (N,) metres and ``rotation_residuals`` (N,) radians: of the target in each
    view. ``rejected``: indices of contradicting views, which were not used.
    """

    carrier_from_eye: Pose
    world_from_target: Pose
    covariance: NDArray[np.float64]
    position_residuals: NDArray[np.float64]
    rotation_residuals: NDArray[np.float64]
    rejected: tuple[int, ...] = ()


@dataclass(frozen=True, eq=False)
class RelativeMotions:
    """Pairs of motions with A X = X B: ``carrier`` A and ``eye`` B, each (M, 4, 4); X is ``carrier_from_eye``."""

    carrier: NDArray[np.float64]
    eye: NDArray[np.float64]


@dataclass(frozen=True)
class HandEye(ABC):
    """Solves ``world_from_carrier @ X @ eye_from_target = world_from_target`` for X, ``carrier_from_eye``.

    ``refine``: whether least squares follow the closed form. ``noise``: of the poses, the weights of the residuals.
    ``min_views``: minimum number of views. ``min_second_rotation``: radians (root mean square, between views) about the
    second axis. ``max_angle_mismatch``: maximum difference, radians, of the rotation angles of camera and carrier in
    most motions. ``outlier``: standard deviations, and ``outlier_ratio``: multiples of the median, above which a view
    is excluded; the consistent views are found from ``subsets`` of four views (least median of squares, Rousseeuw
    1984).
    """

    refine: bool = True
    noise: HandEyeNoise = field(default_factory=HandEyeNoise)
    min_views: int = 4
    min_second_rotation: float = math.radians(3.0)
    max_angle_mismatch: float = math.radians(3.0)
    outlier: float = 6.0
    outlier_ratio: float = 3.0
    subsets: int = 60

    @abstractmethod
    def closed_form(self, motions: RelativeMotions) -> Pose:
        """Return X of A X = X B from relative motions of hand and camera."""

    def eye_in_hand(self, base_from_hand: Sequence[Pose], eye_from_target: Sequence[Pose]) -> HandEyeResult:
        """Calibrate a camera on the hand with a fixed target: world is the base, carrier is the hand.

        ``base_from_hand``: N poses from forward kinematics, ``eye_from_target``: the target in each of the N images.
        Raises CalibrationError, or DegenerateMotionError if the motions do not determine the result.
        """
        return self.calibrate(base_from_hand, eye_from_target, "hand")

    def eye_to_hand(self, base_from_hand: Sequence[Pose], eye_from_target: Sequence[Pose]) -> HandEyeResult:
        """Calibrate a fixed camera with a target on the hand: world is the hand, carrier is the base.

        In the result, ``carrier_from_eye`` is ``base_from_eye`` and ``world_from_target`` is ``hand_from_target``.
        Raises the errors of ``eye_in_hand``.
        """
        return self.calibrate([pose.inverse() for pose in base_from_hand], eye_from_target, "hand with the target")

    def calibrate(
        self, world_from_carrier: Sequence[Pose], eye_from_target: Sequence[Pose], what_moves: str = "arm"
    ) -> HandEyeResult:
        """Calibrate a carried camera with a target fixed in the world: the general case. Raises the errors of
        ``eye_in_hand``.
        """
        if len(world_from_carrier) != len(eye_from_target):
            raise CalibrationError(
                f"poses and views should be equal in number, got {len(world_from_carrier)} and {len(eye_from_target)}"
            )
        if len(world_from_carrier) < self.min_views:
            raise CalibrationError(
                f"at least {self.min_views} views are needed, got {len(world_from_carrier)}; 15 to 25 are good"
            )
        self._check(relative_motions(world_from_carrier, eye_from_target), what_moves)
        refined, used = self._agreeing(world_from_carrier, eye_from_target)
        if not used.all():
            self._check(relative_motions(*_chosen(used, world_from_carrier, eye_from_target)), what_moves)
        residuals = refined.residuals
        return HandEyeResult(
            refined.carrier_from_eye,
            refined.world_from_target,
            refined.covariance,
            np.linalg.norm(residuals[:, :3], axis=1),
            np.linalg.norm(residuals[:, 3:], axis=1),
            tuple(np.flatnonzero(~used).tolist()),
        )

    def _agreeing(
        self, world_from_carrier: Sequence[Pose], eye_from_target: Sequence[Pose]
    ) -> tuple[Refined, NDArray[np.bool_]]:
        """Return the result by the views that agree, with residuals of all, and which these are (N,)."""
        count, poses = len(world_from_carrier), (world_from_carrier, eye_from_target)
        used = np.ones(count, dtype=bool)
        refined, off = self._by(used, *poses)
        if off.max() > self.outlier:
            rng, best = np.random.default_rng(0), off
            for _ in range(self.subsets):
                some = _chosen(rng.permutation(count) < 4, *poses)
                try:
                    end = self.closed_form(relative_motions(*some))
                except (CalibrationError, np.linalg.LinAlgError):
                    continue
                best = min(best, whitened(*poses, end, mean_target(*some, end), self.noise), key=np.median)
            off = best
        for _ in range(5):
            agree = off <= max(self.outlier, self.outlier_ratio * float(np.median(off)))
            if (agree == used).all():
                break
            if agree.sum() < max(self.min_views, 2 * count / 3):
                raise ContradictingViewsError(np.flatnonzero(~agree).tolist(), [str(view) for view in range(count)])
            used = agree
            refined, off = self._by(used, *poses)
        return refined.of_all(*poses), used

    def _by(
        self, used: NDArray[np.bool_], world_from_carrier: Sequence[Pose], eye_from_target: Sequence[Pose]
    ) -> tuple[Refined, NDArray[np.float64]]:
        """Return the result by the views that are used, and how far off all are, in standard deviations (N,)."""
        chosen = _chosen(used, world_from_carrier, eye_from_target)
        start = self.closed_form(relative_motions(*chosen))
        found = refine(*chosen, start, self.noise, move=self.refine)
        ends = found.carrier_from_eye, found.world_from_target
        return found, whitened(world_from_carrier, eye_from_target, *ends, self.noise)

    def _check(self, motions: RelativeMotions, what_moves: str) -> None:
        turns = Rotation.from_matrix(motions.carrier[:, :3, :3]).as_rotvec()
        spread = np.sqrt(np.maximum(np.linalg.eigvalsh(turns.T @ turns / max(len(turns), 1)), 0.0))
        if spread[1] < self.min_second_rotation:
            raise DegenerateMotionError(
                f"the views turn by {math.degrees(spread[2]):.1f}° about one axis but only by "
                f"{math.degrees(spread[1]):.1f}° about any other; turn the {what_moves} by 20° and more about two axes "
                "that are not parallel"
            )
        seen = Rotation.from_matrix(motions.eye[:, :3, :3]).magnitude()
        # Of ten views three may be wrong, which are in more than half of the pairs.
        mismatch = float(np.quantile(np.abs(np.linalg.norm(turns, axis=1) - seen), 0.3))
        if mismatch > self.max_angle_mismatch:
            raise CalibrationError(
                "camera and carrier turn by different angles between the same views (most of them more than "
                f"{math.degrees(mismatch):.1f}° apart): poses and images do not belong together, or the target moved"
            )


def relative_motions(world_from_carrier: Sequence[Pose], eye_from_target: Sequence[Pose]) -> RelativeMotions:
    """Return the motions between all pairs of views, except those with a rotation of nearly half a turn."""
    first, second = np.triu_indices(len(world_from_carrier), 1)
    carriers = np.array([pose.matrix for pose in world_from_carrier])
    seen = np.array([pose.matrix for pose in eye_from_target])
    carrier = np.linalg.inv(carriers[second]) @ carriers[first]
    eye = seen[second] @ np.linalg.inv(seen[first])
    angles = [Rotation.from_matrix(motions[:, :3, :3]).magnitude() for motions in (carrier, eye)]
    usable = np.max(angles, axis=0) < LARGEST_ANGLE
    return RelativeMotions(carrier[usable], eye[usable])


def _chosen(
    used: NDArray[np.bool_], first: Sequence[Pose], second: Sequence[Pose]
) -> tuple[Sequence[Pose], Sequence[Pose]]:
    return list(itertools.compress(first, used)), list(itertools.compress(second, used))


# Hand-eye calibration on the Euclidean group.
# Park & Martin, "Robot sensor calibration: solving AX = XB on the Euclidean group", IEEE Transactions on Robotics and
# Automation 1994.


@dataclass(frozen=True)
class ParkMartin(HandEye):
    """Rotation first, from the logarithms of the motions; then the translation, by linear least squares."""

    @override
    def closed_form(self, motions: RelativeMotions) -> Pose:
        turn_a, turn_b = motions.carrier[:, :3, :3], motions.eye[:, :3, :3]
        alpha, beta = Rotation.from_matrix(turn_a).as_rotvec(), Rotation.from_matrix(turn_b).as_rotvec()
        # alpha = R beta for all pairs: R = (MᵀM)^(-1/2) Mᵀ with M = Σ beta alphaᵀ, by the singular values of M.
        u, _, vt = np.linalg.svd(beta.T @ alpha)
        rotation = vt.T @ np.diag([1.0, 1.0, np.linalg.det(vt.T @ u.T)]) @ u.T
        left = (turn_a - np.eye(3)).reshape(-1, 3)
        right = (motions.eye[:, :3, 3] @ rotation.T - motions.carrier[:, :3, 3]).ravel()
        position = np.linalg.lstsq(left, right, rcond=None)[0]
        return Pose(position, Rotation.from_matrix(rotation).as_quat())


# Hand-eye calibration by dual quaternions.
# Daniilidis, "Hand-eye calibration using dual quaternions", International Journal of Robotics Research 1999.


@dataclass(frozen=True)
class Daniilidis(HandEye):
    """Rotation and translation at once: the dual quaternion of X spans the null space of all motions."""

    @override
    def closed_form(self, motions: RelativeMotions) -> Pose:
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
    """Return the combination of two null vectors whose real part is a unit and normal to its dual part."""
    roots = np.roots([u1 @ v1, u1 @ v2 + u2 @ v1, u2 @ v2])
    ratios = roots.real if len(roots) else np.zeros(1)  # noise can make them complex: the nearest real one then
    lengths = [s * s * (u1 @ u1) + 2.0 * s * (u1 @ u2) + u2 @ u2 for s in ratios]
    best = int(np.argmax(lengths))
    if not lengths[best] > 1e-12:
        raise DegenerateMotionError("the motions leave the camera's rotation undetermined; turn about two axes")
    scale = 1.0 / np.sqrt(lengths[best])
    return scale * (ratios[best] * u1 + u2), scale * (ratios[best] * v1 + v2)


def _dual_quaternions(motions: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return real and dual parts (M, 4) of motions, scalar first and not negative, as the equations of
    a pair require.
    """
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
