"""Arrays of tool frames: creation around closing axes, removal of similar ones, and points in each frame."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import Handle, Pose


def handle_motion(handle: Handle, distance: float) -> Pose:
    """Return the rigid motion that moves the handle by ``distance`` metres along its path, in the frame of ``handle``.

    ``handle_motion(handle, d) @ pose`` is the pose of a point of the moving part after the motion. The path is an arc
    if joint and hinge are known, else the initial line of motion.
    """
    if handle.joint == "revolute" and handle.hinge is not None and handle.hinge_direction is not None:
        axis = handle.hinge_direction
        arm = handle.pose.position - handle.hinge
        way = np.cross(axis, arm)
        radius = float(np.linalg.norm(way))
        if radius > 1e-3:
            angle = distance / radius * (1.0 if float(way @ handle.opening_direction) >= 0.0 else -1.0)
            turn = Pose(np.zeros(3), np.append(np.sin(angle / 2) * axis, np.cos(angle / 2)))
            return Pose(handle.hinge) @ turn @ Pose(-handle.hinge)
    return Pose(distance * handle.opening_direction)


# Points times hands that one pass may hold: arrays that fit into a core's cache are several times faster.
_PASS = 60_000


@dataclass(frozen=True, eq=False)
class HandPoses:
    """K tool frames: ``rotations`` (K, 3, 3) with columns (across, closing, approach), ``positions`` (K, 3) metres."""

    rotations: NDArray[np.float64]
    positions: NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.positions)

    def selected(self, index: NDArray[np.bool_] | NDArray[np.intp] | slice) -> HandPoses:
        """Return the poses that ``index`` (mask, indices or slice) selects."""
        return HandPoses(self.rotations[index], self.positions[index])

    def passes(self, points: int) -> list[slice]:
        """Return slices of the poses, each small enough that ``points`` points in their frames fit into memory."""
        step = max(1, _PASS // max(points, 1))
        return [slice(start, start + step) for start in range(0, len(self), step)]

    def local(self, points: NDArray[np.float64]) -> tuple[NDArray[np.float64], ...]:
        """Return x, y and z of ``points`` (N, 3) in each tool frame, (K, N) each."""
        offsets = np.einsum("kij,ki->kj", self.rotations, self.positions)
        return tuple(self.rotations[:, :, axis] @ points.T - offsets[:, axis, None] for axis in range(3))

    def pose(self, index: int) -> Pose:
        """Return one pose, frame_from_tool."""
        matrix = np.eye(4)
        matrix[:3, :3], matrix[:3, 3] = self.rotations[index], self.positions[index]
        return Pose.from_matrix(matrix)

    def shifted(self, distances: NDArray[np.float64], axis: int) -> HandPoses:
        """Return the poses moved by ``distances`` (K,), metres, along their own ``axis``: 0 across, 1 closing, 2
        approach.
        """
        return HandPoses(self.rotations, self.positions + self.rotations[:, :, axis] * distances[:, None])


def hands_about(middles: NDArray[np.float64], closing: NDArray[np.float64], angles: NDArray[np.float64]) -> HandPoses:
    """Return P * A hands at ``middles`` (P, 3) that close along unit ``closing`` (P, 3), rotated about it by ``angles``
    (A,).

    At angle 0 the approach is as vertical as possible. The hands of one middle are adjacent.
    """
    down = np.array([0.0, 0.0, -1.0]) + closing * closing[:, 2:3]
    upright = np.linalg.norm(down, axis=1) < 1e-3
    down[upright] = np.array([1.0, 0.0, 0.0])
    down /= np.linalg.norm(down, axis=1)[:, None]
    beside = np.cross(closing, down)
    approach = np.cos(angles)[None, :, None] * down[:, None, :] + np.sin(angles)[None, :, None] * beside[:, None, :]
    approach = approach.reshape(-1, 3)
    repeated = np.repeat(closing, len(angles), axis=0)
    rotations = np.stack([np.cross(repeated, approach), repeated, approach], axis=2)
    return HandPoses(rotations, np.repeat(middles, len(angles), axis=0))


def different_hands(
    hands: HandPoses, order: NDArray[np.intp], count: int, apart: float, apart_angle: float
) -> list[int]:
    """Return the first ``count`` of ``order`` (indices, best first) that are not close to a hand chosen before.

    Close: less than ``apart`` metres and less than ``apart_angle`` radians away.
    """
    chosen: list[int] = []
    for index in order:
        taken = hands.selected(np.array(chosen, dtype=np.intp))
        near = np.linalg.norm(taken.positions - hands.positions[index], axis=1) < apart
        cosine = (np.einsum("kij,ij->k", taken.rotations, hands.rotations[index]) - 1.0) / 2.0
        if not np.any(near & (np.arccos(np.clip(cosine, -1.0, 1.0)) < apart_angle)):
            chosen.append(int(index))
            if len(chosen) == count:
                break
    return chosen
