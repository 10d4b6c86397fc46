"""Base of sampling planners: a straight path first, searches from new seeds, shortcuts, a fine check."""

from __future__ import annotations

from abc import abstractmethod
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bestman_bt.manipulation.collision.base import CollisionWorld
from bestman_bt.manipulation.joint_values import JointLimits
from bestman_bt.manipulation.motion_planning.base import (
    MotionPlan,
    MotionPlanner,
    MotionPlanningError,
    PathConstraint,
    PlanningErrorCode,
)
from bestman_bt.manipulation.motion_planning.checked_edges import CheckedEdges, CountedValidity
from bestman_bt.manipulation.motion_planning.query import PlanningQuery, check_query, in_the_way
from bestman_bt.messages import MotionObstacle, MotionStage
from bestman_bt.messages.shapes import Count, NonNegative, NonNegativeInt, Positive

# Shortening a joint path: random shortcuts between any two of its points, checked lazily.
# Geraerts and Overmars, "Creating high-quality paths for motion planning", IJRR 2007. A shortcut is accepted after a
# coarse check; only what is left in the end is checked finely, and undone where that fails.


_LEAST_GAIN = 0.01
"""Smallest shortening, radians, that justifies further checks."""
_SWEEPS = 5
_PULLS = (0.7, 0.35, 0.15)


def shortcut(
    path: NDArray[np.float64], edges: CheckedEdges, rng: np.random.Generator, attempts: int, patience: int
) -> NDArray[np.float64] | None:
    """Return a path (M, n) with the ends of ``path`` (N, n), never longer, with finely checked edges; None if invalid.

    Waypoints are skipped if the path past them is free, then ``attempts`` random pairs of points are connected; it ends
    after ``patience`` attempts without success.
    """
    shortened = _last_free(path, _shorter(path, edges, rng, attempts, patience, fine=False), edges)
    if shortened is None:
        return None
    free, undone = shortened
    if undone:
        for better in _shorter(free, edges, rng, attempts, patience, fine=True):
            free = better
    # Parts of finely checked edges are finely known; an edge that is not would be a mistake here, so it is asked.
    return free if edges.is_path_free(free) else None


def _last_free(
    path: NDArray[np.float64], versions: Iterator[NDArray[np.float64]], edges: CheckedEdges
) -> tuple[NDArray[np.float64], bool] | None:
    """Return the latest version that stands the fine check, and whether later ones were dropped."""
    history = [path, *versions]
    for version in reversed(history):
        if edges.is_path_free(version):
            return version, version is not history[-1]
    return None


def _shorter(
    path: NDArray[np.float64], edges: CheckedEdges, rng: np.random.Generator, attempts: int, patience: int, fine: bool
) -> Iterator[NDArray[np.float64]]:
    """Yield ever shorter versions of ``path``."""
    for skipped in _skip_waypoints(path, edges, fine):
        path = skipped
        yield path
    failures = 0
    for _ in range(attempts):
        if len(path) < 3 or failures >= patience:
            break
        marks = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
        first, last = np.sort(rng.uniform(0.0, marks[-1], 2))
        i, a = _point_at(path, marks, first)
        j, b = _point_at(path, marks, last)
        gain = last - first - np.linalg.norm(b - a)
        if i == j or gain < _LEAST_GAIN:
            failures += 1
            continue
        if not edges.is_free(a, b, fine):
            failures += 1
            continue
        edges.split(path[i], path[i + 1], a)
        edges.split(path[j], path[j + 1], b)
        path = _without_repeats(np.concatenate([path[: i + 1], [a, b], path[j + 1 :]]))
        failures = 0
        yield path
    for taut in _tauten(path, edges, fine) if attempts else ():
        path = taut
        yield path
    yield from _skip_waypoints(path, edges, fine)


def _tauten(path: NDArray[np.float64], edges: CheckedEdges, fine: bool) -> Iterator[NDArray[np.float64]]:
    """Pull each waypoint towards the straight line between its neighbours, as far as the two ways to them stay free."""
    for _ in range(_SWEEPS):
        before = _length(path)
        for i in range(1, len(path) - 1):
            a, point, b = path[i - 1 : i + 2]
            along = b - a
            foot = a + np.clip((point - a) @ along / max(along @ along, 1e-12), 0.0, 1.0) * along
            for share in _PULLS:
                pulled = point + share * (foot - point)
                if _length(path[i - 1 : i + 2]) - _length(np.array([a, pulled, b])) < _LEAST_GAIN:
                    break
                if edges.is_free(a, pulled, fine) and edges.is_free(pulled, b, fine):
                    path = np.concatenate([path[:i], [pulled], path[i + 1 :]])
                    yield path
                    break
        if before - _length(path) < _LEAST_GAIN:
            break


def _length(path: NDArray[np.float64]) -> float:
    return float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum())


def _skip_waypoints(path: NDArray[np.float64], edges: CheckedEdges, fine: bool) -> Iterator[NDArray[np.float64]]:
    i = 0
    while i + 2 < len(path):
        if edges.is_free(path[i], path[i + 2], fine):
            path = np.delete(path, i + 1, axis=0)
            yield path
            i = max(0, i - 1)
        else:
            i += 1


def _point_at(path: NDArray[np.float64], marks: NDArray[np.float64], mark: float) -> tuple[int, NDArray[np.float64]]:
    """Return the segment that holds the point at arc length ``mark``, and the point."""
    i = min(int(np.searchsorted(marks, mark, side="right")) - 1, len(path) - 2)
    fraction = (mark - marks[i]) / max(marks[i + 1] - marks[i], 1e-12)
    return i, path[i] + fraction * (path[i + 1] - path[i])


def _without_repeats(path: NDArray[np.float64]) -> NDArray[np.float64]:
    keep = np.concatenate([[True], np.linalg.norm(np.diff(path, axis=0), axis=1) > 1e-9])
    keep[-1] = True
    kept: NDArray[np.float64] = path[keep]
    return kept


WAY_SAMPLES = 50
"""Number of configurations checked to name the obstacle if no path was found."""


@dataclass(frozen=True)
class SamplingPlanner(MotionPlanner):
    """A planner that searches by random samples; subclasses implement ``search``.

    The result depends only on the arguments: every search is seeded from ``rng`` and limited by counts, not by time.

    ``check_step``, ``final_check_step``: rad between checked points during planning, and of the final path; if the
    final check fails, the next attempt plans with half the step. ``max_checks``: collision checks of an attempt;
    ``max_iterations``: of the search. ``attempts``: searches from new seeds. ``shortcut_attempts``,
    ``shortcut_patience``: see ``shortcut``. ``limit_tolerance``: rad by which the start may be outside its limits (an
    arm that sags or overshoots). ``wall_limit``: seconds after which planning aborts with an error; results never
    depend on it.
    """

    check_step: Annotated[Positive, "rad"] = 0.03
    final_check_step: Annotated[Positive, "rad"] = 0.01
    max_checks: Count = 60_000
    max_iterations: Count = 20_000
    attempts: Count = 2
    shortcut_attempts: NonNegativeInt = 100
    shortcut_patience: NonNegativeInt = 25
    limit_tolerance: Annotated[NonNegative, "rad"] = 0.01
    wall_limit: Annotated[Positive, "s"] = 60.0

    @property
    def name(self) -> str:
        """The name in error messages."""
        return type(self).__name__

    @abstractmethod
    def search(self, query: PlanningQuery, edges: CheckedEdges, seed: int) -> NDArray[np.float64] | None:
        """Return a path (N, n) from the query's start to one of its goals, or None within the limits of one attempt.

        Edges known to be free are not checked again during shortening.
        """

    def plan(
        self,
        start: ArrayLike,
        goals: Sequence[ArrayLike],
        world: CollisionWorld,
        limits: JointLimits,
        rng: np.random.Generator,
        constraint: PathConstraint | None = None,
    ) -> MotionPlan:
        """Plan from ``start`` to any of ``goals``; see the base class."""
        query = check_query(start, goals, world, limits, constraint, self.limit_tolerance)
        validity = CountedValidity(world, constraint, self.wall_limit)
        try:
            path = self._found(query, validity, rng)
        except MotionPlanningError as late:
            words, obstacle = _in_the_way(query, world)
            raise MotionPlanningError(late.code, f"{late}{words}", obstacle) from late
        return MotionPlan(path, query.index_of(path[-1]), validity.checks)

    def _found(self, query: PlanningQuery, validity: CountedValidity, rng: np.random.Generator) -> NDArray[np.float64]:
        step = self.check_step
        edges = CheckedEdges(validity, step, self.final_check_step)
        for goal in sorted(query.goals, key=lambda q: float(np.linalg.norm(q - query.start))):
            if edges.is_free(query.start, goal, fine=True):
                return np.array([query.start, goal])
        for _ in range(self.attempts):
            found = self.search(query, edges, int(rng.integers(1, 2**31 - 1)))
            if found is None:
                continue
            path = self.shorten(found, edges, rng)
            if path is not None:
                return path
            step = max(step / 2, self.final_check_step)  # what is there is thin: look more closely
            edges = CheckedEdges(validity, step, self.final_check_step)
        raise MotionPlanningError(
            PlanningErrorCode.NO_PATH,
            f"{self.name} found no path to any of {len(query.goals)} goals after {validity.checks} collision checks",
        )

    def shorten(
        self, found: NDArray[np.float64], edges: CheckedEdges, rng: np.random.Generator
    ) -> NDArray[np.float64] | None:
        """Return a path that is never longer and finely checked, or None if ``found`` (N, n) is invalid."""
        return shortcut(found, edges, rng, self.shortcut_attempts, self.shortcut_patience)


def _in_the_way(query: PlanningQuery, world: CollisionWorld) -> tuple[str, MotionObstacle | None]:
    """Return the pair that collides most often on the straight way to the nearest goal; nothing without one."""
    nearest = min(query.goals, key=lambda goal: float(np.linalg.norm(goal - query.start)))
    way = np.linspace(query.start, nearest, WAY_SAMPLES)
    found = [(pair, positions) for positions in way for pair in world.colliding_pairs(positions)]
    if not found:
        return "", None
    pair, _ = Counter(pair for pair, _ in found).most_common(1)[0]
    at = [positions for other, positions in found if other == pair]
    obstacle = in_the_way(MotionStage.PATH, world, at[len(at) // 2])
    pairs = (pair, *(other for other in obstacle.pairs if other != pair))
    return f"; on the straight way {pair[0]} and {pair[1]} collide", replace(obstacle, pairs=pairs)
