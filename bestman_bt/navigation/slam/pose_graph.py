"""Pose graphs in the plane, optimised by Levenberg-Marquardt on sparse matrices.

G. Grisetti, R. Kümmerle, C. Stachniss, W. Burgard, "A tutorial on graph-based SLAM", 2010; loop closures that do not
agree with the rest lose their weight by dynamic covariance scaling (P. Agarwal et al., "Robust map optimization using
dynamic covariance scaling", 2013).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import splu

from bestman_bt.messages import Pose2D, wrap_angle
from bestman_bt.messages.frozen_array import frozen_array
from bestman_bt.messages.shapes import Count, NonNegative, Positive


@dataclass(frozen=True, eq=False)
class Constraint:
    """A measured pose ``relative`` of node ``second`` in the frame of node ``first``.

    ``information``: (3, 3) inverse covariance of x, y, theta in the frame of ``second``. ``doubtful``: whether it may
    be completely wrong, like a loop closure.
    """

    first: int
    second: int
    relative: Pose2D
    information: NDArray[np.float64]
    doubtful: bool = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "information", frozen_array(self.information, (3, 3), "Constraint information"))


@dataclass(eq=False)
class PoseGraph:
    """Nodes are poses in the map frame; node 0 is fixed.

    ``iterations``: largest number; it ends earlier once no coordinate changes by more than ``smallest_step`` (metres,
    radians). ``damping``: initial, relative to the diagonal. ``scaling``: chi square of a doubtful constraint above
    which its weight falls, and ``graduation``: factor by which it is lowered in steps.
    """

    iterations: Count = 20
    smallest_step: Annotated[NonNegative, "m, rad"] = 1e-5
    damping: Positive = 1e-4
    scaling: Positive = 12.0
    graduation: Positive = 10.0

    def __post_init__(self) -> None:
        self._poses: list[tuple[float, float, float]] = []
        self.constraints: list[Constraint] = []

    def __len__(self) -> int:
        return len(self._poses)

    def copy(self) -> PoseGraph:
        """Return a copy with the same nodes and constraints, for another thread."""
        other = replace(self)
        other._poses, other.constraints = list(self._poses), list(self.constraints)
        return other

    def move_to(self, poses: NDArray[np.float64]) -> None:
        """Set the first nodes to ``poses`` (M, 3); later ones move along with the last of them."""
        last = len(poses) - 1
        moved = Pose2D(*poses[last].tolist()) @ self.pose(last).inverse()
        later = [moved @ Pose2D(*pose) for pose in self._poses[last + 1 :]]
        self._poses = [(x, y, theta) for x, y, theta in poses.tolist()]
        for pose in later:
            self.add_pose(pose)

    def add_pose(self, pose: Pose2D) -> int:
        """Add a node with the initial guess ``pose``; returns its number."""
        self._poses.append((pose.x, pose.y, pose.theta))
        return len(self._poses) - 1

    def add_constraint(self, constraint: Constraint) -> None:
        """Add a measurement. Raises ValueError if it names an unknown node, or the same node twice."""
        first, second, count = constraint.first, constraint.second, len(self)
        if first == second or not (0 <= first < count and 0 <= second < count):
            raise ValueError(f"a constraint needs two of the nodes 0 to {count - 1}, got {first} and {second}")
        self.constraints.append(constraint)

    def pose(self, node: int) -> Pose2D:
        """Return the current pose of a node."""
        return Pose2D(*self._poses[node])

    @property
    def poses(self) -> NDArray[np.float64]:
        """All nodes, (N, 3): x, y in metres, theta in radians."""
        return np.array(self._poses).reshape(-1, 3)

    def chi_squares(self) -> NDArray[np.float64]:
        """Return the chi square of each constraint, (M,), at the current poses."""
        edges = ConstraintArrays(self.constraints)
        return edges.chi_squares(edges.errors(self.poses))

    def optimize(self) -> float:
        """Minimise the weighted errors; returns the remaining error.

        Doubtful constraints are trusted at first, and those that contradict the others are gradually down-weighted
        (graduated non-convexity, H. Yang et al. 2020); otherwise good ones would be rejected under large drift. Every
        node must be connected to node 0.
        """
        edges = ConstraintArrays(self.constraints)
        poses = self.poses
        worst = float(edges.chi_squares(edges.errors(poses))[edges.doubtful].max(initial=0.0))
        scaling = max(self.scaling, worst)
        while True:
            poses, cost = self._descend(poses, edges, scaling)
            if scaling == self.scaling:
                break
            scaling = max(self.scaling, scaling / self.graduation)
        self._poses = [(float(x), float(y), wrap_angle(float(theta))) for x, y, theta in poses]
        return cost

    def _descend(
        self, poses: NDArray[np.float64], edges: ConstraintArrays, scaling: float
    ) -> tuple[NDArray[np.float64], float]:
        """Minimise with Levenberg-Marquardt; return the final poses and their cost."""
        cost = edges.cost(edges.errors(poses), scaling)
        damping = self.damping
        for _ in range(self.iterations):
            hessian, gradient = edges.normal_equations(poses, scaling)
            diagonal = sparse.diags(damping * hessian.diagonal())
            step = splu((hessian + diagonal).tocsc()).solve(-gradient)
            moved = poses.copy()
            moved[1:] += step.reshape(-1, 3)
            moved_cost = edges.cost(edges.errors(moved), scaling)
            if moved_cost > cost:
                damping *= 10.0
                continue
            poses, cost, damping = moved, moved_cost, damping / 10.0
            if float(np.abs(step).max()) < self.smallest_step:
                break
        return poses, cost

    def relative_covariance(self, first: int, second: int) -> NDArray[np.float64]:
        """Return the covariance (3, 3) of ``second`` relative to ``first``: x, y, theta in the frame of ``second``."""
        poses = self.poses
        hessian, _ = ConstraintArrays(self.constraints).normal_equations(poses, self.scaling)
        # Node 0 is no unknown; the relative pose depends on both nodes by the Jacobian of a constraint between them.
        edge = ConstraintArrays([Constraint(first, second, self.pose(first).inverse() @ self.pose(second), np.eye(3))])
        by_first, by_second = edge.jacobians(poses)
        jacobian = np.zeros((3, 3 * len(poses)))
        jacobian[:, 3 * first : 3 * first + 3] = by_first[0]
        jacobian[:, 3 * second : 3 * second + 3] = by_second[0]
        unknown = jacobian[:, 3:]
        covariance: NDArray[np.float64] = unknown @ splu(hessian.tocsc()).solve(unknown.T.copy())
        return covariance


class ConstraintArrays:
    """Constraints as arrays; errors e are x, y, theta of (first⁻¹ second) as seen from ``relative``."""

    def __init__(self, constraints: list[Constraint]) -> None:
        self.first = np.array([c.first for c in constraints], dtype=np.intp)
        self.second = np.array([c.second for c in constraints], dtype=np.intp)
        self.relative = np.array([(c.relative.x, c.relative.y, c.relative.theta) for c in constraints]).reshape(-1, 3)
        self.information = np.array([c.information for c in constraints]).reshape(-1, 3, 3)
        self.doubtful = np.array([c.doubtful for c in constraints], dtype=bool)

    def errors(self, poses: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the errors (M, 3) at poses (N, 3)."""
        between = poses[self.second] - poses[self.first]
        across = _turned(between[:, :2], -poses[self.first, 2])
        position = _turned(across - self.relative[:, :2], -self.relative[:, 2])
        angle = between[:, 2] - self.relative[:, 2]
        return np.column_stack([position, (angle + np.pi) % (2.0 * np.pi) - np.pi])

    def chi_squares(self, errors: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the squared Mahalanobis norms (M,) of errors (M, 3): x, y, theta."""
        squares: NDArray[np.float64] = np.einsum("ni,nij,nj->n", errors, self.information, errors)
        return squares

    def cost(self, errors: NDArray[np.float64], scaling: float) -> float:
        """Return the sum of the robust cost whose weights are those of ``_weights``."""
        chi = self.chi_squares(errors)
        robust = scaling * (3.0 * chi - scaling) / (chi + scaling)
        return float(np.where(self.doubtful & (chi > scaling), robust, chi).sum())

    def jacobians(self, poses: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the Jacobians of the errors by the poses of ``first`` and ``second``, (M, 3, 3) each."""
        heading = poses[self.first, 2] + self.relative[:, 2]
        cos, sin = np.cos(heading), np.sin(heading)
        between = poses[self.second, :2] - poses[self.first, :2]
        by_second = np.zeros((len(self.first), 3, 3))
        by_second[:, 0, 0], by_second[:, 0, 1] = cos, sin
        by_second[:, 1, 0], by_second[:, 1, 1] = -sin, cos
        by_second[:, 2, 2] = 1.0
        by_first = -by_second
        by_first[:, 0, 2] = -sin * between[:, 0] + cos * between[:, 1]
        by_first[:, 1, 2] = -cos * between[:, 0] - sin * between[:, 1]
        return by_first, by_second

    def normal_equations(
        self, poses: NDArray[np.float64], scaling: float
    ) -> tuple[sparse.csr_matrix, NDArray[np.float64]]:
        """Return Hessian and gradient without the coordinates of node 0."""
        errors = self.errors(poses)
        information = self.information * self._weights(errors, scaling)[:, None, None]
        jacobians = self.jacobians(poses)
        ends = (self.first, self.second)
        weighted = [information @ jacobian for jacobian in jacobians]
        size = 3 * len(poses)
        gradient = np.zeros((len(poses), 3))
        rows, columns, values = [], [], []
        for end, jacobian in zip(ends, jacobians, strict=True):
            np.add.at(gradient, end, np.einsum("nij,nik,nk->nj", jacobian, information, errors))
            for other, product in zip(ends, weighted, strict=True):
                block = np.swapaxes(jacobian, 1, 2) @ product
                row, column = np.broadcast_arrays(
                    (3 * end[:, None] + np.arange(3))[:, :, None], (3 * other[:, None] + np.arange(3))[:, None, :]
                )
                rows.append(row.ravel())
                columns.append(column.ravel())
                values.append(block.ravel())
        entries = (np.concatenate(values), (np.concatenate(rows), np.concatenate(columns)))
        hessian = sparse.coo_matrix(entries, shape=(size, size)).tocsr()
        return hessian[3:, 3:], gradient.ravel()[3:]

    def _weights(self, errors: NDArray[np.float64], scaling: float) -> NDArray[np.float64]:
        """Return 1, or for a doubtful constraint the square of its scale, min(1, 2 Φ / (Φ + χ²))²."""
        scale = np.minimum(1.0, 2.0 * scaling / (scaling + self.chi_squares(errors)))
        return np.where(self.doubtful, scale**2, 1.0)


def _turned(vectors: NDArray[np.float64], angles: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return vectors (N, 2), each turned by its angle (N,)."""
    cos, sin = np.cos(angles), np.sin(angles)
    return np.column_stack([cos * vectors[:, 0] - sin * vectors[:, 1], sin * vectors[:, 0] + cos * vectors[:, 1]])
