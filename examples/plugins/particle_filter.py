"""Adaptive Monte Carlo localisation, as nav2's AMCL does it (Thrun, Burgard, Fox, Probabilistic Robotics, 8.3).

Particles move as the odometry may have, are weighed by the likelihood field of the map (6.4) and are drawn anew with
low variance, as many as KLD-sampling asks for. When scans fit worse than they used to (augmented MCL), some are drawn
from the whole floor instead, and of those the ones that the scan speaks for (mixture MCL, S. Thrun et al. 2001).

Chosen by ``algorithms: {localization: {algorithm: "examples/plugins/particle_filter.py:ParticleFilter"}}``;
``docs/localisation.md`` has its figures.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import LaserScan, Pose2D, wrap_angle
from bestman_bt.messages.shapes import (
    Count,
    Fraction,
    NonNegative,
    NonNegativeInt,
    NotBelow,
    Positive,
    PositiveFraction,
    check_bounds,
)
from bestman_bt.navigation.localization.base import LocalizationEstimate, Localizer, ScanMatch
from bestman_bt.navigation.localization.correlative_search import DistanceField
from bestman_bt.navigation.localization.map_lines import PlanarMap


@dataclass(frozen=True)
class KldSampling:
    """``error``: allowed Kullback-Leibler distance, ``quantile``: of the normal distribution, for its probability.

    ``bin_size`` metres, ``bin_angle`` radians: of the bins that the particles occupy. ``fewest``, ``most``: particles.
    """

    error: Positive = 0.02
    quantile: Positive = 2.33
    bin_size: Annotated[Positive, "m"] = 0.25
    bin_angle: Annotated[Positive, "rad"] = math.radians(10.0)
    fewest: Count = 500
    most: Annotated[Count, NotBelow("fewest")] = 20000

    def __post_init__(self) -> None:
        check_bounds(self)

    def bins(self, poses: NDArray[np.float64]) -> NDArray[np.int64]:
        """A number for the bin in which each of ``poses`` (N, 3) of x, y, theta lies, (N,)."""
        column, row = np.floor(poses[:, :2].T / self.bin_size).astype(np.int64)
        turn = np.floor(poses[:, 2] % (2.0 * math.pi) / self.bin_angle).astype(np.int64)
        numbers: NDArray[np.int64] = ((column + 2**19) * 2**20 + row + 2**19) * 2**10 + turn
        return numbers

    def enough(self, occupied: int) -> int:
        """Particles that a distribution over so many occupied bins needs."""
        if occupied < 2:
            return self.fewest
        k = occupied - 1
        part = 2.0 / (9.0 * k)
        count = k / (2.0 * self.error) * (1.0 - part + math.sqrt(part) * self.quantile) ** 3
        return min(max(math.ceil(count), self.fewest), self.most)


@dataclass(frozen=True)
class OdometryMotion:
    """Standard deviations, in radians and metres per radian turned and metre driven.

    ``still_turn`` (radians) and ``still_drive`` (metres) are added to every step: they keep particles from becoming
    one.
    """

    turn_per_turn: Annotated[NonNegative, "rad/rad"] = 0.12
    turn_per_metre: Annotated[NonNegative, "rad/m"] = 0.08
    drive_per_metre: Annotated[NonNegative, "m/m"] = 0.12
    drive_per_turn: Annotated[NonNegative, "m/rad"] = 0.01
    still_turn: Annotated[NonNegative, "rad"] = 0.002
    still_drive: Annotated[NonNegative, "m"] = 0.002

    def sample(self, poses: NDArray[np.float64], moved: Pose2D, rng: np.random.Generator) -> NDArray[np.float64]:
        """Where each of ``poses`` (N, 3) of x, y, theta may be after ``moved`` by the odometry, in the base frame."""
        drive = math.hypot(moved.x, moved.y)
        # A step too short to have a direction is none; the noise of a standing base must not turn it about.
        first = math.atan2(moved.y, moved.x) if drive > 1e-3 else 0.0
        second = wrap_angle(moved.theta - first)
        # Backwards, the turns are those to the opposite direction: small, and so is their noise.
        turn_1, turn_2 = (min(abs(turn), abs(wrap_angle(turn - math.pi))) for turn in (first, second))
        std_1 = self.turn_per_turn * turn_1 + self.turn_per_metre * drive + self.still_turn
        std_2 = self.turn_per_turn * turn_2 + self.turn_per_metre * drive + self.still_turn
        std_drive = self.drive_per_metre * drive + self.drive_per_turn * (turn_1 + turn_2) + self.still_drive
        noise = rng.standard_normal((3, len(poses)))
        heading = poses[:, 2] + first + std_1 * noise[0]
        driven = drive + std_drive * noise[1]
        moved_poses = np.empty_like(poses)
        moved_poses[:, 0] = poses[:, 0] + driven * np.cos(heading)
        moved_poses[:, 1] = poses[:, 1] + driven * np.sin(heading)
        moved_poses[:, 2] = heading + second + std_2 * noise[2]
        return moved_poses


@dataclass(frozen=True, eq=False)
class ParticleEstimate(LocalizationEstimate):
    """``particles``: the poses (N, 3) of x, y, theta that are thought possible, equally likely, in the map frame.

    They are those at ``moved_at``, in the ``odom`` frame, where the base was believed at ``place``; ``odometry``: the
    odometry pose since. ``searching``: whether they are spread over many places. ``slow``, ``fast``: averages of how
    well scans fit. ``rng``: of the drawing.
    """

    particles: NDArray[np.float64] = field(kw_only=True)
    place: Pose2D = field(kw_only=True)
    moved_at: Pose2D = field(kw_only=True)
    odometry: Pose2D = field(kw_only=True)
    searching: bool = field(kw_only=True)
    slow: float = field(kw_only=True)
    fast: float = field(kw_only=True)
    rng: np.random.Generator = field(kw_only=True)


@dataclass(frozen=True, eq=False)
class ParticleFilter(Localizer):
    """AMCL: tracks from a known pose, finds itself from an unknown one, recovers when it has been carried off.

    Lengths in metres.

    ``beams``: of a scan that are looked at. ``hit_std``: of where they meet what the map has, and ``search_hit_std``
    while the particles are spread over many places and so none of them is quite right; ``random``: share of beams that
    meet anything else. ``independent_beams``: as how many independent measurements they count.
    ``resolution``: of the field. ``good_fit``: likelihood of a hit where the base is known, as both averages of it
    begin: a place that fits worse is doubted from the start. ``slow``, ``fast``: how quickly they follow, per scan;
    ``candidates``: poses on the floor from which those that replace particles are drawn. ``unknown_std``: a first pose
    less certain than that is no pose at all, and the particles are spread over the floor. A scan is accepted where at
    least ``sure`` of the weight lies within ``place_radius`` and ``place_angle`` of one place, and ``min_inlier_ratio``
    of the beams meet the map within ``inlier``. ``move_every``: metres or radians after which the particles move
    without a scan, too. ``seed``: of the drawing.
    """

    planar_map: PlanarMap
    beams: Count = 72
    hit_std: Annotated[Positive, "m"] = 0.04
    search_hit_std: Annotated[Positive, "m"] = 0.15
    random: Fraction = 0.05
    independent_beams: Positive = 12.0
    resolution: Annotated[Positive, "m per cell"] = 0.02
    reach: Annotated[Positive, "m"] = 0.6
    good_fit: Fraction = 0.7
    slow: PositiveFraction = 0.01
    fast: Annotated[PositiveFraction, NotBelow("slow")] = 0.2
    candidates: Count = 5000
    unknown_std: Annotated[Positive, "m"] = 0.5
    place_radius: Annotated[Positive, "m"] = 0.5
    place_angle: Annotated[Positive, "rad"] = math.radians(30.0)
    sure: Fraction = 0.9
    inlier: Annotated[Positive, "m"] = 0.1
    min_inlier_ratio: Fraction = 0.35
    clearance: Annotated[NonNegative, "m"] = 0.2
    move_every: Annotated[NonNegative, "m, rad"] = 0.1
    seed: NonNegativeInt = 0
    motion: OdometryMotion = field(default_factory=OdometryMotion)
    kld: KldSampling = field(default_factory=KldSampling)

    _field: DistanceField = field(init=False, repr=False)
    _fine: NDArray[np.float32] = field(init=False, repr=False)
    _blurred: NDArray[np.float32] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        distances = DistanceField.of_map(self.planar_map, self.resolution, self.reach, self.clearance)
        object.__setattr__(self, "_field", distances)
        object.__setattr__(self, "_fine", _log_likelihood(distances, self.hit_std, self.random))
        object.__setattr__(self, "_blurred", _log_likelihood(distances, self.search_hit_std, self.random))

    def start(self, pose: Pose2D, odometry: Pose2D, position_std: float, heading_std: float) -> ParticleEstimate:
        """See ``Localizer.start``; from a pose less certain than ``unknown_std`` the whole floor is searched."""
        rng = np.random.default_rng(self.seed)
        searching = position_std > self.unknown_std
        if searching:
            particles = self._field.draw(self.kld.most, rng)
        else:
            spread = rng.standard_normal((self.kld.fewest, 3)) * (position_std, position_std, heading_std)
            particles = np.array([pose.x, pose.y, pose.theta]) + spread
        return ParticleEstimate(
            pose,
            np.diag([position_std**2, position_std**2, heading_std**2]),
            particles=particles,
            place=pose,
            moved_at=odometry,
            odometry=odometry,
            searching=searching,
            slow=self.good_fit,
            fast=self.good_fit,
            rng=rng,
        )

    def predict(self, before: ParticleEstimate, odometry: Pose2D) -> ParticleEstimate:
        """See ``Localizer.predict``; the particles follow with the next scan, or after ``move_every``."""
        moved = before.moved_at.inverse() @ odometry
        if max(math.hypot(moved.x, moved.y), abs(moved.theta)) <= self.move_every:
            return replace(before, pose=before.place @ moved, odometry=odometry)
        moved_on = self._moved(replace(before, odometry=odometry))
        count = len(moved_on.particles)
        pose, covariance, _ = self._heaviest(moved_on.particles, np.full(count, 1.0 / count))
        return replace(moved_on, pose=pose, covariance=covariance, place=pose)

    def correct(self, before: ParticleEstimate, scan: LaserScan, base_from_lidar: Pose2D) -> ParticleEstimate:
        """See ``Localizer.correct``."""
        hits = base_from_lidar.apply(scan.points())
        if len(hits) < 10:
            return replace(before, match=ScanMatch(False, 0.0, math.inf, f"only {len(hits)} beams hit anything"))
        hits = hits[np.linspace(0, len(hits) - 1, min(self.beams, len(hits))).astype(int)]
        moved_on = self._moved(before)
        fine = self._fit(moved_on.particles, hits, self._fine)
        fits = self._fit(moved_on.particles, hits, self._blurred) if before.searching else fine
        weights = np.exp(self.independent_beams * (fits - fits.max()))
        weights /= weights.sum()
        pose, covariance, share = self._heaviest(moved_on.particles, weights)
        # How much worse scans fit now than in the long run: that share of the particles is drawn from the floor.
        average = float(np.exp(fine).mean())
        slow = before.slow + self.slow * (average - before.slow)
        fast = before.fast + self.fast * (average - before.fast)
        drawn = self._drawn_anew(moved_on, weights, max(0.0, 1.0 - fast / slow), hits)
        return replace(
            moved_on,
            pose=pose,
            covariance=covariance,
            match=self._judged(pose, share, hits),
            particles=drawn,
            place=pose,
            searching=share < self.sure,
            slow=slow,
            fast=fast,
        )

    def _moved(self, before: ParticleEstimate) -> ParticleEstimate:
        moved = before.moved_at.inverse() @ before.odometry
        particles = self.motion.sample(before.particles, moved, before.rng)
        return replace(before, particles=particles, moved_at=before.odometry)

    def _fit(
        self, poses: NDArray[np.float64], hits: NDArray[np.float64], log_likelihood: NDArray[np.float32]
    ) -> NDArray[np.float64]:
        """Mean log likelihood of the hits (M, 2) in the base frame from each of ``poses`` (N, 3), (N,)."""
        index = self._field.index(*_placed(poses, hits))
        fits: NDArray[np.float64] = log_likelihood.take(index).mean(axis=1, dtype=np.float64)
        return fits

    def _heaviest(
        self, particles: NDArray[np.float64], weights: NDArray[np.float64]
    ) -> tuple[Pose2D, NDArray[np.float64], float]:
        """Mean and covariance (3, 3) of the particles about the heaviest place, and its share of the weight."""
        _, of = np.unique(self.kld.bins(particles), return_inverse=True)
        heaviest = particles[of == np.argmax(np.bincount(of, weights))]
        turns = particles[:, 2] - heaviest[0, 2]
        turns = (turns + math.pi) % (2.0 * math.pi) - math.pi
        away = np.linalg.norm(particles[:, :2] - heaviest[:, :2].mean(axis=0), axis=1)
        about = (away < self.place_radius) & (np.abs(turns) < self.place_angle)
        share = float(weights[about].sum())
        chosen = np.column_stack([particles[about, :2], turns[about]])
        mean = np.average(chosen, axis=0, weights=weights[about])
        covariance = np.cov(chosen.T, aweights=weights[about], ddof=0)
        x, y, turn = mean.tolist()
        return Pose2D(x, y, wrap_angle(float(heaviest[0, 2]) + turn)), covariance, share

    def _judged(self, pose: Pose2D, share: float, hits: NDArray[np.float64]) -> ScanMatch:
        x, y = pose.apply(hits).T
        distance = self._field.distance.ravel()[self._field.index(x, y)]
        near = distance < self.inlier
        inliers = float(near.mean())
        residual = math.sqrt(float(np.mean(distance[near] ** 2))) if near.any() else math.inf
        reason = ""
        if share < self.sure:
            reason = f"the base may be in several places; {share:.0%} speaks for the likeliest"
        elif inliers < self.min_inlier_ratio:
            reason = f"only {inliers:.0%} of the hits lie on something in the map"
        return ScanMatch(not reason, inliers, residual, reason)

    def _drawn_anew(
        self, before: ParticleEstimate, weights: NDArray[np.float64], replaced: float, hits: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        rng = before.rng
        kept = before.particles[_low_variance(weights, len(weights), rng)]
        count = self.kld.enough(len(np.unique(self.kld.bins(kept))))
        from_floor = round(replaced * count)
        drawn = before.particles[_low_variance(weights, count - from_floor, rng)]
        if not from_floor:
            return drawn
        candidates = self._field.draw(self.candidates, rng)
        fits = self._fit(candidates, hits, self._blurred)
        chosen = np.exp(self.independent_beams * (fits - fits.max()))
        found = candidates[_low_variance(chosen / chosen.sum(), from_floor, rng)]
        return np.vstack([drawn, found])


def _log_likelihood(field: DistanceField, hit_std: float, random: float) -> NDArray[np.float32]:
    """Of a hit in each cell of the field, flattened."""
    hits = (1.0 - random) * np.exp(-0.5 * (field.distance / hit_std) ** 2)
    log_likelihood: NDArray[np.float32] = np.log(hits + random).astype(np.float32).ravel()
    return log_likelihood


def _low_variance(weights: NDArray[np.float64], count: int, rng: np.random.Generator) -> NDArray[np.intp]:
    """Indices (count,) drawn with ``weights``, which sum to 1, by one random number (table 4.4)."""
    positions = (rng.random() + np.arange(count)) / max(count, 1)
    return np.minimum(np.searchsorted(np.cumsum(weights), positions), len(weights) - 1)


def _placed(poses: NDArray[np.float64], points: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """x and y, each (N, M), of the points (M, 2) as seen from each of ``poses`` (N, 3)."""
    cos, sin = np.cos(poses[:, 2, None]), np.sin(poses[:, 2, None])
    x = poses[:, 0, None] + cos * points[:, 0] - sin * points[:, 1]
    y = poses[:, 1, None] + sin * points[:, 0] + cos * points[:, 1]
    return x, y
