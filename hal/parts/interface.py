"""What a kind of part in ``hal.api`` consists of, for those that stand between a program and a part."""

from __future__ import annotations

import inspect
from dataclasses import dataclass

from hal.api import Part

COMPOSED = frozenset({"open", "close"})
"""Methods that the interface itself makes of others."""


@dataclass(frozen=True)
class Interface:
    """``kind``: the class of ``hal.api``. Names of its attributes, of methods that read, and of those that command.

    ``attributes``: without the ``model``.
    """

    kind: type[Part]
    attributes: tuple[str, ...]
    readings: tuple[str, ...]
    commands: tuple[str, ...]


def interface_of(part: type[Part]) -> Interface:
    """The interface of a class of parts, by the most special class of ``hal.api`` that it derives from."""
    kind = next(cls for cls in part.__mro__ if cls.__module__.startswith("hal.api."))
    declared = dict.fromkeys(name for cls in kind.__mro__ for name in inspect.get_annotations(cls))
    attributes = tuple(name for name in declared if name not in ("kind", "model"))
    readings: list[str] = []
    commands: list[str] = []
    for name in dir(kind):
        found = inspect.getattr_static(kind, name)
        if not name.startswith("_") and name not in COMPOSED and name != "stop" and inspect.isfunction(found):
            (commands if len(inspect.signature(found).parameters) > 1 else readings).append(name)
    return Interface(kind, attributes, tuple(readings), tuple(commands))
