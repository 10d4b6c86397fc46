"""What types cannot tell of a scene's file: names that clash, ranges the wrong way round, walls without a length."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

from bestman_bt.configuration import Document, Problem
from bestman_bt.scene.scene_config import RegionConfig, SceneFile

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
