"""Scenes from YAML: one file, or one that extends another."""

from __future__ import annotations

import copy
import re
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from bestman_bt.configuration.checked import override, salvage
from bestman_bt.configuration.data import beside, find_data
from bestman_bt.configuration.document import Document, read_document
from bestman_bt.configuration.errors import ConfigurationError, Problem, ProblemCollector
from bestman_bt.messages import ObjectModel
from bestman_bt.registry import suggestion
from bestman_bt.scene.apartment_generator.furnish import NEEDED
from bestman_bt.scene.furniture_file import read_furniture
from bestman_bt.scene.object_file import read_object
from bestman_bt.scene.placement_faults import given, placement_faults
from bestman_bt.scene.scene import FurnitureModel
from bestman_bt.scene.scene_config import SceneConfig, SceneFile

# What types cannot tell of a scene's file: names that clash, what a generator makes.


_NUMBERED = re.compile(r"(wall|walker)_\d+")
_RESERVED = ("robot", "fingers", "floor")


def _generator_faults(scene: SceneConfig, document: Document) -> Iterator[Problem]:
    """What a file owes without a generator, and what it leaves to one."""
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
    """Contacts are told by name, so each body needs one of its own."""
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
    """Return the document over those that it extends, and whether one of these could not be read."""
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
    """Return the document with the paths that it names counted from its file."""
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
    """Return the scene with what it names, as far as that can be read; what is wrong is added to ``problems``."""
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
