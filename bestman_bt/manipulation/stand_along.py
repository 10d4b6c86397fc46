"""Base placement for a whole tool path: base poses from which it is followed on one branch, best first.

Opening a door fails if the arm leaves its branch half-way, so a placement counts only with a joint path that follows
the whole arc. Candidates are ordered by a reachability map (Vahrenkamp, Asfour and Dillmann, "Robot placement based on
reachability inversion", ICRA 2013).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bestman_bt.manipulation.joint_values import joint_vector
from bestman_bt.manipulation.kinematics.arc_path import (
    ArcPath,
    ArcSearch,
    IsFreeAt,
    Stations,
    check_stations,
    joint_margin,
)
from bestman_bt.manipulation.kinematics.base import InverseKinematics
from bestman_bt.manipulation.kinematics.reachability_map import ReachabilityMap
from bestman_bt.manipulation.stand_pose import ReachingArm
from bestman_bt.messages import Pose, Pose2D, wrap_angle
from bestman_bt.messages.shapes import Count

_EVERY_15_DEGREES = tuple(math.radians(degrees) for degrees in range(-180, 180, 15))
_AT_ONCE = 32  # stands whose promise is computed in one array, which is to stay in the processor's cache


@dataclass(frozen=True)
class ArcStands:
    """Finds base poses from which a whole arc of the tool is followed.

    ``enough``: placements with a complete path that end the search. ``most``: largest number of candidates. ``starts``:
    inverse kinematics solutions per placement to search from; ``options``: rotations of the hand at the middle station,
    with ``ik_attempts`` start positions each. ``good_margin``: a path with this joint margin (fraction of half the
    range) is taken at once. ``min_fraction``: least reached fraction of the path. ``travel_cost``: score lost per metre
    of driving.
    """

    enough: Count = 4
    most: Count = 60
    starts: Count = 4
    options: Count = 5
    ik_attempts: Count = 6
    good_margin: float = 0.15
    min_fraction: float = 1.0
    travel_cost: float = 0.05

    def rank(
        self,
        candidates: Sequence[Pose2D],
        stations: Stations,
        arm: ReachingArm,
        is_base_free: Callable[[Pose2D], bool] = lambda pose: True,
        is_free_at: Callable[[Pose2D], IsFreeAt] | None = None,
        current: Pose2D | None = None,
        arc: ArcSearch | None = None,
    ) -> tuple[StandAlong, ...]:
        """Return placements from which the tool follows all ``stations`` (poses in the map frame), best first; may be
        empty.

        ``is_free_at``: for a placement, whether the arm is free at a station. ``current``: current base pose. Raises
        ManipulationError as ``ArcSearch.path`` does.
        """
        check_stations(stations)
        origin = joint_vector(arm.reference, len(arm.kinematics.joint_names), "reference")
        promise = self._promises(candidates, stations, arm.kinematics, arm.reachability, current)
        found: list[StandAlong] = []
        tried, complete = 0, 0
        for index in np.argsort(-promise, kind="stable"):
            stand = candidates[index]
            if not np.isfinite(promise[index]) or tried >= self.most or complete >= self.enough:
                break
            if not is_base_free(stand):
                continue
            tried += 1
            is_free = None if is_free_at is None else is_free_at(stand)
            base_from_map = stand.to_pose().inverse()
            local = [[base_from_map @ pose for pose in poses] for poses in stations]
            best = self._best_arc(local, replace(arm, reference=origin), is_free, arc or ArcSearch())
            if best is None or best.fraction < self.min_fraction - 1e-9:
                continue
            complete += best.complete
            score = best.fraction + best.margin - self._travel(stand, current)
            found.append(StandAlong(stand, score, best))
        return tuple(sorted(found, key=lambda stand: (-stand.arc.complete, -stand.score)))

    def promising(
        self,
        candidates: Sequence[Pose2D],
        stations: Stations,
        kinematics: InverseKinematics,
        reachability: ReachabilityMap,
        current: Pose2D | None = None,
    ) -> tuple[Pose2D, ...]:
        """Candidates from which all ``stations`` (poses in the map frame) are in reach, most likely first."""
        check_stations(stations)
        promise = self._promises(candidates, stations, kinematics, reachability, current)
        order = np.argsort(-promise, kind="stable")
        return tuple(candidates[index] for index in order if np.isfinite(promise[index]))

    def _promises(
        self,
        candidates: Sequence[Pose2D],
        stations: Stations,
        kinematics: InverseKinematics,
        reachability: ReachabilityMap | None,
        current: Pose2D | None,
    ) -> NDArray[np.float64]:
        """How likely each stand is: -inf where a station is out of reach.

        The worst station of the best way through them, on which the hand turns from place to neighbouring place.
        """
        shoulder, reach = kinematics.reach
        sizes = [len(poses) for poses in stations]
        positions = np.array([pose.position for poses in stations for pose in poses])
        approaches = np.array([pose.rotation[:, 2] for poses in stations for pose in poses])
        promises = np.empty(len(candidates))
        for first in range(0, len(candidates), _AT_ONCE):
            stands = candidates[first : first + _AT_ONCE]
            base_from_map = [stand.to_pose().inverse() for stand in stands]
            local = np.array([positions @ pose.rotation.T + pose.position for pose in base_from_map])
            distances = np.linalg.norm(local - shoulder, axis=2) / reach
            if reachability is None:
                likely = 1.0 - np.abs(distances - 0.6)
            else:
                aims = np.array([approaches @ pose.rotation.T for pose in base_from_map])
                likely = reachability.score(local.reshape(-1, 3), aims.reshape(-1, 3)).reshape(distances.shape)
            likely = np.where(distances <= 1.0, likely, -np.inf)
            widest = _widest_way(np.split(likely, np.cumsum(sizes)[:-1], axis=1))
            promises[first : first + _AT_ONCE] = widest - [self._travel(stand, current) for stand in stands]
        return promises

    def _travel(self, stand: Pose2D, current: Pose2D | None) -> float:
        if current is None:
            return 0.0
        turn = abs(wrap_angle(stand.theta - current.theta))
        return self.travel_cost * (stand.distance_to(current) + 0.2 * turn)

    def _best_arc(
        self,
        stations: list[list[Pose]],
        arm: ReachingArm,
        is_free: IsFreeAt | None,
        arc: ArcSearch,
    ) -> ArcPath | None:
        """Return the path through solutions at the middle station: what is farthest from both ends of the arc's
        demands.
        """
        middle = len(stations) // 2
        options = sorted(set(np.linspace(0, len(stations[middle]) - 1, self.options).round().astype(int).tolist()))
        is_valid = None if is_free is None else lambda q: is_free(q, middle)
        starts: list[tuple[float, int, NDArray[np.float64]]] = []
        for option in options:
            result = arm.kinematics.solve(
                stations[middle][option], arm.reference, arm.rng, self.starts, is_valid, self.ik_attempts
            )
            starts += [(joint_margin(q, arm.limits), option, q) for q in result.solutions]
        starts.sort(key=lambda entry: -entry[0])
        best: ArcPath | None = None
        for _, option, positions in starts[: self.starts]:
            path = arc.path_through(arm.kinematics, stations, middle, option, positions, arm.limits, is_free)
            if best is None or (path.fraction, path.margin) > (best.fraction, best.margin):
                best = path
            if best.complete and best.margin >= self.good_margin:
                break
        return best


@dataclass(frozen=True, eq=False)
class StandAlong:
    """A base pose in the map frame with the arm's path from there: ``arc.path[i]`` is for station i of the tool's."""

    pose: Pose2D
    score: float
    arc: ArcPath


def stands_around(
    target: ArrayLike,
    distances: Sequence[float] = (0.45, 0.55, 0.65, 0.75, 0.85),
    bearings: Sequence[float] = _EVERY_15_DEGREES,
    turns: Sequence[float] = (0.0, -0.5, 0.5, -1.0, 1.0),
) -> tuple[Pose2D, ...]:
    """Return base poses around ``target`` (x, y) in the map frame, at ``distances`` metres in directions ``bearings``,
    rad.

    The base faces the target, rotated by each of ``turns`` radians.
    """
    x, y = np.asarray(target, dtype=float)[:2].tolist()
    return tuple(
        Pose2D(x + distance * math.cos(bearing), y + distance * math.sin(bearing), wrap_angle(bearing + math.pi + turn))
        for distance in distances
        for bearing in bearings
        for turn in turns
    )


def _widest_way(likely: Sequence[NDArray[np.float64]]) -> NDArray[np.float64]:
    """(S,) the largest minimum along a way through all stations (the widest path), from a place to the same or next.

    ``likely``: for each station (S, places), a row for each of S stands.
    """
    best = likely[0]
    for station in likely[1:]:
        if station.shape == best.shape:
            around = best.copy()
            around[:, 1:] = np.maximum(around[:, 1:], best[:, :-1])
            around[:, :-1] = np.maximum(around[:, :-1], best[:, 1:])
            best = around
        else:
            best = np.broadcast_to(best.max(axis=1, keepdims=True), station.shape)
        best = np.minimum(best, station)
    widest: NDArray[np.float64] = best.max(axis=1)
    return widest
