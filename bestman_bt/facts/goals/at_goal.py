"""``at_goal``: the base is at its goal, without a long detour.

The seed chooses the goal: somewhere on the free floor, or close to a piece of furniture.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from bestman_bt.configuration.errors import Problem
from bestman_bt.configuration.quantity import Distance, Share
from bestman_bt.facts.evidence import Evidence, Verdict
from bestman_bt.facts.goals.goal import Goal
from bestman_bt.messages import PlacedShape, Pose2D, wrap_angle
from bestman_bt.navigation.global_planning.costmap import Costmap, Rasterization
from bestman_bt.navigation.global_planning.footprint import Footprint
from bestman_bt.navigation.global_planning.grid_search import areas_of_disc, shortest_length
from bestman_bt.robot_model.model import BaseModel, RobotModel
from bestman_bt.scene.draw import SceneError
from bestman_bt.scene.map_of_world import semantic_map
from bestman_bt.scene.scene import World
from bestman_bt.world_model.semantic_map import SemanticMap
from bestman_bt.world_model.world_model import Obstacle

_TRIES = 1000
_ROOM = 0.05
"""Free space around the base on open floor, metres."""
_BEFORE_FURNITURE = 0.06
"""Distance to the mapped front of a piece of furniture, metres: that of a robot that reaches over it."""
_TRUE_CLEARANCE = 0.02
"""Actual free space around the base, metres: a grid of 5 cm does not resolve less beside thin handles."""
_STRAIGHT = 0.6
"""Distance straight behind a goal in front of furniture within which there is room to turn, metres."""
_EXACT = Rasterization(clearance=0.0, furniture_position_error=0.0, furniture_heading_error=0.0)


@dataclass(frozen=True)
class AtGoalFields:
    """The base should drive to a pose chosen by the seed, at least ``distance`` metres from its start.

    ``at_furniture``: probability that it is 6 cm in front of furniture; otherwise there is room to turn.
    """

    at_furniture: Share = 0.5
    distance: Distance = 1.0


class AtGoal(Goal[AtGoalFields]):
    """The true pose of the base is within the tolerances of ``position`` and ``yaw``."""

    parameters = AtGoalFields
    fills = ("goal",)
    measures: ClassVar[Mapping[str, tuple[str, ...]]] = {"at_goal": ("final_error_mm", "final_yaw_deg", "path_ratio")}

    @cached_property
    def pose(self) -> Pose2D:
        """The target pose of the base, map_from_base. Raises SceneError if there is no room."""
        return drive_goal(self.asked, self.world, self.world_model.map, self.robot_model, self.config.seed)

    def problems(self) -> Iterator[Problem]:
        """Yield a problem for a robot without a mobile base."""
        yield from self.missing_part(BaseModel, "a mobile base")

    def entries(self) -> dict[str, Any]:
        """Return the blackboard entry ``goal``."""
        return {"goal": self.pose} if self.robot_model.of(BaseModel) else {}

    def judged(self, predicate: str, evidence: Evidence) -> Verdict:
        """Return the verdict with ``path_ratio``: driven distance over the shortest path of the base's inscribed
        circle.

        The shortest path is on the grid of the true obstacles.
        """
        goal, tolerances = self.pose, self.config.task.tolerances
        pose = evidence.truth.base_pose().to_pose2d()
        distance, turn = pose.distance_to(goal), abs(wrap_angle(pose.theta - goal.theta))
        faults = []
        if distance > tolerances.position:
            faults.append(f"{1e3 * distance:.0f} mm from the goal")
        if tolerances.yaw is not None and turn > tolerances.yaw:
            faults.append(f"turned away by {math.degrees(turn):.1f}°")
        metrics = {"final_error_mm": 1e3 * distance, "final_yaw_deg": math.degrees(turn)}
        if not faults:
            costmap = true_costmap(self.world, self.robot_model)
            shortest = shortest_length(self.world.robot_start.xy, goal.xy, costmap, costmap.footprint.inscribed_radius)
            metrics["path_ratio"] = evidence.driven / shortest
        return Verdict.on("base", faults, metrics)


def base_footprint(robot: RobotModel) -> Footprint:
    """Return the outline of the robot's first base."""
    return Footprint.of(next(iter(robot.of(BaseModel).values())))


def true_costmap(world: World, robot: RobotModel) -> Costmap:
    """Return the costmap of the true obstacles, with doors, drawers and handles, without margins and walkers."""
    actual = tuple(replace(piece, nominal=piece.actual, mapped=True) for piece in world.furniture)
    doors = [
        Obstacle(f"{piece.name}/{door.name}", tuple(PlacedShape(p.shape, moved @ p.pose) for p in door.parts), 0.0)
        for piece in world.furniture
        for door in piece.model.articulations
        for moved in (piece.pose @ door.moved(piece.open.get(door.name, 0.0)),)
    ]
    return Costmap.from_map(semantic_map(replace(world, furniture=actual)), base_footprint(robot), doors, _EXACT)


def drive_goal(asked: AtGoalFields, world: World, known: SemanticMap, robot: RobotModel, seed: int) -> Pose2D:
    """Return the pose chosen by the seed, map_from_base. Raises SceneError if there is none.

    The base is free of collision there, on the map and in the world, and the disc around the base can reach the pose;
    in front of furniture, a point straight behind it.
    """
    rng = np.random.default_rng([seed, 5])
    truth, believed = true_costmap(world, robot), Costmap.from_map(known, base_footprint(robot))
    radius = truth.footprint.circumscribed_radius
    areas = areas_of_disc(truth, radius)
    # A base that stands before furniture leaves it straight back.
    around = areas[truth.cells(_straight_behind(world.robot_start, _STRAIGHT)[:, :2])]
    home = int(around[around > 0][0]) if np.any(around) else 0
    no_way = "no way from the start" if home else "no room to turn at the start"
    before_furniture = bool(rng.random() < asked.at_furniture)
    if before_furniture and not _pieces_to_face(known):
        raise _no_room(world, seed, "there is no furniture but passages to drive to; ask for at_furniture: 0")
    refused: Counter[str] = Counter()
    for _ in range(_TRIES):
        goal = _before_furniture(known, truth.footprint, rng) if before_furniture else _anywhere(truth, rng)
        if goal.distance_to(world.robot_start) < asked.distance:
            refused[f"nearer to the start than {asked.distance:g} m"] += 1
            continue
        if (
            not truth.contains(goal.xy)
            or truth.clearance_at(goal) < _TRUE_CLEARANCE
            or believed.clearance_at(goal) <= 0
        ):
            refused["no room for the base"] += 1
            continue
        if not before_furniture and min(truth.distance_at(goal.xy), believed.distance_at(goal.xy)) < radius + _ROOM:
            refused["no room to turn"] += 1
            continue
        behind = _straight_behind(goal, _STRAIGHT if before_furniture else 0.0)
        clearance = np.minimum(truth.footprint_clearance(behind), believed.footprint_clearance(behind))
        free = np.logical_and.accumulate(clearance > 0.0)
        free &= believed.distance_at(behind[:, :2]) > radius
        if home and np.any(free & (areas[truth.cells(behind[:, :2])] == home)):
            return goal
        reason = f"no room to turn within {_STRAIGHT:g} m straight behind" if before_furniture else "no room to turn"
        refused[no_way if np.any(free) else reason] += 1
    share = "less" if before_furniture else "more"
    remedy = f"place furniture and start with more room, ask for a shorter distance or {share} at_furniture"
    raise _no_room(world, seed, f"{_none_drawn(known, before_furniture, refused)}; {remedy}")


def _no_room(world: World, seed: int, message: str) -> SceneError:
    return SceneError([Problem(f"scene {world.scene!r}, seed {seed}", None, "", message)])


def _none_drawn(known: SemanticMap, before_furniture: bool, refused: Counter[str]) -> str:
    """Return the kind of pose that was sampled, and why every sample was rejected, the most frequent reason first."""
    where = f"before furniture ({', '.join(_pieces_to_face(known))})" if before_furniture else "on open floor"
    reasons = ", ".join(f"{reason} ({count})" for reason, count in refused.most_common())
    return f"the base can get to none of {refused.total()} poses drawn {where}: {reasons}"


def _anywhere(costmap: Costmap, rng: np.random.Generator) -> Pose2D:
    rows, columns = costmap.distance.shape
    x, y = costmap.origin + rng.random(2) * (columns, rows) * costmap.resolution
    return Pose2D(float(x), float(y), float(rng.uniform(-math.pi, math.pi)))


def _pieces_to_face(known: SemanticMap) -> list[str]:
    return [name for name, piece in known.furniture.items() if not piece.is_passage]


def _before_furniture(known: SemanticMap, footprint: Footprint, rng: np.random.Generator) -> Pose2D:
    """Return a pose that faces the front of a piece, anywhere along it."""
    pieces = _pieces_to_face(known)
    piece = known.furniture[pieces[int(rng.integers(len(pieces)))]]
    reach = max(0.0, piece.footprint[1] / 2 - 0.1)
    away = piece.footprint[0] / 2 + _BEFORE_FURNITURE + float(footprint.corners[:, 0].max())
    return piece.pose @ Pose2D(-away, float(rng.uniform(-reach, reach)), 0.0)


def _straight_behind(goal: Pose2D, distance: float) -> NDArray[np.float64]:
    """Return poses (N, 3) straight behind the goal."""
    along = -np.arange(0.0, distance + 1e-9, 0.02)
    x, y = goal.x + along * math.cos(goal.theta), goal.y + along * math.sin(goal.theta)
    return np.column_stack([x, y, np.full_like(along, goal.theta)])
