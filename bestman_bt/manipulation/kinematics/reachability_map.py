"""The capability map of an arm: which tool positions it reaches from which directions, and how nimbly.

Zacharias, Borst and Hirzinger, "Capturing robot workspace structure: representing robot capabilities", IROS 2007,
filled from sampled joint positions instead of inverse kinematics.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bestman_bt.manipulation.errors import ManipulationError
from bestman_bt.manipulation.joint_values import JointLimits
from bestman_bt.manipulation.kinematics.base import InverseKinematics
from bestman_bt.manipulation.kinematics.screw_chain import ScrewChain
from bestman_bt.messages.bounds import Count, Positive


@dataclass(frozen=True)
class ReachabilitySampling:
    """Fills reachability maps from random joint positions.

    ``voxel``: metres. ``directions``: approach directions, evenly over the sphere. ``samples``: joint positions.

    ``plenty``: samples in a cell at which it counts as fully reachable. ``seed``: of the samples.
    """

    voxel: Positive = 0.08
    directions: Count = 32
    samples: Count = 500_000
    plenty: Count = 6
    seed: int = 0

    def build(self, kinematics: InverseKinematics, limits: JointLimits) -> ReachabilityMap:
        """Fill a map from joint positions drawn evenly within ``limits``; it takes seconds.

        Equal input gives an equal map. The samples know nothing of self-collision: the map ranks, inverse kinematics
        decides.
        """
        shoulder, reach = kinematics.reach
        side = int(np.ceil(2.0 * reach / self.voxel))
        origin = shoulder - 0.5 * side * self.voxel
        directions = even_directions(self.directions)
        cells = side**3 * len(directions)
        counts, nimble = np.zeros(cells, np.int64), np.zeros(cells, np.float32)
        chain = ScrewChain.of(kinematics)
        rng = np.random.default_rng(self.seed)
        batch = 20_000
        for done in range(0, self.samples, batch):
            size = min(batch, self.samples - done)
            positions, approaches, measures = chain.reach(rng.uniform(limits.lower, limits.upper, (size, chain.joints)))
            voxels = np.clip(np.floor((positions - origin) / self.voxel).astype(int), 0, side - 1)
            aims = np.argmax(approaches @ directions.T, axis=1)
            index = np.ravel_multi_index((*voxels.T, aims), (side, side, side, len(directions)))
            counts += np.bincount(index, minlength=cells)
            np.maximum.at(nimble, index, measures.astype(np.float32))
        shape = (side, side, side, len(directions))
        return ReachabilityMap(
            origin,
            self.voxel,
            directions,
            np.minimum(counts, np.iinfo(np.uint16).max).astype(np.uint16).reshape(shape),
            nimble.reshape(shape),
            self.plenty,
        )


@dataclass(frozen=True, eq=False)
class ReachabilityMap:
    """Cells of tool positions × approach directions (the tool's z axis), in the robot's base frame.

    ``origin``: (3,) metres, the lowest corner. ``directions``: (D, 3) unit vectors. ``counts``: (X, Y, Z, D) samples
    that fell into each cell. ``manipulability``: (X, Y, Z, D), the largest of Yoshikawa's measure among them.
    """

    origin: NDArray[np.float64]
    voxel: float
    directions: NDArray[np.float64]
    counts: NDArray[np.uint16]
    manipulability: NDArray[np.float32]
    plenty: int

    def score(self, positions: ArrayLike, approaches: ArrayLike) -> NDArray[np.float64]:
        """How well tool poses are reached, (N,), 0 (never seen) to 1, for ``positions`` and ``approaches`` (N, 3).

        The two directions next to the approach are averaged, and neighbouring voxels interpolated.
        """
        points, aims = _vectors(positions, "positions"), _vectors(approaches, "approaches")
        likeness = aims @ self.directions.T
        nearest = np.argsort(-likeness, axis=1)[:, :2]
        weights = np.maximum(np.take_along_axis(likeness, nearest, axis=1), 0.0)
        weights /= np.maximum(weights.sum(axis=1, keepdims=True), 1e-9)
        place = (points - self.origin) / self.voxel - 0.5
        low = np.floor(place).astype(int)
        share = place - low
        total = np.zeros(len(points))
        for corner in np.ndindex(2, 2, 2):
            weight = np.prod(np.where(corner, share, 1.0 - share), axis=1)
            total += weight * (self._cells(low + corner, nearest) * weights).sum(axis=1)
        return total

    def dexterity(self, positions: ArrayLike) -> NDArray[np.float64]:
        """Share of the approach directions from which each of ``positions`` (N, 3) is reached, (N,)."""
        points = _vectors(positions, "positions")
        index, inside = self._voxels(np.floor((points - self.origin) / self.voxel).astype(int))
        return np.where(inside, (self.counts[tuple(index.T)] > 0).mean(axis=1), 0.0)

    def _cells(self, voxels: NDArray[np.intp], directions: NDArray[np.intp]) -> NDArray[np.float64]:
        index, inside = self._voxels(voxels)
        x, y, z = index.T[:, :, None]
        filled = np.minimum(self.counts[x, y, z, directions] / self.plenty, 1.0)
        nimble = self.manipulability[x, y, z, directions] / max(float(self.manipulability.max()), 1e-9)
        return np.where(inside[:, None], filled * (0.5 + 0.5 * nimble), 0.0)

    def _voxels(self, voxels: NDArray[np.intp]) -> tuple[NDArray[np.intp], NDArray[np.bool_]]:
        highest = np.array(self.counts.shape[:3]) - 1
        inside = np.all((voxels >= 0) & (voxels <= highest), axis=1)
        return np.clip(voxels, 0, highest), inside


def even_directions(count: int) -> NDArray[np.float64]:
    """``count`` unit vectors, (count, 3), evenly over the sphere (Fibonacci's spiral)."""
    number = np.arange(count) + 0.5
    height = 1.0 - 2.0 * number / count
    turn = np.pi * (1.0 + 5.0**0.5) * number
    radius = np.sqrt(1.0 - height**2)
    return np.stack([radius * np.cos(turn), radius * np.sin(turn), height], axis=1)


def _vectors(values: ArrayLike, what: str) -> NDArray[np.float64]:
    array = np.array(values, dtype=float)
    if array.ndim != 2 or array.shape[1] != 3 or not np.isfinite(array).all():
        raise ManipulationError(f"{what} should be (N, 3) and finite but have shape {array.shape}")
    return array
