"""Faults of a task that show only against its scene and its robot: names that nothing there bears."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Iterator
from difflib import get_close_matches
from xml.etree import ElementTree

import numpy as np

from bestman_bt.configuration import DisturbanceConfig, Problem, RunConfig
from bestman_bt.configuration.document import FieldPath
from bestman_bt.configuration.quantity import parse_quantity
from bestman_bt.configuration.task import GoalConfig, OpeningConfig
from bestman_bt.registry import suggestion
from bestman_bt.robot_model import ArmModel, BaseModel, RobotModel
from bestman_bt.scene import World
from bestman_bt.world_model import WorldModel


def task_problems(
    config: RunConfig, world: World, known: WorldModel, robot: RobotModel, absent: Collection[str] = ()
) -> Iterator[Problem]:
    """All unknown names of the task's goals, opening, tidying, reaching, lifting, disturbances and contacts.

    ``absent``: what the scene leaves out. Contacts with that may be allowed all the same, and it may be one of the
    objects to choose from.
    """
    task = config.task
    if task.goal is not None:
        yield from _goal_problems(config, ("goal",), task.goal, world, known, absent)
    for index, goal in enumerate(task.goals):
        yield from _goal_problems(config, ("goals", index), goal, world, known, absent)
    if task.opening is not None:
        yield from _opening_problems(config, task.opening, world)
    if task.tidy is not None:
        for index, name in enumerate(task.tidy.objects):
            yield from _unknown_object(config, ("tidy", "objects", index), name, known)
        for field in ("source", "surface"):
            name = getattr(task.tidy, field)
            yield from _unknown(config, ("tidy", field), name, _surfaces(known), "the map has no surface")
    if task.drive is not None and not robot.of(BaseModel):
        yield config.problem(("drive",), f"needs a mobile base, and robot {robot.name} has none")
    if (task.reach is not None or task.lift is not None) and not robot.of(ArmModel):
        asked = "reach" if task.reach is not None else "lift"
        yield config.problem((asked,), f"needs an arm, and robot {robot.name} has none")
    if task.reach is not None:
        yield from _unknown(config, ("reach", "goal"), task.reach.goal, world.goals, "the scene has no goal")
    if task.lift is not None:
        yield from _unknown_object(config, ("lift", "object"), task.lift.object, known)
        yield from _unknown(config, ("lift", "source"), task.lift.source, _surfaces(known), "the map has no surface")
    yield from _tolerance_problems(config, world)
    for index, disturbance in enumerate(task.disturbances):
        yield from _disturbance_problems(config, ("disturbances", index), disturbance, known, absent)
    yield from _contact_problems(config, world, [*known.models, *known.map.furniture, *absent], robot)


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
        message = f"should be less than the scene's extent, {extent:.1f} m, got {asked:g} m: it would allow any place"
        yield config.problem(("tolerances", "position"), message)


def _opening_problems(config: RunConfig, asked: OpeningConfig, world: World) -> Iterator[Problem]:
    """An unknown door or drawer, and how far it shall be open: in a unit of its joint, and where that can be."""
    leaves = {f"{piece.name}/{leaf.name}": leaf for piece in world.furniture for leaf in piece.model.articulations}
    leaf = leaves.get(asked.articulation)
    if leaf is None:
        message = f"the scene has no door or drawer {asked.articulation!r}"
        yield config.problem(("opening", "articulation"), f"{message}; {suggestion(asked.articulation, list(leaves))}")
        return
    dimension, scale, unit = (
        ("angle", math.degrees(1.0), " deg") if leaf.kind == "revolute" else ("length", 100.0, " cm")
    )
    written = config.written.data.get("opening") or {}
    for name, value in (("at_least", asked.at_least), ("at_most", asked.at_most)):
        if value is None:
            continue
        try:
            parse_quantity(written.get(name, value), dimension)
        except ValueError as error:
            yield config.problem(("opening", name), f"{asked.articulation!r} has a {leaf.kind} joint: {error}")
            continue
        if not 0.0 <= value <= leaf.upper:
            limits = f"opens from 0 to {scale * leaf.upper:.4g}{unit}, got {scale * value:.4g}{unit}"
            yield config.problem(("opening", name), f"{asked.articulation!r} {limits}")


def _goal_problems(
    config: RunConfig, path: FieldPath, goal: GoalConfig, world: World, known: WorldModel, absent: Collection[str]
) -> Iterator[Problem]:
    yield from _unknown(config, (*path, "name"), goal.name, world.goals, "the scene has no goal")
    if isinstance(goal.object, str):
        yield from _unknown_object(config, (*path, "object"), goal.object, known)
    else:
        if not goal.object:
            yield config.problem((*path, "object"), "should name at least one object")
        elif set(goal.object) <= set(absent):
            yield config.problem((*path, "object"), "the scene leaves out all of these objects")
        for index, name in enumerate(goal.object):
            yield from _unknown_object(config, (*path, "object", index), name, known, absent)
    for field in ("source", "surface"):
        yield from _unknown(config, (*path, field), getattr(goal, field), _surfaces(known), "the map has no surface")


def _disturbance_problems(
    config: RunConfig, path: FieldPath, asked: DisturbanceConfig, known: WorldModel, absent: Collection[str]
) -> Iterator[Problem]:
    leaves = [f"{name}/{leaf.name}" for name, piece in known.map.furniture.items() for leaf in piece.leaves]
    if asked.object is not None:
        there = [*known.models, *absent]
        yield from _unknown(config, (*path, "object"), asked.object, there, "the scene has no object")
    if asked.articulation is not None:
        what = "the map has no door or drawer"
        yield from _unknown(config, (*path, "articulation"), asked.articulation, leaves, what)
    if asked.surface is not None:
        what = "the map has no surface outside doors and drawers called"
        yield from _unknown(config, (*path, "surface"), asked.surface, _surfaces(known, inside=False), what)


def _unknown_object(
    config: RunConfig, path: FieldPath, name: str, known: WorldModel, absent: Collection[str] = ()
) -> Iterator[Problem]:
    """An object that the robot does not know, or not by this name: of several things of one model it gets to see, the
    first bears the model's name.
    """
    yield from _unknown(config, path, name, [*known.models, *absent], "the robot knows no object")
    model = known.models[name].name if name in known.models else name
    if model != name:
        yield config.problem(
            path,
            f"the scene has several things of the model {model!r}, which the robot cannot tell from each other: "
            f"write {model!r}, not {name!r}, or give the thing a model of its own",
        )


def _unknown(config: RunConfig, path: FieldPath, value: str, names: Iterable[str], what: str) -> Iterator[Problem]:
    there = list(names)
    if value not in there:
        yield config.problem(path, f"{what} {value!r}; {suggestion(value, there)}")


def _surfaces(known: WorldModel, inside: bool = True) -> list[str]:
    """Names of furniture and surfaces; without ``inside`` not those of surfaces in drawers and behind doors."""
    pieces = known.map.furniture
    surfaces = [(piece, surface) for piece in pieces.values() for surface in piece.surfaces]
    return [*pieces, *(f"{p.name}/{s.name}" for p, s in surfaces if inside or not p.is_inside(s))]


def _contact_problems(config: RunConfig, world: World, things: list[str], model: RobotModel) -> Iterator[Problem]:
    """``allowed_contacts`` name bodies of the world, parts of the robot, or what the robot may be asked to fetch."""
    robot = ElementTree.fromstring(model.urdf)
    walls = [f"wall_{index}" for index in range(len(world.walls))]
    names = [*things, "floor", *walls, "fingers", "robot"]
    links = [link.get("name", "") for link in robot.iter("link")]
    for index, pair in enumerate(config.task.allowed_contacts or ()):
        for side, name in enumerate(pair):
            if name not in names and name not in links:
                close = get_close_matches(name, [*names, *links], n=1)
                remedy = f"did you mean {close[0]!r}?" if close else f"known: {', '.join(names)} and the robot's links"
                message = f"there is no object, piece of furniture or link {name!r}; {remedy}"
                yield config.problem(("allowed_contacts", index, side), message)
