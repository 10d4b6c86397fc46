"""What a kind of part in ``hal.api`` consists of, for those that stand between a program and a part."""

from __future__ import annotations

import inspect
from dataclasses import dataclass

from hal.api import Part

COMPOSED = frozenset({"open", "close"})
"""Methods that the interface itself makes of others."""


@dataclass(frozen=True)
class Interface:
    """``kind``: the class of ``hal.api``. Names of its properties, of methods that read, and of those that command."""

    kind: type[Part]
    properties: tuple[str, ...]
    readings: tuple[str, ...]
    commands: tuple[str, ...]


def interface_of(part: type[Part]) -> Interface:
    """The interface of a class of parts, by the most special class of ``hal.api`` that it derives from."""
    kind = next(cls for cls in part.__mro__ if cls.__module__.startswith("hal.api."))
    properties: list[str] = []
    readings: list[str] = []
    commands: list[str] = []
    for name in dir(kind):
        found = inspect.getattr_static(kind, name)
        if name.startswith("_") or name in COMPOSED or name in ("name", "model", "stop"):
            continue
        if isinstance(found, property):
            properties.append(name)
        elif inspect.isfunction(found):
            (commands if len(inspect.signature(found).parameters) > 1 else readings).append(name)
    return Interface(kind, tuple(properties), tuple(readings), tuple(commands))
