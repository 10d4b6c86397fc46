"""Scenes from YAML: one file, or one that extends another."""

from __future__ import annotations

import copy
import re
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from bestman_bt.configuration import (
    ConfigurationError,
    Document,
    Problem,
    beside,
    find_data,
    override,
    read_document,
    salvage,
)
from bestman_bt.messages import ObjectModel
from bestman_bt.registry import suggestion
from bestman_bt.scene.apartment_generator.furnish import NEEDED
from bestman_bt.scene.furniture_file import read_furniture
from bestman_bt.scene.object_file import read_object
from bestman_bt.scene.placement_faults import placement_faults, written_texts
from bestman_bt.scene.scene import FurnitureModel
from bestman_bt.scene.scene_config import RegionConfig, SceneConfig, SceneFile

# What types cannot tell of a scene's file: names that clash, ranges the wrong way round, walls without a length.


_NUMBERED = re.compile(r"(wall|walker)_\d+")
_RESERVED = ("robot", "fingers", "floor")


def scene_faults(file: SceneFile, document: Document) -> Iterator[Problem]:
    """All faults of a scene's file, each at the line that is at fault."""
    yield from _generator_faults(file, document)
    yield from _name_faults(file, document)
    for name in ("speed", "radius") if file.walkers is not None else ():
        yield from _order_faults(getattr(file.walkers, name), ("walkers", name), document)
    regions: dict[tuple[str, ...], RegionConfig | None] = {("robot_start",): file.robot_start}
    regions |= {("objects", name, "region"): placement.region for name, placement in file.objects.items()}
    regions |= {("goals", name, "region"): goal.region for name, goal in file.goals.items()}
    regions |= {("unmapped", name, "region"): piece.region for name, piece in file.unmapped.items()}
    for path, region in regions.items():
        if region is not None:
            yield from _range_faults(region, path, document)
    for index, (start, end) in enumerate(file.walls.lines if file.walls is not None else ()):
        if start == end:
            message = f"a wall needs two different ends, got {_written(document, 'walls', 'lines', index)}"
            yield document.problem(("walls", "lines", index), message)


def _generator_faults(file: SceneFile, document: Document) -> Iterator[Problem]:
    """What a file owes without a generator, and what it leaves to one."""
    if file.generator is None:
        for name in ("walls", "furniture", "robot_start"):
            if document.data.get(name) is None:
                yield document.problem((name,), "is missing")
        return
    for name in ("walls", "furniture"):
        if document.data.get(name):
            yield document.problem((name,), "the generator makes them; give one or the other")
    for name in ("rooms", "area", "doorway"):
        yield from _order_faults(getattr(file.generator.apartment, name), ("generator", "apartment", name), document)


def _order_faults(limits: tuple[float, float], path: tuple[str, ...], document: Document) -> Iterator[Problem]:
    if limits[0] > limits[1]:
        yield document.problem(path, f"the smaller limit comes first, got [{limits[0]:g}, {limits[1]:g}]")


def _name_faults(file: SceneFile, document: Document) -> Iterator[Problem]:
    """Contacts are told by name, so each body needs one of its own."""
    for kind, names in (("furniture", file.furniture), ("unmapped", file.unmapped), ("objects", file.objects)):
        for name in names:
            if name in _RESERVED or _NUMBERED.fullmatch(name):
                message = f"the name {name!r} is taken: {', '.join(_RESERVED)}, wall_0, walker_1, … have a meaning"
                yield document.problem((kind, name), f"{message} of their own; choose another")
            elif (kind != "furniture" and name in file.furniture) or (kind == "objects" and name in file.unmapped):
                message = f"the name {name!r} is taken by a piece of furniture; choose another"
                yield document.problem((kind, name), message)


def _range_faults(region: RegionConfig, path: tuple[str, ...], document: Document) -> Iterator[Problem]:
    for axis in ("x", "y", "yaw"):
        lower, upper = getattr(region, axis)
        if lower > upper:
            first, second = _written(document, *path, axis)
            message = f"the smaller limit comes first: [{second}, {first}], got [{first}, {second}]"
            yield document.problem((*path, axis), message)


def _written(document: Document, *path: str | int) -> Any:
    """The value at ``path`` as it stands in the file."""
    value: Any = document.data
    for key in path:
        value = value[key]
    return value


_ABSENT = "absent"
_REMOVABLE = ("furniture", "unmapped", "objects", "goals")


def load_scene(name_or_path: str | Path, overrides: Mapping[str, Any] | None = None) -> SceneConfig:
    """Read a scene; a bare name means a shipped one. Raises ConfigurationError with file, line and field.

    ``overrides``: dotted keys → values, for example ``{"objects.cup": "absent", "finger_friction": 0.05}``.
    """
    path = find_data("scene", name_or_path)
    document = override(_extended(path, ()), SceneFile, overrides or {}, prefix="scene.")
    absent = _absent(document)
    document = _without_absent(document)
    file, problems = salvage(document, SceneFile)
    if file is None:
        raise ConfigurationError(problems)
    scene = replace(_resolved(path.stem, file, document, problems), absent=absent, document=document)
    if problems:
        raise ConfigurationError(sorted(problems, key=lambda problem: (problem.source, problem.line or 0)))
    return scene


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
        document.problem(
            (kind, name),
            f"cannot be removed: the base scene has no such entry; {suggestion(name, list(base.data.get(kind, {})))}",
        )
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


def _resolved(name: str, file: SceneFile, document: Document, problems: list[Problem]) -> SceneConfig:
    """The scene as far as it can be read; what is wrong is added to ``problems``."""
    problems += scene_faults(file, document)
    furniture: dict[str, FurnitureModel] = {}
    models: dict[str, ObjectModel] = {}
    goal_models: dict[str, ObjectModel] = {}
    unmapped: dict[str, FurnitureModel] = {}
    for kind, piece, model, pieces in [
        *(("furniture", name, model, furniture) for name, model in written_texts(document, "furniture", "model")),
        *(("unmapped", name, model, unmapped) for name, model in written_texts(document, "unmapped", "model")),
    ]:
        try:
            pieces[piece] = read_furniture(model, document.problem((kind, piece, "model"), ""))
        except ConfigurationError as error:
            problems += error.problems
    if file.generator is not None:
        furniture |= {name: read_furniture(name) for name in NEEDED}
    # The robot tells things by the names of their models: the only thing of a model gives it its name.
    of_model = Counter(placement.model for placement in file.objects.values())
    own_name = {model for model, count in of_model.items() if count == 1}
    named_otherwise = {placement.model for key, placement in file.objects.items() if key != Path(placement.model).stem}
    # goals first: an object of the scene that bears the name of a goal's model decides what it means
    for kind, key, model in [
        *(("goals", goal, model) for goal, model in written_texts(document, "goals", "model")),
        *(("objects", thing, model) for thing, model in written_texts(document, "objects", "model")),
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
    scene = SceneConfig(name, file, furniture, models, goal_models, unmapped)
    problems += list(placement_faults(scene, document, problems))
    return scene
