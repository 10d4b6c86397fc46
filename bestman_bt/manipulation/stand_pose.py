"""Base placement: base poses from which the arm reaches its targets, best first.

In the spirit of Zacharias, Borst and Hirzinger, "Capturing robot workspace structure", IROS 2007: a reachability map
(if given) or the distance to the target orders the candidates for inverse kinematics.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bestman_bt.manipulation.collision.base import CollisionWorld
from bestman_bt.manipulation.errors import ManipulationError
from bestman_bt.manipulation.joint_values import JointLimits
from bestman_bt.manipulation.kinematics.base import InverseKinematics
from bestman_bt.manipulation.kinematics.reachability_map import ReachabilityMap
from bestman_bt.messages import Pose, Pose2D, wrap_angle
from bestman_bt.world_model.semantic_map import MapFurniture

ToolPoses = Sequence[Pose]


@dataclass(frozen=True, eq=False)
class ReachingArm:
    """The arm of a base placement search.

    ``reference``: (n,) radians, start of inverse kinematics. ``reachability``: its map; without it candidates are
    ordered by distance.
    """

    kinematics: InverseKinematics
    limits: JointLimits
    reference: ArrayLike
    rng: np.random.Generator
    reachability: ReachabilityMap | None = None


@dataclass(frozen=True)
class StandSearch:
    """Finds base poses from which the arm reaches its targets.

    ``gaps``: metres between the base's front and the furniture. ``offsets``: metres sideways from the target.
    ``preferred_reach``: fraction of the arm's reach where it works best. ``enough``: good placements that end the
    search. ``ik_attempts``: start positions per tool pose. ``travel_cost``: score lost per metre of driving.
    ``comfort_weight``: score for joints far from their limits.
    """

    gaps: tuple[float, ...] = (0.06, 0.1, 0.15)
    offsets: tuple[float, ...] = (0.0, -0.1, 0.1, -0.2, 0.2, -0.3, 0.3)
    preferred_reach: float = 0.62
    enough: int = 4
    ik_attempts: int = 8
    travel_cost: float = 0.05
    comfort_weight: float = 0.5

    def beside(
        self, furniture: MapFurniture, target: ArrayLike, base_front: float, sides: Sequence[str] = ("front",)
    ) -> tuple[Pose2D, ...]:
        """Return base poses along ``furniture``, facing it, at ``target`` (x, y) in the map frame or slightly sideways.

        ``base_front``: metres from the base's origin to its front. ``sides``: of ``front`` (-x of the furniture),
        ``back``, ``left`` (+y) and ``right``. Raises ManipulationError for another side.
        """
        x, y = furniture.pose.inverse().apply(np.asarray(target, dtype=float)[:2])
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

    def rank(
        self,
        candidates: Sequence[Pose2D],
        alternatives: Sequence[ToolPoses],
        arm: ReachingArm,
        is_base_free: Callable[[Pose2D], bool] = lambda pose: True,
        world_at: Callable[[Pose2D], CollisionWorld] | None = None,
        current: Pose2D | None = None,
    ) -> tuple[StandPose, ...]:
        """Return the placements from which at least one alternative is reachable, best first; may be empty.

        ``alternatives``: each a sequence of tool poses in the map frame that must all be reached (pre-grasp, grasp).
        ``is_base_free``: whether the base has room there. ``world_at``: the arm's collision world for a placement;
        without it collisions are ignored. ``current``: current base pose. Candidates are ordered by ``reachability``
        (or distance), and the search ends after ``enough`` successes. Raises ManipulationError without alternatives.
        """
        if not alternatives or any(len(poses) == 0 for poses in alternatives):
            raise ManipulationError("alternatives should hold at least one sequence of tool poses, none of them empty")
        ranked: list[StandPose] = []
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
            return self._travel(stand, current) - float(np.mean(likely))
        shoulder, reach = arm.kinematics.reach
        distances = [
            float(np.linalg.norm(base_from_map.apply(poses[-1].position) - shoulder)) for poses in alternatives
        ]
        return abs(float(np.mean(distances)) / reach - self.preferred_reach) + self._travel(stand, current)

    def _travel(self, stand: Pose2D, current: Pose2D | None) -> float:
        if current is None:
            return 0.0
        turn = abs(wrap_angle(stand.theta - current.theta))
        return self.travel_cost * (stand.distance_to(current) + 0.2 * turn)

    def _rate(
        self,
        stand: Pose2D,
        alternatives: Sequence[ToolPoses],
        arm: ReachingArm,
        world_at: Callable[[Pose2D], CollisionWorld] | None,
        current: Pose2D | None,
    ) -> StandPose | None:
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
                reached.append((min(_comfort(q, arm.limits) for q in solutions), number, solutions[0]))
        if not reached:
            return None
        comfort, number, positions = max(reached, key=lambda entry: entry[0])
        score = len(reached) / len(alternatives) + self.comfort_weight * comfort - self._travel(stand, current)
        return StandPose(stand, score, len(reached), number, positions)


@dataclass(frozen=True, eq=False)
class StandPose:
    """A base pose in the map frame. ``reachable``: number of reachable alternatives.

    ``positions``: (n,) radians, for the first tool pose of the most comfortable alternative, number ``alternative``.
    """

    pose: Pose2D
    score: float
    reachable: int
    alternative: int
    positions: NDArray[np.float64]


_HEADINGS = {"front": 0.0, "back": math.pi, "left": -math.pi / 2, "right": math.pi / 2}


def _comfort(positions: NDArray[np.float64], limits: JointLimits) -> float:
    """Distance of the worst joint from its limits, 0 at a limit, 1 in the middle of all ranges."""
    room = np.minimum(positions - limits.lower, limits.upper - positions) / (limits.upper - limits.lower)
    return float(np.clip(2.0 * room.min(), 0.0, 1.0))
