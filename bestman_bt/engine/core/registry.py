"""The node registry: the classes that tree files may name, each with kind, ports and description."""

from __future__ import annotations

import inspect
from collections.abc import Iterable, Iterator
from copy import copy
from dataclasses import dataclass
from functools import lru_cache
from typing import Final

from bestman_bt.engine.conversion import UNTYPED, ConverterRegistry
from bestman_bt.engine.core.node import Node
from bestman_bt.engine.core.ports import Port, declared_ports
from bestman_bt.engine.errors import EngineError
from bestman_bt.engine.spelling import closest
from bestman_bt.errors import InputError

BUILTIN_NODES: Final[dict[str, type[Node]]] = {}
"""The engine's own nodes by name; ``engine.catalogue`` fills it, which ``bestman_bt.engine`` imports."""


class RegistryError(EngineError, InputError):
    """Raised if a class cannot be registered, or a name is unknown."""


@dataclass(frozen=True, eq=False)
class NodeInfo:
    """The description of one node type.

    ``kind``: Action, Condition, Control, Decorator or SubTree; ``checked``: the typed or bounded input ports, whose
    literals are converted when a tree is loaded. ``known_from``: the source of the description of a type without code;
    empty for one with code.
    """

    name: str
    cls: type[Node]
    kind: str
    ports: dict[str, Port]
    description: str
    required: tuple[str, ...]
    checked: frozenset[str]
    min_children: int
    max_children: int | None
    builtin: bool
    custom_init: bool
    custom_load: bool
    checked_at_tick: bool
    known_from: str = ""

    @property
    def inputs(self) -> list[Port]:
        """The input and inout ports."""
        return [port for port in self.ports.values() if port.direction != "output"]

    @property
    def outputs(self) -> list[Port]:
        """The output and inout ports."""
        return [port for port in self.ports.values() if port.direction != "input"]

    @property
    def import_line(self) -> str:
        """The line that imports the class in a Python tree."""
        return f"from {'bestman_bt.engine' if self.builtin else self.cls.__module__} import {self.cls.__name__}"


class NodeRegistry:
    """Names → node classes; contains all nodes of BehaviorTree.CPP v4 from the start."""

    def __init__(self) -> None:
        self.converters = ConverterRegistry()
        self._infos: dict[str, NodeInfo] = {}
        self._by_class: dict[type[Node], NodeInfo] = {}
        for name, cls in BUILTIN_NODES.items():
            self._add(name, cls, builtin=True)

    @property
    def enums(self) -> dict[str, int]:
        """The names known to scripts and enum ports, with their values."""
        return self.converters.enums

    def register(self, cls: type[Node], name: str | None = None) -> type[Node]:
        """Make ``cls`` usable as ``name`` (by default the class's own name); returns it, so that it serves as a
        decorator.

        Raises:
            RegistryError: ``cls`` is not a node class, or the name belongs to another class.
        """
        if not (isinstance(cls, type) and issubclass(cls, Node)):
            raise RegistryError(f"{cls!r} is not a subclass of bestman_bt.engine.Node")
        name = name or getattr(cls, "NAME", None) or cls.__name__
        known = self._infos.get(name)
        if known is not None and known.cls is not cls:
            raise RegistryError(f"'{name}' is registered already, as {known.cls.__module__}.{known.cls.__qualname__}")
        self._add(name, cls, builtin=False)
        return cls

    def extended(self, infos: Iterable[NodeInfo]) -> NodeRegistry:
        """Return a registry that also contains these types, which replace types of the same name."""
        other = copy(self)
        other._by_class = dict(self._by_class)
        other._infos = {**self._infos, **{info.name: info for info in infos}}
        return other

    def register_enum(self, name: str, value: int) -> None:
        """Make ``name`` a constant in scripts and in ports of enum types.

        Raises:
            RegistryError: it has another value already.
        """
        if self.enums.setdefault(name, value) != value:
            raise RegistryError(f"the enum name '{name}' has the value {self.enums[name]} already, not {value}")

    def _add(self, name: str, cls: type[Node], *, builtin: bool) -> NodeInfo:
        info = make_info(name, cls, builtin=builtin)
        self._infos[name] = info
        self._by_class.setdefault(cls, info)
        return info

    def info(self, name: str) -> NodeInfo:
        """Return the description of ``name``.

        Raises:
            RegistryError: it is not registered; the message suggests the closest name.
        """
        info = self._infos.get(name)
        if info is None:
            hint = self.suggest(name)
            raise RegistryError(f"unknown node '{name}'" + (f"; did you mean '{hint}'?" if hint else ""))
        return info

    def info_of_class(self, cls: type[Node]) -> NodeInfo:
        """Return the description of a class; an unregistered class is described directly."""
        info = self._by_class.get(cls)
        if info is None:
            name = getattr(cls, "NAME", None) or cls.__name__
            info = self._by_class[cls] = make_info(name, cls, builtin=False)
        return info

    def find(self, name: str) -> NodeInfo | None:
        """Return the description of ``name``, or None."""
        return self._infos.get(name)

    def suggest(self, name: str) -> str:
        """Return the registered name closest to ``name``, or an empty text."""
        return closest(name, self._infos)

    def __contains__(self, name: str) -> bool:
        return name in self._infos

    def __iter__(self) -> Iterator[NodeInfo]:
        return iter(self.manifest())

    def manifest(self) -> list[NodeInfo]:
        """Return all descriptions, sorted by name."""
        return sorted(self._infos.values(), key=lambda info: info.name)


@lru_cache(maxsize=1024)
def make_info(name: str, cls: type[Node], *, builtin: bool) -> NodeInfo:
    """Describe a node class."""
    ports = declared_ports(cls)
    checked = frozenset(
        port.name
        for port in ports.values()
        if port.direction != "output"
        and (port.bounds is not None or (port.data_type not in UNTYPED and port.data_type is not str))
    )
    kind = cls.KIND
    low, high = getattr(cls, "MIN_CHILDREN", 0), getattr(cls, "MAX_CHILDREN", None)
    if kind == "Decorator":
        low, high = 1, 1
    elif kind in ("Action", "Condition", "SubTree"):
        low, high = 0, 0
    return NodeInfo(
        name=name,
        cls=cls,
        kind=kind,
        ports=ports,
        description=inspect.cleandoc(cls.__doc__ or ""),
        required=tuple(port.name for port in ports.values() if port.required),
        checked=checked,
        min_children=low,
        max_children=high,
        builtin=builtin,
        custom_init=cls.__init__ is not Node.__init__ and kind != "SubTree",
        custom_load=cls.on_load is not Node.on_load,
        checked_at_tick=cls.CHECKED_AT_TICK,
    )
