"""Faults of a task that depend on its scene and robot: unknown names."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator
from difflib import get_close_matches
from xml.etree import ElementTree

import numpy as np

from bestman_bt.configuration.checked import numbered
from bestman_bt.configuration.disturbance import DisturbanceConfig
from bestman_bt.configuration.document import FieldPath
from bestman_bt.configuration.errors import Problem, as_far_as_read
from bestman_bt.configuration.run import RunConfig
from bestman_bt.facts.evidence import DrawnTask
from bestman_bt.facts.goals.goal import goals_of, surface_names, unknown
from bestman_bt.scene.scene import World
from bestman_bt.world_model.world_model import WorldModel


def task_problems(task: DrawnTask) -> Iterator[Problem]:
    """Yield all unknown names of the task's goals, disturbances and contacts, and other faults in its world.

    Contacts with objects that the scene leaves out may be allowed.
    """
    config, known = task.config, task.world_model
    faults: list[Problem] = []
    goals = goals_of(task, faults)
    yield from faults
    for goal in goals:
        yield from as_far_as_read(goal.problems)()
    yield from _tolerance_problems(config, task.world)
    for index, disturbance in numbered(config.task.disturbances):
        yield from _disturbance_problems(config, ("disturbances", index), disturbance, known, task.absent)
    yield from _contact_problems(task)


@as_far_as_read
def _tolerance_problems(config: RunConfig, world: World) -> Iterator[Problem]:
    """A tolerance of position that no place in the scene is outside of."""
    places = [wall.start for wall in world.walls] + [wall.end for wall in world.walls]
    places += [(world.robot_start.x, world.robot_start.y)]
    for piece in world.furniture:
        reach = math.hypot(*piece.model.footprint) / 2
        places += [(piece.actual.x + sign * reach, piece.actual.y + sign * reach) for sign in (-1.0, 1.0)]
    extent = float(np.linalg.norm(np.ptp(np.array(places), axis=0)))
    asked = config.task.tolerances.position
    if extent > 0.0 and asked > extent:
        message = f"should be less than the scene's extent, {extent:.1f} m, got {asked:g} m, which allows any place"
        yield config.problem(("tolerances", "position"), message)


@as_far_as_read
def _disturbance_problems(
    config: RunConfig, path: FieldPath, asked: DisturbanceConfig, known: WorldModel, absent: Collection[str]
) -> Iterator[Problem]:
    leaves = [f"{name}/{leaf.name}" for name, piece in known.map.furniture.items() for leaf in piece.leaves]
    if asked.object is not None:
        there = [*known.models, *absent]
        yield from unknown(config, (*path, "object"), asked.object, there, "the scene has no object")
    if asked.articulation is not None:
        what = "the map has no door or drawer"
        yield from unknown(config, (*path, "articulation"), asked.articulation, leaves, what)
    if asked.surface is not None:
        what = "the map has no surface outside doors and drawers called"
        yield from unknown(config, (*path, "surface"), asked.surface, surface_names(known, inside=False), what)


@as_far_as_read
def _contact_problems(task: DrawnTask) -> Iterator[Problem]:
    """Check that ``allowed_contacts`` name bodies of the world, parts of the robot, or objects of the task."""
    config, known = task.config, task.world_model
    robot = ElementTree.fromstring(task.robot_model.urdf)
    walls = [f"wall_{index}" for index in range(len(task.world.walls))]
    leaves = [f"{piece.name}/{leaf.name}" for piece in task.world.furniture for leaf in piece.model.articulations]
    names = [*known.models, *known.map.furniture, *leaves, *task.absent, "floor", *walls, "fingers", "robot"]
    links = [link.get("name", "") for link in robot.iter("link")]
    for index, pair in numbered(config.task.allowed_contacts or ()):
        for side, name in enumerate(pair):
            if name not in names and name not in links:
                close = get_close_matches(name, [*names, *links], n=1)
                remedy = f"did you mean {close[0]!r}?" if close else f"known: {', '.join(names)} and the robot's links"
                message = f"there is no object, piece of furniture or link {name!r}; {remedy}"
                yield config.problem(("allowed_contacts", index, side), message)
