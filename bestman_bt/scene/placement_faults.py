"""What is wrong with where things stand in a scene: surfaces that are not there, places beside them, overlaps."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from bestman_bt.configuration import Document, Problem
from bestman_bt.messages import Box, Cylinder, Mesh, Pose, Shape, Sphere
from bestman_bt.registry import suggestion
from bestman_bt.scene.placing import standing_furniture
from bestman_bt.scene.plane_geometry import Points, overlap_depth
from bestman_bt.scene.scene import FurnitureModel, PlacedFurniture, Surface
from bestman_bt.scene.scene_config import GoalPlacement, ObjectPlacement

if TYPE_CHECKING:
    from bestman_bt.scene.scene_config import SceneConfig


# Furniture that stands in other furniture: its solids compared as upright prisms, part by part.


TOLERANCE = 0.005
"""Metres by which solids may reach into each other: what touches or stands on something else is no fault."""
_CIRCLE = np.linspace(0.0, 2.0 * np.pi, 32, endpoint=False)


@dataclass(frozen=True, eq=False)
class _Prism:
    """What a part covers seen from above (N, 2), convex and counter-clockwise, and between which heights, metres."""

    outline: Points
    bottom: float
    top: float


def furniture_overlaps(pieces: Sequence[PlacedFurniture]) -> Iterator[tuple[str, str, float]]:
    """Each two pieces, in their order, that overlap by more than ``TOLERANCE``, and by how much, metres.

    Pieces stand where the map has them, doors and drawers open as at the start. A part that stands upright is taken
    as it is, one that leans as the prism around it.
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
    bodies += [(frame @ leaf.moved(piece.open.get(leaf.name, 0.0)), leaf.parts) for leaf in piece.model.articulations]
    for body, parts in bodies:
        for part in parts:
            yield _prism(part.shape, body @ part.pose)


def _prism(shape: Shape, pose: Pose) -> _Prism:
    points = pose.apply(_outermost(shape))
    outline = points[ConvexHull(points[:, :2]).vertices, :2]
    return _Prism(outline, float(points[:, 2].min()), float(points[:, 2].max()))


def _outermost(shape: Shape) -> NDArray[np.float64]:
    """Points (N, 3) whose hull is that of the shape, in its frame; round ones by points on their rims."""
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
    """All faults of places, each at the line that is at fault.

    ``found``: what is known to be wrong already, and left out of ``scene``; it is not told again as a consequence.
    """
    yield from _choice_faults(scene, document)
    yield from _opening_faults(scene, document)
    faults = list(_surface_faults(scene, document))
    yield from faults
    yield from _object_overlaps(scene, document)
    read = all(name in scene.furniture for name in scene.file.furniture)
    if read and not any(problem.field.startswith("furniture") for problem in (*found, *faults)):
        for earlier, later, depth in furniture_overlaps(standing_furniture(scene)):
            message = (
                f"stands {100.0 * depth:.1f} cm deep in {earlier!r}; furniture may touch or stand on other furniture"
            )
            yield document.problem(("furniture", later, "at"), message)


def written_texts(document: Document, kind: str, field: str) -> Iterator[tuple[str, str]]:
    """Name and text in ``field`` of all that a scene's file places, also of what other faults leave out."""
    placed = document.data.get(kind)
    for name, placement in placed.items() if isinstance(placed, dict) else ():
        text = placement.get(field) if isinstance(placement, dict) else None
        if isinstance(text, str):
            yield name, text


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
    doors = [f"{piece}/{leaf.name}" for piece, model in every.items() for leaf in model.articulations]
    for name in scene.file.moving_doors if scene.file.generator is None else ():
        if name not in doors and _is_known(name, scene, document):
            yield document.problem(("moving_doors", name), f"is no door here; {suggestion(name, doors)}")


def _surface_faults(scene: SceneConfig, document: Document) -> Iterator[Problem]:
    checked: dict[str, Mapping[str, ObjectPlacement | GoalPlacement]] = {
        "objects": scene.file.objects,
        "goals": scene.file.goals,
    }
    surfaces = [(kind, *named) for kind in checked for named in written_texts(document, kind, "surface")]
    for kind, name, asked in surfaces:
        try:
            _, surface = scene.surface(asked)
        except KeyError as error:
            if _is_known(asked, scene, document):
                yield document.problem((kind, name, "surface"), str(error.args[0]))
            continue
        item = checked[kind].get(name)
        if item is None:
            continue
        at = item.at if isinstance(item, ObjectPlacement) else None
        if at is not None and _is_beside([(at[0], at[0]), (at[1], at[1])], surface):
            yield document.problem((kind, name, "at"), _beside(asked, surface))
        if item.region is not None and _is_beside([item.region.x, item.region.y], surface):
            yield document.problem((kind, name, "region"), _beside(asked, surface))
    names = [name for name, _ in written_texts(document, "furniture", "model")]
    for name, asked in written_texts(document, "furniture", "on"):
        try:
            below, _ = scene.surface(asked)
        except KeyError as error:
            if _is_known(asked, scene, document):
                yield document.problem(("furniture", name, "on"), str(error.args[0]))
            continue
        if {below, name} <= {*names} and names.index(below) >= names.index(name):
            message = f"{below!r} should be named above what stands on it, got {asked!r}"
            yield document.problem(("furniture", name, "on"), message)


def _is_known(name: str, scene: SceneConfig, document: Document) -> bool:
    """Whether what is said of ``piece/part`` can be judged: not where the piece itself could not be read."""
    piece = name.partition("/")[0]
    return all(
        piece in models or piece not in (document.data.get(kind) or {})
        for kind, models in (("furniture", scene.furniture), ("unmapped", scene.unmapped))
    )


def _is_beside(ranges: Sequence[tuple[float, float]], surface: Surface) -> bool:
    """Whether no point with coordinates in ``ranges`` lies over the surface."""
    sizes = zip(ranges, surface.size, strict=True)
    return any(lower > size / 2 or upper < -size / 2 for (lower, upper), size in sizes)


def _beside(name: str, surface: Surface) -> str:
    x, y = (50.0 * size for size in surface.size)
    reach = f"from {-x:.4g} to {x:.4g} cm along its x, from {-y:.4g} to {y:.4g} cm along its y"
    return f"lies beside {name!r}, which reaches {reach}"


def _object_overlaps(scene: SceneConfig, document: Document) -> Iterator[Problem]:
    """Of objects that stand exactly somewhere: circles that lie within both of their outlines overlap."""
    placed = {
        name: (placement.surface, placement.at)
        for name, placement in scene.file.objects.items()
        if placement.at is not None and name in scene.models
    }
    for (earlier, (surface, here)), (later, (other, there)) in itertools.combinations(placed.items(), 2):
        radii = sum(float(scene.models[name].size[:2].min()) / 2 for name in (earlier, later))
        depth = radii - math.dist(here[:2], there[:2])
        if surface == other and depth > 0.0:
            message = f"stands {100.0 * depth:.1f} cm deep in {earlier!r}; each object needs a place of its own"
            yield document.problem(("objects", later, "at"), message)


def _misopened(piece: str, opened: Mapping[str, float], model: FurnitureModel) -> Iterator[tuple[str, str]]:
    """Names of doors and drawers that cannot stand open as asked, and why."""
    leaves = {leaf.name: leaf for leaf in model.articulations}
    for name, position in opened.items():
        if name not in leaves:
            yield name, f"{piece!r} has no door or drawer {name!r}; {suggestion(name, list(leaves))}"
        elif not 0.0 <= position <= leaves[name].upper:
            scale, unit = (math.degrees(1.0), " deg") if leaves[name].kind == "revolute" else (100.0, " cm")
            upper, asked = scale * leaves[name].upper, scale * position
            yield name, f"opens from 0 to {upper:.4g}{unit}, got {asked:.4g}{unit}"
