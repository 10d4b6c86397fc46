"""Scenes from YAML: one file, or one that extends another."""

from __future__ import annotations

import copy
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from bestman_bt.configuration import (
    ConfigurationError,
    Document,
    Problem,
    beside,
    check,
    find_data,
    override,
    read_document,
)
from bestman_bt.messages import ObjectModel
from bestman_bt.registry import suggestion
from bestman_bt.scene.apartment_generator.furnish import NEEDED
from bestman_bt.scene.furniture_file import read_furniture
from bestman_bt.scene.furniture_overlap import furniture_overlaps
from bestman_bt.scene.furniture_standing import standing_furniture
from bestman_bt.scene.object_file import read_object
from bestman_bt.scene.scene import FurnitureModel, Surface
from bestman_bt.scene.scene_config import SceneFile
from bestman_bt.scene.scene_faults import scene_faults

_ABSENT = "absent"
_REMOVABLE = ("furniture", "unmapped", "objects", "goals")


@dataclass(frozen=True)
class SceneConfig:
    """A scene before chance has decided.

    ``furniture``: model of each piece by its name in the scene. ``models``: what the robot may know of objects: the
    model of each object by its name, and of each goal's object by the model's. ``goal_models``: by the goal's name.
    ``unmapped``: models of the furniture that the map does not have.
    ``absent``: names of furniture and objects that the scene or its settings leave out of what it extends.
    """

    name: str
    file: SceneFile
    furniture: Mapping[str, FurnitureModel]
    models: Mapping[str, ObjectModel]
    goal_models: Mapping[str, ObjectModel]
    unmapped: Mapping[str, FurnitureModel] = field(default_factory=dict)
    absent: tuple[str, ...] = ()

    def surface(self, name: str) -> tuple[str, Surface]:
        """Furniture name and surface of ``furniture`` or ``furniture/surface``; KeyError names what there is."""
        furniture, _, wanted = name.partition("/")
        for surface in self.furniture[furniture].all_surfaces if furniture in self.furniture else ():
            if wanted in ("", surface.name):
                return furniture, surface
        known = [f"{piece}/{surface.name}" for piece, model in self.furniture.items() for surface in model.all_surfaces]
        raise KeyError(f"unknown surface {name!r}; {suggestion(name, known)}")


def load_scene(name_or_path: str | Path, overrides: Mapping[str, Any] | None = None) -> SceneConfig:
    """Read a scene; a bare name means a shipped one. Raises ConfigurationError with file, line and field.

    ``overrides``: dotted keys → values, for example ``{"objects.cup": "absent", "finger_friction": 0.05}``.
    """
    path = find_data("scene", name_or_path)
    document = override(_extended(path, ()), SceneFile, overrides or {}, prefix="scene.")
    absent = _absent(document)
    document = _without_absent(document)
    file = check(document, SceneFile)
    return replace(_resolved(path.stem, file, document), absent=absent)


def _extended(path: Path, below: tuple[Path, ...]) -> Document:
    document = _from_its_folder(read_document(path), path)
    base_name = document.data.get("extends")
    if not isinstance(base_name, str):
        return document
    base_path = find_data("scene", base_name, document.problem(("extends",), ""))
    if base_path in (*below, path):
        raise ConfigurationError([document.problem(("extends",), f"{base_name!r} extends itself")])
    base = _extended(base_path, (*below, path))
    problems = [
        document.problem((kind, name), f"is not there to be absent; {suggestion(name, list(base.data.get(kind, {})))}")
        for kind in _REMOVABLE
        for name, value in (document.data.get(kind) or {}).items()
        if value == _ABSENT and name not in base.data.get(kind, {})
    ]
    if problems:
        raise ConfigurationError(problems)
    return base.merged(document)


def _from_its_folder(document: Document, path: Path) -> Document:
    """The document with the paths that it names counted from its file."""
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


def _resolved(name: str, file: SceneFile, document: Document) -> SceneConfig:
    problems = list(scene_faults(file, document))
    furniture: dict[str, FurnitureModel] = {}
    models: dict[str, ObjectModel] = {}
    goal_models: dict[str, ObjectModel] = {}
    unmapped: dict[str, FurnitureModel] = {}
    for kind, piece, model, pieces in [
        *(("furniture", name, placement.model, furniture) for name, placement in file.furniture.items()),
        *(("unmapped", name, new.model, unmapped) for name, new in file.unmapped.items()),
    ]:
        try:
            pieces[piece] = read_furniture(model, document.problem((kind, piece, "model"), ""))
        except ConfigurationError as error:
            problems += error.problems
    if file.generator is not None:
        furniture |= {name: read_furniture(name) for name in NEEDED}
    named_otherwise = {placement.model for key, placement in file.objects.items() if key != Path(placement.model).stem}
    # goals first: an object of the scene that bears the name of a goal's model decides what it means
    for kind, key, model in [
        *(("goals", goal, placement.model) for goal, placement in file.goals.items()),
        *(("objects", thing, placement.model) for thing, placement in file.objects.items()),
    ]:
        try:
            found = read_object(model, document.problem((kind, key, "model"), ""))
            if kind == "goals":
                goal_models[key] = found
                if model in named_otherwise:
                    continue  # two equal models of one thing could not be told apart
            models[found.name if kind == "goals" else key] = found
        except ConfigurationError as error:
            problems += error.problems
    scene = SceneConfig(name, file, furniture, models, goal_models, unmapped)
    if not problems:
        problems += _placement_problems(scene, document)
    if problems:
        raise ConfigurationError(problems)
    return scene


def _placement_problems(scene: SceneConfig, document: Document) -> list[Problem]:
    problems = []
    for thing, placement in scene.file.objects.items():
        if placement.region is None and placement.at is None:
            problems.append(document.problem(("objects", thing), "one of 'region' and 'at' should be given"))
        elif placement.region is not None and placement.at is not None:
            message = "'region' is given too; 'region: null' takes it away"
            problems.append(document.problem(("objects", thing, "at"), message))
    placed = [("furniture", name, item.open, scene.furniture) for name, item in scene.file.furniture.items()]
    placed += [("unmapped", name, item.open, scene.unmapped) for name, item in scene.file.unmapped.items()]
    for kind, piece, opened, models in placed:
        for name, why in _misopened(piece, opened, models[piece]):
            problems.append(document.problem((kind, piece, "open", name), why))
    every = {**scene.furniture, **scene.unmapped}
    doors = [f"{piece}/{leaf.name}" for piece, model in every.items() for leaf in model.articulations]
    for name in scene.file.moving_doors if scene.file.generator is None else ():
        if name not in doors:
            problems.append(document.problem(("moving_doors", name), f"is no door here; {suggestion(name, doors)}"))
    surfaces = [("objects", key, "surface", item.surface) for key, item in scene.file.objects.items()]
    surfaces += [("goals", key, "surface", item.surface) for key, item in scene.file.goals.items()]
    surfaces += [("furniture", key, "on", item.on) for key, item in scene.file.furniture.items() if item.on]
    names = list(scene.file.furniture)
    for kind, key, attribute, surface in surfaces:
        try:
            standing_on, _ = scene.surface(surface)
        except KeyError as error:
            problems.append(document.problem((kind, key, attribute), str(error.args[0])))
            continue
        if kind == "furniture" and names.index(standing_on) >= names.index(key):
            message = f"{standing_on!r} should be named above what stands on it, got {surface!r}"
            problems.append(document.problem((kind, key, attribute), message))
    return problems or list(_overlap_problems(scene, document))


def _overlap_problems(scene: SceneConfig, document: Document) -> Iterator[Problem]:
    for earlier, later, depth in furniture_overlaps(standing_furniture(scene)):
        message = f"stands {100.0 * depth:.1f} cm deep in {earlier!r}; furniture may touch or stand on other furniture"
        yield document.problem(("furniture", later, "at"), message)


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
