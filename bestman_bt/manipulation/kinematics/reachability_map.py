"""The capability map of an arm: the reachable tool positions and directions, with manipulability.

Zacharias, Borst and Hirzinger, "Capturing robot workspace structure: representing robot capabilities", IROS 2007,
filled from sampled joint positions instead of inverse kinematics.
"""

from __future__ import annotations

import hashlib
import logging
import os
import tempfile
import zipfile
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bestman_bt.manipulation.errors import ManipulationError
from bestman_bt.manipulation.joint_values import JointLimits
from bestman_bt.manipulation.kinematics.base import InverseKinematics
from bestman_bt.messages.shapes import Count, Positive

# Forward kinematics of many joint positions at once, by the product of exponentials.
# Brockett, "Robotic manipulators and the product of exponentials formula", 1984.


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
        """Build the chain from an arm's Jacobian at joint positions zero, in the base frame."""
        zero = np.zeros(len(kinematics.joint_names))
        tool = kinematics.tool_pose(zero)
        jacobian = kinematics.jacobian(zero)
        angular = tool.rotation @ jacobian[3:]
        linear = tool.rotation @ jacobian[:3] - np.cross(angular.T, tool.position).T
        return cls(np.vstack([linear, angular]).T, tool.rotation, tool.position)

    @property
    def joints(self) -> int:
        """The number of joints."""
        return len(self.screws)

    def reach(
        self, positions: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Return tool positions (N, 3), tool z axes (N, 3), manipulabilities (N,) at (N, n) joint positions."""
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
    """Return the exponential of a unit screw at ``angles`` (N,): rotations (N, 3, 3) and translations (N, 3)."""
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


@dataclass(frozen=True)
class ReachabilitySampling:
    """Fills reachability maps from random joint positions.

    ``voxel``: metres. ``directions``: number of approach directions, uniform on the sphere. ``samples``: joint
    positions. ``plenty``: samples in a cell from which it counts as fully reachable. ``seed``: of the samples.
    """

    voxel: Positive = 0.08
    directions: Count = 32
    samples: Count = 500_000
    plenty: Count = 6
    seed: int = 0

    def build(self, kinematics: InverseKinematics, limits: JointLimits) -> ReachabilityMap:
        """Build a map from joint positions drawn evenly within ``limits``, radians; takes seconds.

        Equal input gives an equal map. Self-collisions are ignored: use the map to rank poses, and inverse kinematics
        to check them.
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
    per cell. ``manipulability``: (X, Y, Z, D), the largest of Yoshikawa's measure per cell.
    """

    origin: NDArray[np.float64]
    voxel: float
    directions: NDArray[np.float64]
    counts: NDArray[np.uint16]
    manipulability: NDArray[np.float32]
    plenty: int

    def score(self, positions: ArrayLike, approaches: ArrayLike) -> NDArray[np.float64]:
        """Return the reachability, (N,), 0 to 1, of tool poses with ``positions`` and ``approaches`` (N, 3).

        The two nearest directions are averaged, and neighbouring voxels interpolated.
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
    """Return ``count`` unit vectors, (count, 3), uniform on the sphere (Fibonacci spiral)."""
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


_VERSION = 1
_LOG = logging.getLogger(__name__)
_FIELDS = ("origin", "voxel", "directions", "counts", "manipulability", "plenty")


def reachability_map(
    kinematics: InverseKinematics,
    limits: JointLimits,
    sampling: ReachabilitySampling | None = None,
    folder: Path | None = None,
) -> ReachabilityMap:
    """Return the map of an arm from ``folder`` (default: the user's cache), else build and save it.

    ``kinematics``: with a ``fingerprint``. An unreadable file is rebuilt; an unwritable folder only costs time at the
    next start.
    """
    sampling = sampling or ReachabilitySampling()
    file = (folder or cache_folder()) / f"reachability-{_key(kinematics, sampling)}.npz"
    stored = _read(file)
    if stored is not None:
        return stored
    built = sampling.build(kinematics, limits)
    _write(file, built)
    return built


def cache_folder() -> Path:
    """Return ``$XDG_CACHE_HOME/bestman-bt``, or ``~/.cache/bestman-bt``."""
    home = os.environ.get("XDG_CACHE_HOME")
    return (Path(home) if home else Path.home() / ".cache") / "bestman-bt"


def _key(kinematics: InverseKinematics, sampling: ReachabilitySampling) -> str:
    content = (_VERSION, kinematics.fingerprint, sorted(asdict(sampling).items()))
    return hashlib.sha256(repr(content).encode()).hexdigest()[:24]


def _read(file: Path) -> ReachabilityMap | None:
    if not file.is_file():
        return None
    try:
        with np.load(file, allow_pickle=False) as stored:
            values = {name: stored[name] for name in _FIELDS}
        found = ReachabilityMap(
            values["origin"],
            float(values["voxel"]),
            values["directions"],
            values["counts"],
            values["manipulability"],
            int(values["plenty"]),
        )
        if found.counts.ndim != 4 or found.counts.shape != found.manipulability.shape:
            raise ValueError(f"its arrays have the shapes {found.counts.shape} and {found.manipulability.shape}")
    except (OSError, ValueError, KeyError, TypeError, EOFError, zipfile.BadZipFile) as error:
        _LOG.warning("the stored reachability map %s cannot be used and is built again: %s", file, error)
        return None
    return found


def _write(file: Path, built: ReachabilityMap) -> None:
    """Write in one step, so that another process never reads a partial file."""
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile(dir=file.parent, suffix=".npz", delete=False) as part:
            np.savez_compressed(
                part,
                origin=built.origin,
                voxel=built.voxel,
                directions=built.directions,
                counts=built.counts,
                manipulability=built.manipulability,
                plenty=built.plenty,
            )
        Path(part.name).replace(file)
    except OSError as error:
        _LOG.warning("the reachability map cannot be stored as %s: %s", file, error)
