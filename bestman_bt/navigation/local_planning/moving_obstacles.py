"""Moving obstacles such as people: clusters of hits, tracked with their velocity."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from bestman_bt.messages.shapes import NonNegative, NotBelow, Positive, check_bounds


@dataclass(frozen=True)
class MovingObstacle:
    """A disc: its middle (m, map frame), velocity (m/s, map frame) and radius (m)."""

    x: float
    y: float
    vx: float
    vy: float
    radius: float


@dataclass(eq=False)
class MovingObstacles:
    """Constant-velocity Kalman filters, one per cluster, with nearest-neighbour assignment (Hungarian algorithm).

    Lengths in metres, times in seconds, speeds in m/s.

    ``gap``: between neighbouring hits of two clusters. ``max_size``: of a moving cluster. ``gate``: largest distance
    from its prediction. ``acceleration``: m/s², standard deviation of a walker's acceleration, ``position_std``: error
    of a cluster's middle. ``min_speed``, ``min_sigma``: smallest speed of a moving track, absolute and in standard
    deviations, after ``min_distance``; below half of ``min_speed`` it counts as static. ``forget``: time unseen,
    ``forget_hidden``: time too close to be seen, before a track is dropped. ``max_speed``: upper bound.
    """

    gap: Annotated[Positive, "m"] = 0.2
    max_size: Annotated[Positive, "m"] = 0.9
    gate: Annotated[Positive, "m"] = 0.4
    acceleration: Annotated[Positive, "m/s²"] = 0.7
    position_std: Annotated[Positive, "m"] = 0.04
    min_speed: Annotated[NonNegative, "m/s"] = 0.12
    min_sigma: NonNegative = 1.5
    min_distance: Annotated[NonNegative, "m"] = 0.10
    forget: Annotated[NonNegative, "s"] = 0.8
    forget_hidden: Annotated[NonNegative, "s"] = 3.0
    max_speed: Annotated[Positive, NotBelow("min_speed"), "m/s"] = 2.0

    def __post_init__(self) -> None:
        check_bounds(self)
        self._tracks: list[_Track] = []
        self.obstacles: list[MovingObstacle] = []
        """Moving obstacles, as of the last scan."""
        self.walkers: list[MovingObstacle] = []
        """Those, and those that have moved before they came to stand: people, who are tall."""

    def update(
        self, hits: NDArray[np.float64], lidar: NDArray[np.float64], range_min: float, stamp: float
    ) -> NDArray[np.float64]:
        """Process hits (N, 2) in the order of the beams, seen from ``lidar`` (2,); return the static ones.

        ``range_min``: metres below which the lidar has no hits.
        """
        clusters = _clusters(hits, self.gap)
        small = [c for c in clusters if len(c) >= 3 and np.linalg.norm(np.ptp(hits[c], axis=0)) <= self.max_size]
        discs = [_disc(hits[c], lidar) for c in small]
        for track in self._tracks:
            track.predict(stamp, self.acceleration)
        cluster_of = self._associate(discs)
        moving_hits = np.zeros(len(hits), dtype=bool)
        for number, cluster in cluster_of.items():
            self._tracks[number].correct(discs[cluster], stamp, self.position_std)
        for index, disc in enumerate(discs):
            if index not in cluster_of.values():
                self._tracks.append(_Track(disc, stamp))
                cluster_of[len(self._tracks) - 1] = index
        self.obstacles, self.walkers = [], []
        for index, track in enumerate(self._tracks):
            moves = track.moves(self)
            if track.has_moved:
                self.walkers.append(track.obstacle())
            if not moves:
                continue
            self.obstacles.append(track.obstacle())
            if index in cluster_of:
                moving_hits[small[cluster_of[index]]] = True
        self._tracks = [
            track for track in self._tracks if stamp - track.seen <= self._patience(track, lidar, range_min)
        ]
        return hits[~moving_hits]

    def _patience(self, track: _Track, lidar: NDArray[np.float64], range_min: float) -> float:
        near_side = float(np.linalg.norm(track.state[:2] - lidar)) - track.radius
        return self.forget_hidden if near_side < range_min + 0.05 else self.forget

    def _associate(self, discs: list[NDArray[np.float64]]) -> dict[int, int]:
        """Track → cluster."""
        if not self._tracks or not discs:
            return {}
        places = np.array([track.state[:2] for track in self._tracks])
        distances = np.linalg.norm(places[:, None] - np.array(discs)[None, :, :2], axis=-1)
        rows, columns = linear_sum_assignment(np.minimum(distances, 1.0))
        near = distances[rows, columns] < self.gate
        return {int(r): int(c) for r, c in zip(rows[near], columns[near], strict=True)}


class _Track:
    """State (x, y, vx, vy) and its covariance."""

    def __init__(self, disc: NDArray[np.float64], stamp: float) -> None:
        self.state = np.array([disc[0], disc[1], 0.0, 0.0])
        self.covariance = np.diag([0.05**2, 0.05**2, 0.5**2, 0.5**2])
        self.radius = float(disc[2])
        self.first = self.state[:2].copy()
        self.seen = self._stamp = stamp
        self._moves = self.has_moved = False

    def predict(self, stamp: float, acceleration: float) -> None:
        dt = max(0.0, stamp - self._stamp)
        self._stamp = stamp
        step = np.eye(4)
        step[0, 2] = step[1, 3] = dt
        noise = np.array([[dt**4 / 4, dt**3 / 2], [dt**3 / 2, dt**2]]) * acceleration**2
        self.state = step @ self.state
        self.covariance = step @ self.covariance @ step.T + np.kron(noise, np.eye(2))

    def correct(self, disc: NDArray[np.float64], stamp: float, std: float) -> None:
        expected = self.covariance[:2, :2] + std**2 * np.eye(2)
        gain = self.covariance[:, :2] @ np.linalg.inv(expected)
        self.state = self.state + gain @ (disc[:2] - self.state[:2])
        self.covariance = self.covariance - gain @ self.covariance[:2]
        self.radius += 0.3 * (float(disc[2]) - self.radius)
        self.seen = stamp

    def moves(self, p: MovingObstacles) -> bool:
        speed = float(np.hypot(*self.state[2:]))
        if self._moves:
            self._moves = p.min_speed / 2.0 < speed < p.max_speed
            return self._moves
        sigma = math.sqrt(float(np.trace(self.covariance[2:, 2:])) / 2.0)
        far = float(np.linalg.norm(self.state[:2] - self.first)) > p.min_distance
        self._moves = far and p.min_speed < speed < p.max_speed and speed > p.min_sigma * sigma
        self.has_moved |= self._moves
        return self._moves

    def obstacle(self) -> MovingObstacle:
        x, y, vx, vy = self.state.tolist()
        return MovingObstacle(x, y, vx, vy, self.radius)


def _clusters(hits: NDArray[np.float64], gap: float) -> list[NDArray[np.intp]]:
    """Return runs of neighbouring hits; the last and the first are neighbours, too."""
    if len(hits) < 2:
        return [np.arange(len(hits))] if len(hits) else []
    breaks = np.flatnonzero(np.linalg.norm(np.diff(hits, axis=0), axis=1) > gap) + 1
    runs = np.split(np.arange(len(hits)), breaks)
    if len(runs) > 1 and np.linalg.norm(hits[0] - hits[-1]) <= gap:
        runs = [np.concatenate([runs[-1], runs[0]]), *runs[1:-1]]
    return runs


def _disc(hits: NDArray[np.float64], lidar: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return x, y and radius of the disc whose near side the hits are; the radius follows from its
    width in the view.
    """
    away = hits.mean(axis=0) - lidar
    distance = max(float(np.linalg.norm(away)), 1e-6)
    away = away / distance
    across = (hits - lidar) @ np.array([-away[1], away[0]])
    radius = float(np.clip((across.max() - across.min()) / 2.0, 0.05, 0.45))
    # The hits on the near half of a disc lie a quarter of pi times the radius before its middle, in the mean.
    return np.array([*(lidar + away * (distance + radius * math.pi / 4.0)), radius])
