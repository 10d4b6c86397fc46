"""Base placement: base poses from which the arm reaches its targets or follows a whole tool path, best first.

A reachability map (if given) or the distance to the target orders the candidates for inverse kinematics (Zacharias,
Borst and Hirzinger, "Capturing robot workspace structure", IROS 2007; Vahrenkamp, Asfour and Dillmann, "Robot placement
based on reachability inversion", ICRA 2013). Opening a door fails if the arm leaves its branch half-way, so a placement
for a path must have joint positions on one branch along the whole path.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike, NDArray
from typing_extensions import override

from bestman_bt.manipulation.collision.base import CollisionWorld
from bestman_bt.manipulation.errors import ManipulationError
from bestman_bt.manipulation.joint_values import JointLimits, joint_vector
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
from bestman_bt.messages import Pose, Pose2D, wrap_angle
from bestman_bt.messages.shapes import Count
from bestman_bt.world_model.semantic_map import MapFurniture

ToolPoses = Sequence[Pose]
_HEADINGS = {"front": 0.0, "back": math.pi, "left": -math.pi / 2, "right": math.pi / 2}
_EVERY_15_DEGREES = tuple(math.radians(degrees) for degrees in range(-180, 180, 15))
_AT_ONCE = 32  # placements whose promise is computed in one array, which is to stay in the processor's cache


@dataclass(frozen=True, eq=False)
class ReachingArm:
    """The arm of a base placement search.

    ``reference``: (n,) radians, start of inverse kinematics. ``reachability``: its reachability map; without it,
    candidates are ordered by distance.
    """

    kinematics: InverseKinematics
    limits: JointLimits
    reference: ArrayLike
    rng: np.random.Generator
    reachability: ReachabilityMap | None = None


class BasePlacementPlanner(ABC):
    """Finds base poses from which the arm reaches its targets."""

    @abstractmethod
    def beside(
        self, furniture: MapFurniture, target: ArrayLike, base_front: float, sides: Sequence[str] = ("front",)
    ) -> tuple[Pose2D, ...]:
        """Return base poses along ``furniture``, facing it, at ``target`` (x, y) in the map frame or slightly sideways.

        ``base_front``: metres from the base's origin to its front. ``sides``: of ``front`` (-x of the furniture),
        ``back``, ``left`` (+y) and ``right``. Raises ManipulationError for another side, and for a
        ``target`` that is not finite.
        """

    @abstractmethod
    def rank(
        self,
        candidates: Sequence[Pose2D],
        alternatives: Sequence[ToolPoses],
        arm: ReachingArm,
        is_base_free: Callable[[Pose2D], bool] = lambda pose: True,
        world_at: Callable[[Pose2D], CollisionWorld] | None = None,
        current: Pose2D | None = None,
    ) -> tuple[BasePlacement, ...]:
        """Return the placements from which at least one alternative is reachable, best first; may be empty.

        ``alternatives``: each a sequence of tool poses in the map frame that must all be reached (pre-grasp, grasp).
        ``is_base_free``: whether the base has room there. ``world_at``: the arm's collision world for a placement;
        without it collisions are ignored. ``current``: current base pose. Raises ManipulationError without
        alternatives.
        """


@dataclass(frozen=True)
class BasePlacements(BasePlacementPlanner):
    """Candidates are ordered by ``reachability`` (or distance); the search ends after ``enough`` successes.

    ``gaps``: metres between the base's front and the furniture. ``offsets``: metres sideways from the target.
    ``preferred_reach``: fraction of the arm's reach where it works best. ``enough``: good placements that end the
    search. ``ik_attempts``: start positions per tool pose. ``travel_cost``: score lost per metre of driving.
    ``comfort_weight``: score for joints far from their limits.
    """

    gaps: Annotated[tuple[float, ...], "m"] = (0.06, 0.1, 0.15)
    offsets: Annotated[tuple[float, ...], "m"] = (0.0, -0.1, 0.1, -0.2, 0.2, -0.3, 0.3)
    preferred_reach: float = 0.62
    enough: Count = 4
    ik_attempts: Count = 8
    travel_cost: Annotated[float, "1/m"] = 0.05
    comfort_weight: float = 0.5

    @override
    def beside(
        self, furniture: MapFurniture, target: ArrayLike, base_front: float, sides: Sequence[str] = ("front",)
    ) -> tuple[Pose2D, ...]:
        place = np.asarray(target, dtype=float)[:2]
        if not np.isfinite(place).all():
            raise ManipulationError(f"target should be finite but is {place}")
        x, y = furniture.pose.inverse().apply(place)
        half_x, half_y = furniture.footprint[0] / 2, furniture.footprint[1] / 2
        stands = []
        for side in sides:
            if side not in _HEADINGS:
                raise ManipulationError(f"side should be one of {', '.join(_HEADINGS)} but is {side!r}")
            heading = _HEADINGS[side]
            half_depth, half_width = (half_x, half_y) if side in ("front", "back") else (half_y, half_x)
            # The target in a frame that looks the way the robot will look, its origin at the furniture's.
            abreast = float(Pose2D(theta=heading).inverse().apply(np.array([x, y]))[1])
            for gap in self.gaps:
                for offset in self.offsets:
                    lateral = float(np.clip(abreast + offset, -half_width, half_width))
                    stand = Pose2D(theta=heading) @ Pose2D(-half_depth - gap - base_front, lateral, 0.0)
                    stands.append(furniture.pose @ stand)
        return tuple(dict.fromkeys(stands))

    @override
    def rank(
        self,
        candidates: Sequence[Pose2D],
        alternatives: Sequence[ToolPoses],
        arm: ReachingArm,
        is_base_free: Callable[[Pose2D], bool] = lambda pose: True,
        world_at: Callable[[Pose2D], CollisionWorld] | None = None,
        current: Pose2D | None = None,
    ) -> tuple[BasePlacement, ...]:
        if not alternatives or any(len(poses) == 0 for poses in alternatives):
            raise ManipulationError("alternatives should hold at least one sequence of tool poses, none of them empty")
        ranked: list[BasePlacement] = []
        for stand in sorted(candidates, key=lambda pose: self._effort(pose, alternatives, arm, current)):
            if not is_base_free(stand):
                continue
            rated = self._rate(stand, alternatives, arm, world_at, current)
            if rated is not None:
                ranked.append(rated)
                if len(ranked) >= self.enough:
                    break
        return tuple(sorted(ranked, key=lambda stand: -stand.score))

    def _effort(
        self,
        stand: Pose2D,
        alternatives: Sequence[ToolPoses],
        arm: ReachingArm,
        current: Pose2D | None,
    ) -> float:
        base_from_map = stand.to_pose().inverse()
        if arm.reachability is not None:
            lasts = [base_from_map @ poses[-1] for poses in alternatives]
            likely = arm.reachability.score([pose.position for pose in lasts], [pose.rotation[:, 2] for pose in lasts])
            return self.travel_cost * _drive(stand, current) - float(np.mean(likely))
        shoulder, reach = arm.kinematics.reach
        distances = [
            float(np.linalg.norm(base_from_map.apply(poses[-1].position) - shoulder)) for poses in alternatives
        ]
        return abs(float(np.mean(distances)) / reach - self.preferred_reach) + self.travel_cost * _drive(stand, current)

    def _rate(
        self,
        stand: Pose2D,
        alternatives: Sequence[ToolPoses],
        arm: ReachingArm,
        world_at: Callable[[Pose2D], CollisionWorld] | None,
        current: Pose2D | None,
    ) -> BasePlacement | None:
        base_from_map = stand.to_pose().inverse()
        is_valid = None if world_at is None else world_at(stand).is_free
        reached: list[tuple[float, int, NDArray[np.float64]]] = []
        for number, poses in enumerate(alternatives):
            solutions: list[NDArray[np.float64]] = []
            for pose in poses:
                seed = solutions[-1] if solutions else arm.reference
                result = arm.kinematics.solve(
                    base_from_map @ pose, seed, arm.rng, is_valid=is_valid, attempts=self.ik_attempts
                )
                if not result.found:
                    break
                solutions.append(result.best)
            if len(solutions) == len(poses):
                reached.append((min(joint_margin(q, arm.limits) for q in solutions), number, solutions[0]))
        if not reached:
            return None
        comfort, number, positions = max(reached, key=lambda entry: entry[0])
        score = (
            len(reached) / len(alternatives) + self.comfort_weight * comfort - self.travel_cost * _drive(stand, current)
        )
        return BasePlacement(stand, score, len(reached), number, positions)


@dataclass(frozen=True, eq=False)
class BasePlacement:
    """A base pose in the map frame. ``reachable``: number of reachable alternatives.

    ``positions``: (n,) radians, for the first tool pose of the most comfortable alternative, number ``alternative``.
    """

    pose: Pose2D
    score: float
    reachable: int
    alternative: int
    positions: NDArray[np.float64]


class PathPlacementPlanner(ABC):
    """Finds base poses from which the tool follows a whole path."""

    @abstractmethod
    def rank(
        self,
        candidates: Sequence[Pose2D],
        stations: Stations,
        arm: ReachingArm,
        is_base_free: Callable[[Pose2D], bool] = lambda pose: True,
        is_free_at: Callable[[Pose2D], IsFreeAt] | None = None,
        current: Pose2D | None = None,
        arc: ArcSearch | None = None,
    ) -> tuple[PathPlacement, ...]:
        """Return placements from which the tool follows all ``stations`` (poses in the map frame), best first; may be
        empty.

        ``is_free_at``: for a placement, whether the arm is free at a station. ``current``: current base pose. Raises
        the errors of ``ArcSearch.path``.
        """

    @abstractmethod
    def promising(
        self,
        candidates: Sequence[Pose2D],
        stations: Stations,
        kinematics: InverseKinematics,
        reachability: ReachabilityMap,
        current: Pose2D | None = None,
    ) -> tuple[Pose2D, ...]:
        """Return the candidates from which all ``stations`` (poses in the map frame) are within reach, most likely
        first."""

    def from_fixed_base(self) -> PathPlacementPlanner:
        """Return the planner for a fixed base: it searches longer and accepts part of the path."""
        return self


@dataclass(frozen=True)
class PathPlacements(PathPlacementPlanner):
    """Tries the most promising candidates first, each from several solutions of inverse kinematics.

    ``enough``: placements with a complete path that end the search. ``most``: largest number of candidates. ``starts``:
    inverse kinematics solutions per placement to search from; ``options``: rotations of the hand at the middle station,
    with ``ik_attempts`` start positions each. ``good_margin``: a path with this joint margin (fraction of half the
    range) is accepted immediately. ``min_fraction``: smallest reached fraction of the path. ``travel_cost``: score lost
    per metre of driving.
    """

    enough: Count = 2
    most: Count = 60
    starts: Count = 3
    options: Count = 5
    ik_attempts: Count = 6
    good_margin: float = 0.15
    min_fraction: float = 1.0
    travel_cost: Annotated[float, "1/m"] = 0.05

    @override
    def rank(
        self,
        candidates: Sequence[Pose2D],
        stations: Stations,
        arm: ReachingArm,
        is_base_free: Callable[[Pose2D], bool] = lambda pose: True,
        is_free_at: Callable[[Pose2D], IsFreeAt] | None = None,
        current: Pose2D | None = None,
        arc: ArcSearch | None = None,
    ) -> tuple[PathPlacement, ...]:
        check_stations(stations)
        origin = joint_vector(arm.reference, len(arm.kinematics.joint_names), "reference")
        promise = self._promises(candidates, stations, arm.kinematics, arm.reachability, current)
        found: list[PathPlacement] = []
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
            score = best.fraction + best.margin - self.travel_cost * _drive(stand, current)
            found.append(PathPlacement(stand, score, best))
        return tuple(sorted(found, key=lambda stand: (-stand.arc.complete, -stand.score)))

    @override
    def promising(
        self,
        candidates: Sequence[Pose2D],
        stations: Stations,
        kinematics: InverseKinematics,
        reachability: ReachabilityMap,
        current: Pose2D | None = None,
    ) -> tuple[Pose2D, ...]:
        check_stations(stations)
        promise = self._promises(candidates, stations, kinematics, reachability, current)
        order = np.argsort(-promise, kind="stable")
        return tuple(candidates[index] for index in order if np.isfinite(promise[index]))

    @override
    def from_fixed_base(self) -> PathPlacements:
        return replace(self, enough=1, most=1, starts=6, options=7, min_fraction=0.3)

    def _promises(
        self,
        candidates: Sequence[Pose2D],
        stations: Stations,
        kinematics: InverseKinematics,
        reachability: ReachabilityMap | None,
        current: Pose2D | None,
    ) -> NDArray[np.float64]:
        """Return the score of each placement: -inf if a station is out of reach.

        Else that of the worst station of the best sequence, in which the hand turns from place to neighbouring place.
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
            promises[first : first + _AT_ONCE] = widest - [
                self.travel_cost * _drive(stand, current) for stand in stands
            ]
        return promises

    def _best_arc(
        self,
        stations: list[list[Pose]],
        arm: ReachingArm,
        is_free: IsFreeAt | None,
        arc: ArcSearch,
    ) -> ArcPath | None:
        """Return the path from solutions for the middle station, the one farthest from both ends of the arc."""
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
class PathPlacement:
    """A base pose in the map frame with the arm's path from there: ``arc.path[i]`` is for station i of the tool's."""

    pose: Pose2D
    score: float
    arc: ArcPath


def placements_around(
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
    """Return (S,) the largest minimum along a way through all stations (the widest path), from a place to the same or
    the next.

    ``likely``: for each station (S, places), a row for each of S base placements.
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


def _drive(stand: Pose2D, current: Pose2D | None) -> float:
    """Return the cost of driving from ``current``, metres; a full turn counts as 1.26 m."""
    if current is None:
        return 0.0
    return stand.distance_to(current) + 0.2 * abs(wrap_angle(stand.theta - current.theta))
