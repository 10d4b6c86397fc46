"""What a task asks for in one drawn world: which object goes where, in the map frame."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from bestman_bt.configuration import RunConfig
from bestman_bt.configuration.task import GoalConfig
from bestman_bt.messages import ObjectModel, Pose
from bestman_bt.scene import World
from bestman_bt.world_model import SemanticMap


@dataclass(frozen=True, eq=False)
class TaskGoal:
    """``object``, to be sought on ``source``, shall stand at ``pose`` (map frame) on ``surface``.

    In a drawer the pose is that with the drawer closed; it moves with it.
    """

    name: str
    object: str
    source: str
    surface: str
    pose: Pose


def task_goals(config: RunConfig, world: World, models: Mapping[str, ObjectModel]) -> tuple[TaskGoal, ...]:
    """The goals of a task whose names have been checked; of objects to choose from, the seed has chosen."""
    return tuple(_resolved(goal, config.seed, world, models) for goal in config.task.all_goals)


def told_places(goals: Iterable[TaskGoal], known: SemanticMap) -> dict[str, str]:
    """Object → surface, by its full name, where a task says that it is to be sought."""
    places = {}
    for goal in goals:
        furniture, surface = known.surface(goal.source)
        places[goal.object] = f"{furniture.name}/{surface.name}"
    return places


def reach_goal(config: RunConfig, world: World) -> Pose | None:
    """Where the tool shall be, map_from_tool: it points down; None where the task asks for no reach."""
    asked = config.task.reach
    if asked is None:
        return None
    goal = world.goals[asked.goal]
    height = float(np.random.default_rng([config.seed, 4]).uniform(*asked.height))
    return Pose.from_xyz_rpy(goal.position + np.array([0.0, 0.0, height]), (math.pi, 0.0, goal.yaw))


def _resolved(goal: GoalConfig, seed: int, world: World, models: Mapping[str, ObjectModel]) -> TaskGoal:
    pose = world.goals[goal.name]
    if isinstance(goal.object, str):
        return TaskGoal(goal.name, goal.object, goal.source, goal.surface, pose)
    present = [thing.name for thing in world.objects if thing.name in goal.object]
    names = present or [name for name in goal.object if name in models]
    chosen = names[int(np.random.default_rng([seed, 3]).integers(len(names)))]
    lift = (float(models[chosen].size[2]) - float(world.goal_heights[goal.name])) / 2
    higher = Pose(pose.position + np.array([0.0, 0.0, lift]), pose.quaternion)
    return TaskGoal(goal.name, chosen, goal.source, goal.surface, higher)
