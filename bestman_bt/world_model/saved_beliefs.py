"""Beliefs as plain values for YAML: the knowledge at the end of a run, for later planning. They contain everything that
facts refer to: objects, openings, the hand, searched places. Quantities that can be measured again are not saved:
clouds, obstacles, handles, occupancy. The map and the models belong to the scene.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from bestman_bt.configuration.document import Document
from bestman_bt.configuration.errors import ConfigurationError, Problem
from bestman_bt.configuration.quantity import (
    Angle,
    Distance,
    JointPosition,
    Length,
    Lengths3,
    Number,
    Share,
    Size3,
    Spread,
    Time,
)
from bestman_bt.messages import Box, ObjectModel, PlacedShape, Pose, Pose2D, YawSet
from bestman_bt.registry import suggestion
from bestman_bt.world_model.semantic_map import SemanticMap
from bestman_bt.world_model.world_model import BasePose, HeldObject, ObjectBelief, WorldModel

_GREY = (0.5, 0.5, 0.5)
_DENSITY = 300.0
"""kg/m³, density of an unknown object."""
_FRICTION = 0.5

Quaternion = Annotated[tuple[Number, Number, Number, Number], Field(description="xyzw")]


@dataclass(frozen=True)
class SavedPose:
    """A pose in the map frame; ``position``: metres; ``quaternion``: unit, xyzw."""

    position: Lengths3
    quaternion: Quaternion = (0.0, 0.0, 0.0, 1.0)

    def __post_init__(self) -> None:
        Pose(np.array(self.position), np.array(self.quaternion))  # ValueError where it is none


@dataclass(frozen=True)
class SavedModel:
    """The shape of an object: a ``model`` of the scene, by name, or the ``size`` of an unknown object's box, metres."""

    model: str | None = None
    size: Size3 | None = None

    def __post_init__(self) -> None:
        if (self.model is None) == (self.size is None):
            raise ValueError("should have either a model or a size")


@dataclass(frozen=True)
class SavedObject:
    """An ``ObjectBelief``; ``yaws``: arcs (middle, half width), radians."""

    what: SavedModel
    pose: SavedPose
    surface: str | None = None
    confidence: Share = 1.0
    position_std: Distance = 0.01
    stamp: Time = 0.0
    since: Time | None = None
    score: Share | None = None
    yaws: tuple[tuple[Angle, Spread], ...] = ()


@dataclass(frozen=True)
class SavedHand:
    """A ``HeldObject``, saved under the name of its arm."""

    name: str
    what: SavedModel
    tool_from_object: SavedPose
    width: Distance


@dataclass(frozen=True)
class SavedBase:
    """A ``BasePose``: metres and radians, in the map frame."""

    x: Length
    y: Length
    theta: Angle
    position_std: Distance = 0.0
    heading_std: Spread = 0.0
    stamp: Time = 0.0


@dataclass(frozen=True)
class SavedPiece:
    """The measured pose of a piece of furniture, metres and radians; errors as in ``MapFurniture``."""

    x: Length
    y: Length
    theta: Angle
    position_error: Distance
    heading_error: Spread


@dataclass(frozen=True)
class SavedBeliefs:
    """The saved part of a world model.

    ``hands``: arm → held object. ``openings``: ``furniture/name`` → metres or radians. ``searched``: object → surface
    → time of the last search in vain. ``given_places``: object → surface, as given by the user. ``locked``: doors and
    drawers that did not open. ``blocked``: surfaces that were unreachable, and doors and drawers that could not be
    opened for now. ``in_the_way``: door or drawer → surfaces that were unreachable while it was open.
    ``achieved_effects``: those of your own abilities that have succeeded.
    """

    base: SavedBase | None = None
    objects: Mapping[str, SavedObject] = field(default_factory=dict)
    hands: Mapping[str, SavedHand] = field(default_factory=dict)
    openings: Mapping[str, JointPosition] = field(default_factory=dict)
    furniture: Mapping[str, SavedPiece] = field(default_factory=dict)
    searched: Mapping[str, Mapping[str, Time]] = field(default_factory=dict)
    given_places: Mapping[str, str] = field(default_factory=dict, metadata={"was": "told"})
    locked: tuple[str, ...] = ()
    blocked: tuple[str, ...] = ()
    in_the_way: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    achieved_effects: tuple[str, ...] = field(default=(), metadata={"was": "brought_about"})


def saved(world: WorldModel, mapped: SemanticMap) -> dict[str, Any]:
    """Return the beliefs as plain values, from which ``SavedBeliefs`` can be read; ``mapped``: the map before the
    run.
    """
    base = world.base
    searched: dict[str, dict[str, float]] = {}
    for (name, surface), stamp in world.searched.items():
        if not world.may_be_on(name, surface) and name not in world.objects:
            searched.setdefault(name, {})[surface] = _number(stamp)
    document: dict[str, Any] = {
        "base": _at(base.pose) | {key: _number(getattr(base, key)) for key in ("position_std", "heading_std", "stamp")},
        "objects": {
            name: _saved_object(belief, world) for name, belief in world.objects.items() if world.arm_with(name) is None
        },
        "openings": {name: _number(position) for name, position in world.articulations.items()},
        "furniture": {
            name: _at(piece.pose) | {key: _number(getattr(piece, key)) for key in ("position_error", "heading_error")}
            for name, piece in world.map.furniture.items()
            if piece is not mapped.furniture.get(name)
        },
        "searched": searched,
        "given_places": dict(world.given_places),
        "locked": sorted(world.locked),
        "blocked": sorted(world.blocked),
    }
    if world.in_the_way:
        document["in_the_way"] = {
            door: sorted(place for one, place in world.in_the_way if one == door)
            for door in sorted({door for door, _ in world.in_the_way})
        }
    if world.achieved_effects:
        document["achieved_effects"] = list(world.achieved_effects)
    if world.hands:
        document["hands"] = {
            arm: {
                "name": held.name,
                "what": _saved_model(held.model, world),
                "tool_from_object": _saved_pose(held.tool_from_object),
                "width": _number(held.width),
            }
            for arm, held in world.hands.items()
        }
    return document


def restored(beliefs: SavedBeliefs, document: Document, start: WorldModel) -> WorldModel:
    """Return a world model with these beliefs; ``start``: provides the map and the models.

    ``document``: the source of the beliefs, for error messages. Raises ConfigurationError listing all unknown names,
    and held objects that also lie somewhere.
    """
    problems = [*_unknown_names(beliefs, document, start), *_held_elsewhere(beliefs, document)]
    if problems:
        raise ConfigurationError(problems)
    known = start.map
    for name, piece in beliefs.furniture.items():
        believed = replace(
            known.furniture[name],
            pose=Pose2D(piece.x, piece.y, piece.theta),
            position_error=piece.position_error,
            heading_error=piece.heading_error,
        )
        known = known.with_furniture(believed)
    base = beliefs.base
    world = WorldModel(known, dict(start.models), start.base, given_places=dict(beliefs.given_places))
    world.locked, world.blocked = set(beliefs.locked), set(beliefs.blocked)
    world.in_the_way = {(door, place) for door, places in beliefs.in_the_way.items() for place in places}
    world.achieved_effects = list(beliefs.achieved_effects)
    if base is not None:
        world.base = BasePose(Pose2D(base.x, base.y, base.theta), base.position_std, base.heading_std, base.stamp)
    world.articulations.update(beliefs.openings)
    world.objects = {
        name: ObjectBelief(
            name,
            _model(name, one.what, start),
            _pose(one.pose),
            one.confidence,
            one.position_std,
            one.stamp,
            one.surface,
            YawSet(one.yaws),
            one.since,
            recognised=one.what.model is not None,
            score=one.score,
        )
        for name, one in beliefs.objects.items()
    }
    world.searched = {(name, place): at for name, places in beliefs.searched.items() for place, at in places.items()}
    world.hands = {
        arm: HeldObject(held.name, _model(held.name, held.what, start), _pose(held.tool_from_object), held.width)
        for arm, held in beliefs.hands.items()
    }
    return world


def _unknown_names(beliefs: SavedBeliefs, document: Document, start: WorldModel) -> Iterator[Problem]:
    pieces = start.map.furniture.values()
    surfaces = [
        *start.map.furniture,
        *(f"{piece.name}/{surface.name}" for piece in pieces for surface in piece.surfaces),
    ]
    doors = [f"{piece.name}/{door.name}" for piece in pieces for door in piece.articulations]
    models = [*start.models, *(model.name for model in start.models.values())]
    things = [*start.models, *beliefs.objects]
    asked: list[tuple[tuple[str | int, ...], str, str | None, list[str]]] = []
    for name, one in beliefs.objects.items():
        asked.append((("objects", name, "surface"), "surface", one.surface, surfaces))
        asked.append((("objects", name, "what", "model"), "model", one.what.model, models))
    for arm, held in beliefs.hands.items():
        asked.append((("hands", arm, "what", "model"), "model", held.what.model, models))
    asked += [(("openings", name), "door or drawer", name, doors) for name in beliefs.openings]
    asked += [(("locked", at), "door or drawer", name, doors) for at, name in enumerate(beliefs.locked)]
    asked += [
        (("blocked", at), "surface, door or drawer", name, [*surfaces, *doors])
        for at, name in enumerate(beliefs.blocked)
    ]
    for name, hidden in beliefs.in_the_way.items():
        asked.append((("in_the_way", name), "door or drawer", name, doors))
        asked += [(("in_the_way", name, at), "surface", place, surfaces) for at, place in enumerate(hidden)]
    asked += [(("furniture", name), "furniture", name, list(start.map.furniture)) for name in beliefs.furniture]
    for name, place in beliefs.given_places.items():
        asked += [
            (("given_places", name), "object", name, things),
            (("given_places", name), "surface", place, surfaces),
        ]
    for name, places in beliefs.searched.items():
        asked.append((("searched", name), "object", name, things))
        asked += [(("searched", name, place), "surface", place, surfaces) for place in places]
    for path, kind, name_or_none, known in asked:
        if name_or_none is not None and name_or_none not in known:
            yield document.problem(path, f"the scene has no {kind} {name_or_none!r}; {suggestion(name_or_none, known)}")


def _held_elsewhere(beliefs: SavedBeliefs, document: Document) -> Iterator[Problem]:
    """Yield faults of objects that are in the hand and also lie elsewhere."""
    for held in beliefs.hands.values():
        if held.name in beliefs.objects:
            yield document.problem(
                ("objects", held.name), f"{held.name} is also held by the hand; remove one of the two entries"
            )


def _saved_model(model: ObjectModel, world: WorldModel) -> dict[str, Any]:
    if any(known == model for known in world.models.values()):  # the box of what does not fit has its name, too
        return {"model": model.name}
    return {"size": [_number(extent) for extent in model.size]}


def _saved_object(belief: ObjectBelief, world: WorldModel) -> dict[str, Any]:
    document: dict[str, Any] = {
        "what": _saved_model(belief.model, world),
        "pose": _saved_pose(belief.pose),
        **{key: _number(getattr(belief, key)) for key in ("confidence", "position_std", "stamp")},
    }
    if belief.surface is not None:
        document["surface"] = belief.surface
    if belief.since is not None:
        document["since"] = _number(belief.since)
    if belief.score is not None:
        document["score"] = _number(belief.score)
    if belief.yaw_set.arcs:
        document["yaws"] = [[_number(middle), _number(half)] for middle, half in belief.yaw_set.arcs]
    return document


def _saved_pose(pose: Pose) -> dict[str, Any]:
    return {key: [_number(value) for value in getattr(pose, key)] for key in ("position", "quaternion")}


def _at(pose: Pose2D) -> dict[str, float]:
    return {"x": _number(pose.x), "y": _number(pose.y), "theta": _number(pose.theta)}


def _number(value: float) -> float:
    """Round to a micrometre or a microsecond: more is noise, and hard to read."""
    return round(float(value), 6)


def _pose(pose: SavedPose) -> Pose:
    return Pose(np.array(pose.position), np.array(pose.quaternion))


def _model(name: str, what: SavedModel, start: WorldModel) -> ObjectModel:
    if what.size is not None:
        box = (PlacedShape(Box(what.size), Pose()),)
        return ObjectModel(name, _GREY, _DENSITY * float(np.prod(what.size)), _FRICTION, box, symmetry_order=2)
    known = {model.name: model for model in reversed(start.models.values())} | dict(start.models)
    return known[str(what.model)]
