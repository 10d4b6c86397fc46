"""Loads scenes from YAML, including files that extend others, and checks all placements."""

from __future__ import annotations

import copy
import itertools
import math
import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from bestman_bt.configuration.checked import override, salvage
from bestman_bt.configuration.data import beside, find_data
from bestman_bt.configuration.document import Document, read_document
from bestman_bt.configuration.errors import (
    ConfigurationError,
    Problem,
    ProblemCollector,
    UnreadError,
    up_to_unread_field,
)
from bestman_bt.messages import Box, Cylinder, Mesh, ObjectModel, Pose, Shape, Sphere
from bestman_bt.registry import suggestion
from bestman_bt.scene.apartment_generator.furnish import NEEDED
from bestman_bt.scene.furniture_file import read_furniture
from bestman_bt.scene.object_file import read_object
from bestman_bt.scene.placing import standing_furniture
from bestman_bt.scene.plane_geometry import Points, overlap_depth
from bestman_bt.scene.scene import FurnitureModel, PlacedFurniture, Surface
from bestman_bt.scene.scene_config import FurniturePlacement, GoalPlacement, ObjectPlacement, SceneConfig, SceneFile

_NUMBERED = re.compile(r"(wall|walker)_\d+")
_RESERVED = ("robot", "fingers", "floor")


def _generator_faults(scene: SceneConfig, document: Document) -> Iterator[Problem]:
    """Yield faults of fields that a file lacks without a generator, or has although the generator sets them."""
    written = document.data
    if written.get("generator") is None:
        for name in ("walls", "furniture", "robot_start"):
            if written.get(name) is None and not scene.unread_base:
                yield document.problem((name,), "is missing")
        return
    for name in ("walls", "furniture"):
        own, there = document.origin(())[0], document.origin((name,))
        if written.get(name) and there[0] != own and document.origin(("generator",))[0] == own:
            message = f"makes the {name}, and the scene that this one extends gives them ({there[0]}:{there[1]}); "
            yield document.problem(("generator",), f"{message}give one or the other")
        elif written.get(name):
            yield document.problem((name,), "the generator makes them; give one or the other")


def _name_faults(file: SceneFile, document: Document) -> Iterator[Problem]:
    """Yield faults of names: each body needs a unique name, by which contacts are reported."""
    for kind, names in (("furniture", file.furniture), ("unmapped", file.unmapped), ("objects", file.objects)):
        for name in names:
            if name in _RESERVED or _NUMBERED.fullmatch(name):
                message = f"the name {name!r} is taken: {', '.join(_RESERVED)}, wall_0, walker_1, … have a meaning"
                yield document.problem((kind, name), f"{message} of their own; choose another")
            elif (kind != "furniture" and name in file.furniture) or (kind == "objects" and name in file.unmapped):
                message = f"the name {name!r} is taken by a piece of furniture; choose another"
                yield document.problem((kind, name), message)


_ABSENT = "absent"
_REMOVABLE = ("furniture", "unmapped", "objects", "goals")


def load_scene(name_or_path: str | Path, overrides: Mapping[str, Any] | None = None) -> SceneConfig:
    """Read a scene; a bare name means a shipped one. Raises ConfigurationError with file, line and field.

    ``overrides``: dotted keys → values, for example ``{"objects.cup": "absent", "finger_friction": 0.05}``.
    """
    path = find_data("scene", name_or_path)
    faults = ProblemCollector()
    document, unread_base = _extended(path, (), faults)
    for key, value in (overrides or {}).items():
        with faults.step():
            document = override(document, SceneFile, {key: value}, prefix="scene.")
    absent = _absent(document)
    document = _without_absent(document)
    file, problems = salvage(document, SceneFile)
    faults.problems += problems
    scene = SceneConfig(path.stem, file, {}, {}, {}, absent=absent, unread_base=unread_base, document=document)
    scene = _resolved(scene, faults.problems)
    faults.raise_if_any()
    return scene


def _extended(path: Path, below: tuple[Path, ...], faults: ProblemCollector) -> tuple[Document, bool]:
    """Return the document merged into those that it extends, and whether one of these could not be read."""
    document = _from_its_folder(read_document(path, faults.problems), path)
    base_name = document.data.get("extends")
    if not isinstance(base_name, str):
        return document, False
    with faults.step():
        base_path = find_data("scene", base_name, document.problem(("extends",), ""))
        if base_path in (*below, path):
            raise ConfigurationError([document.problem(("extends",), f"{base_name!r} extends itself")])
        base, unread = _extended(base_path, (*below, path), faults)
        faults.problems += _wrongly_absent(document, base.data) if not unread else ()
        return base.merged(document), unread
    return document, True


def _wrongly_absent(document: Document, base: Mapping[str, Any]) -> Iterator[Problem]:
    for kind in _REMOVABLE:
        named, there = document.data.get(kind), base.get(kind)
        known = list(there) if isinstance(there, dict) else []
        for name, value in named.items() if isinstance(named, dict) else ():
            if value == _ABSENT and name not in known:
                message = f"cannot be removed: the base scene has no such entry; {suggestion(name, known)}"
                yield document.problem((kind, name), message)


def _from_its_folder(document: Document, path: Path) -> Document:
    """Return the document with its paths relative to its file."""
    data = copy.deepcopy(document.data)
    if isinstance(data.get("extends"), str):
        data["extends"] = beside(path, "scene", data["extends"])
    for key, kind in (
        ("furniture", "furniture"),
        ("unmapped", "furniture"),
        ("objects", "object"),
        ("goals", "object"),
    ):
        placements = data.get(key)
        for placement in placements.values() if isinstance(placements, dict) else ():
            if isinstance(placement, dict) and isinstance(placement.get("model"), str):
                placement["model"] = beside(path, kind, placement["model"])
    return replace(document, data=data)


def _absent(document: Document) -> tuple[str, ...]:
    kinds = (document.data.get(kind) for kind in ("furniture", "objects"))
    return tuple(name for kind in kinds if isinstance(kind, dict) for name, value in kind.items() if value == _ABSENT)


def _without_absent(document: Document) -> Document:
    data = copy.deepcopy(document.data)
    for kind in _REMOVABLE:
        if isinstance(data.get(kind), dict):
            data[kind] = {name: value for name, value in data[kind].items() if value != _ABSENT}
    return replace(document, data=data)


def _resolved(scene: SceneConfig, problems: list[Problem]) -> SceneConfig:
    """Return the scene with the files that it names, as far as they can be read; faults are added to ``problems``."""
    file, document = scene.file, scene.document
    problems += [*_generator_faults(scene, document), *_name_faults(file, document)]
    furniture: dict[str, FurnitureModel] = {}
    models: dict[str, ObjectModel] = {}
    goal_models: dict[str, ObjectModel] = {}
    unmapped: dict[str, FurnitureModel] = {}
    for kind, placed, pieces in (("furniture", file.furniture, furniture), ("unmapped", file.unmapped, unmapped)):
        for piece, model in given(placed, "model").items():
            try:
                pieces[piece] = read_furniture(model, document.problem((kind, piece, "model"), ""))
            except ConfigurationError as error:
                problems += error.problems
    if file.generator is not None:
        furniture |= {name: read_furniture(name) for name in NEEDED}
    # The robot tells things by the names of their models: the only thing of a model gives it its name.
    of_objects = given(file.objects, "model")
    own_name = {model for model, count in Counter(of_objects.values()).items() if count == 1}
    named_otherwise = {model for key, model in of_objects.items() if key != Path(model).stem}
    # goals first: an object of the scene that bears the name of a goal's model decides what it means
    for kind, key, model in [
        *(("goals", goal, model) for goal, model in given(file.goals, "model").items()),
        *(("objects", thing, model) for thing, model in of_objects.items()),
    ]:
        try:
            found = read_object(model, document.problem((kind, key, "model"), ""))
            if kind == "goals":
                goal_models[key] = found
                if model in named_otherwise:
                    continue  # two equal models of one thing could not be told apart
            if kind == "objects" and model in own_name:
                found = replace(found, name=key)
            models[found.name if kind == "goals" else key] = found
        except ConfigurationError as error:
            problems += error.problems
    scene = replace(scene, furniture=furniture, models=models, goal_models=goal_models, unmapped=unmapped)
    problems += list(placement_faults(scene, document, problems))
    return scene


TOLERANCE = 0.005
"""Metres by which solids may overlap: touching or standing on each other is not a fault."""
_CIRCLE = np.linspace(0.0, 2.0 * np.pi, 32, endpoint=False)


@dataclass(frozen=True, eq=False)
class _Prism:
    """The outline of a part in top view, (N, 2), convex and counter-clockwise, and its lower and upper height,
    metres.
    """

    outline: Points
    bottom: float
    top: float


def furniture_overlaps(pieces: Sequence[PlacedFurniture]) -> Iterator[tuple[str, str, float]]:
    """Yield each pair of pieces that overlap by more than ``TOLERANCE``, and the depth, metres.

    Pieces are at their nominal poses, doors and drawers at their initial openings. An upright part is exact, a tilted
    one counts as its enclosing prism.
    """
    solids = {piece.name: list(_prisms(piece)) for piece in pieces}
    for index, later in enumerate(pieces):
        for earlier in pieces[:index]:
            depth = max((_depth(a, b) for a, b in product(solids[earlier.name], solids[later.name])), default=0.0)
            if depth > TOLERANCE:
                yield earlier.name, later.name, depth


def _depth(a: _Prism, b: _Prism) -> float:
    upright = min(a.top, b.top) - max(a.bottom, b.bottom)
    return min(upright, overlap_depth(a.outline, b.outline)) if upright > TOLERANCE else 0.0


def _prisms(piece: PlacedFurniture) -> Iterator[_Prism]:
    frame = piece.nominal.to_pose(piece.elevation)
    bodies = [(frame, piece.model.parts)]
    bodies += [(frame @ door.moved(piece.open.get(door.name, 0.0)), door.parts) for door in piece.model.articulations]
    for body, parts in bodies:
        for part in parts:
            yield _prism(part.shape, body @ part.pose)


def _prism(shape: Shape, pose: Pose) -> _Prism:
    points = pose.apply(_outermost(shape))
    outline = points[ConvexHull(points[:, :2]).vertices, :2]
    return _Prism(outline, float(points[:, 2].min()), float(points[:, 2].max()))


def _outermost(shape: Shape) -> NDArray[np.float64]:
    """Return points (N, 3) whose hull is that of the shape, in its frame; round ones by points on their rims."""
    rim = np.column_stack([np.cos(_CIRCLE), np.sin(_CIRCLE), np.zeros_like(_CIRCLE)])
    match shape:
        case Box():
            return np.array(list(product((-0.5, 0.5), repeat=3))) * shape.size
        case Cylinder():
            ends = [shape.radius * rim + (0.0, 0.0, z) for z in (-shape.length / 2, shape.length / 2)]
            return np.concatenate(ends)
        case Sphere():
            return shape.radius * np.concatenate([rim, rim[:, [1, 2, 0]], rim[:, [2, 0, 1]]])
        case Mesh():
            return shape.vertices


def placement_faults(scene: SceneConfig, document: Document, found: Sequence[Problem]) -> Iterator[Problem]:
    """Yield all faults of places, each with its line.

    ``found``: known faults, which are omitted from ``scene``; their consequences are not reported.
    """
    yield from _choice_faults(scene, document)
    yield from _opening_faults(scene, document)
    faults = list(_surface_faults(scene, document))
    yield from faults
    yield from _object_overlaps(scene, document)
    for earlier, later, depth in furniture_overlaps(standing_furniture(_rightly_placed(scene, (*found, *faults)))):
        message = f"stands {100.0 * depth:.1f} cm deep in {earlier!r}; furniture may touch or stand on other furniture"
        yield document.problem(("furniture", later, "at"), message)


def given(entries: Mapping[str, Any], field: str) -> dict[str, Any]:
    """Name and field of all entries of a mapping in a scene's file whose field could be read."""
    read = {}
    for name, entry in entries.items():
        with suppress(UnreadError):
            read[name] = getattr(entry, field)
    return read


def _rightly_placed(scene: SceneConfig, found: Sequence[Problem]) -> SceneConfig:
    """Return the scene with only the furniture that has no faults and stands on no furniture with faults."""
    right: dict[str, FurniturePlacement] = {}
    for name, placement in scene.file.furniture.items():
        fields = ("furniture", f"furniture.{name}")
        wrong = any(one.field in fields or one.field.startswith(f"{fields[1]}.") for one in found)
        if not wrong and name in scene.furniture and (placement.on or name).partition("/")[0] in {*right, name}:
            right[name] = placement
    return replace(scene, file=SceneFile(furniture=right))


def _choice_faults(scene: SceneConfig, document: Document) -> Iterator[Problem]:
    for thing in scene.file.objects:
        written = document.data["objects"][thing]
        given = [key for key in ("region", "at") if written.get(key) is not None]
        if not given:
            yield document.problem(("objects", thing), "one of 'region' and 'at' should be given")
        elif len(given) == 2:
            message = "'region' is given too; 'region: null' takes it away"
            yield document.problem(("objects", thing, "at"), message)


def _opening_faults(scene: SceneConfig, document: Document) -> Iterator[Problem]:
    placed = [("furniture", name, item.open, scene.furniture) for name, item in scene.file.furniture.items()]
    placed += [("unmapped", name, item.open, scene.unmapped) for name, item in scene.file.unmapped.items()]
    for kind, piece, opened, models in placed:
        for name, why in _misopened(piece, opened, models[piece]) if piece in models else ():
            yield document.problem((kind, piece, "open", name), why)
    every = {**scene.furniture, **scene.unmapped}
    doors = [f"{piece}/{door.name}" for piece, model in every.items() for door in model.articulations]
    for name in scene.file.moving_doors if scene.file.generator is None else ():
        if name not in doors and _can_be_judged(name, scene, document):
            yield document.problem(("moving_doors", name), f"is not a door here; {suggestion(name, doors)}")


def _surface_faults(scene: SceneConfig, document: Document) -> Iterator[Problem]:
    asked: list[tuple[str, str, ObjectPlacement | GoalPlacement]] = []
    asked += [("objects", name, placement) for name, placement in scene.file.objects.items()]
    asked += [("goals", name, placement) for name, placement in scene.file.goals.items()]
    for kind, name, placement in asked:
        yield from _faults_on_surface(scene, document, (kind, name), placement)
    names = list(scene.file.furniture)
    for name, on in given(scene.file.furniture, "on").items():
        below = (on or "").partition("/")[0]
        if on is None:
            continue
        yield from _unknown_surface(scene, document, ("furniture", name, "on"), on)
        if below in names and names.index(below) >= names.index(name):
            message = f"{below!r} should be named above what stands on it, got {on!r}"
            yield document.problem(("furniture", name, "on"), message)


@up_to_unread_field
def _faults_on_surface(
    scene: SceneConfig, document: Document, path: tuple[str, str], placement: ObjectPlacement | GoalPlacement
) -> Iterator[Problem]:
    """Yield faults of objects on surfaces: an unknown surface, or a position outside it."""
    name = placement.surface
    unknown = list(_unknown_surface(scene, document, (*path, "surface"), name))
    yield from unknown
    if unknown or name.partition("/")[0] not in scene.furniture:
        return
    _, surface = scene.surface(name)
    at = placement.at if isinstance(placement, ObjectPlacement) else None
    if at is not None and _is_beside([(at[0], at[0]), (at[1], at[1])], surface):
        yield document.problem((*path, "at"), _beside(name, surface))
    if placement.region is not None and _is_beside([placement.region.x, placement.region.y], surface):
        yield document.problem((*path, "region"), _beside(name, surface))


def _unknown_surface(
    scene: SceneConfig, document: Document, path: tuple[str, str, str], name: str
) -> Iterator[Problem]:
    try:
        scene.surface(name)
    except KeyError as error:
        if name == "floor":
            remedy = "leave 'on' out" if path[0] == "furniture" else "name a surface of furniture, such as table/top"
            what = "furniture without 'on' stands there" if path[0] == "furniture" else "nothing lies there"
            yield document.problem(path, f"the floor is not a surface: {what}; {remedy}")
        elif _can_be_judged(name, scene, document):
            yield document.problem(path, str(error.args[0]))


def _can_be_judged(name: str, scene: SceneConfig, document: Document) -> bool:
    """Return whether ``piece/part`` certainly does not exist; False if the piece itself could not be read."""
    written = [document.data.get(kind) for kind in ("furniture", "unmapped")]
    piece, read = name.partition("/")[0], {*scene.furniture, *scene.unmapped}
    unread = [pieces is not None and (not isinstance(pieces, dict) or piece in {*pieces} - read) for pieces in written]
    return not scene.unread_base and not any(unread)


def _is_beside(ranges: Sequence[tuple[float, float]], surface: Surface) -> bool:
    """Return whether no point with coordinates in ``ranges`` lies over the surface."""
    sizes = zip(ranges, surface.size, strict=True)
    return any(lower > size / 2 or upper < -size / 2 for (lower, upper), size in sizes)


def _beside(name: str, surface: Surface) -> str:
    x, y = (50.0 * size for size in surface.size)
    reach = f"from {-x:.4g} to {x:.4g} cm along its x, from {-y:.4g} to {y:.4g} cm along its y"
    return f"lies beside {name!r}, which reaches {reach}"


def _object_overlaps(scene: SceneConfig, document: Document) -> Iterator[Problem]:
    """Yield overlaps of objects with an exact pose: circles that lie within both of their outlines overlap."""
    surfaces, places = given(scene.file.objects, "surface"), given(scene.file.objects, "at")
    placed = {
        name: (surface, places[name])
        for name, surface in surfaces.items()
        if places[name] is not None and name in scene.models
    }
    for (earlier, (surface, here)), (later, (other, there)) in itertools.combinations(placed.items(), 2):
        radii = sum(float(scene.models[name].size[:2].min()) / 2 for name in (earlier, later))
        depth = radii - math.dist(here[:2], there[:2])
        if surface == other and depth > 0.0:
            message = f"stands {100.0 * depth:.1f} cm deep in {earlier!r}; each object needs its own place"
            yield document.problem(("objects", later, "at"), message)


def _misopened(piece: str, opened: Mapping[str, float], model: FurnitureModel) -> Iterator[tuple[str, str]]:
    """Yield names of doors and drawers that cannot be open as requested, and why."""
    doors = {door.name: door for door in model.articulations}
    for name, position in opened.items():
        if name not in doors:
            yield name, f"{piece!r} has no door or drawer {name!r}; {suggestion(name, list(doors))}"
        elif not 0.0 <= position <= doors[name].upper:
            scale, unit = (math.degrees(1.0), " deg") if doors[name].kind == "revolute" else (100.0, " cm")
            upper, asked = scale * doors[name].upper, scale * position
            yield name, f"opens from 0 to {upper:.4g}{unit}, got {asked:.4g}{unit}"
