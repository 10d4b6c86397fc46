"""Plug-ins: Python files that add leaves, algorithms, drivers and planners without packaging."""

from __future__ import annotations

import logging
import sys
from collections.abc import Iterable
from pathlib import Path
from types import ModuleType
from typing import Any

from py_trees.behaviour import Behaviour

from bestman_bt.configuration.data import find_data, shipped_trees
from bestman_bt.configuration.errors import ConfigurationError, Problem
from bestman_bt.engine import Node, NodeRegistry, Tree, build_tree, load_tree
from bestman_bt.engine.models.foreign import Placeholders, open_tree
from bestman_bt.engine.own_files import described, importable, load_file, plugin_module
from bestman_bt.registry import ALGORITHMS, BEHAVIOURS, PREDICATES, Registry, slot_fault

logger = logging.getLogger(__name__)

_COULD_BRING = (
    "it could define leaves (subclasses of Skill, SyncAction, …), predicates, register(registry), or classes below "
    "@algorithm, @task_planner or @tree_builder"
)

_useful: set[Path] = set()
"""Plug-ins that have added something: modules beside them are not executed again on a reload."""


def node_registry(plugins: Iterable[str] = ()) -> NodeRegistry:
    """Return all nodes that trees may name: of the engine, the skill library and plug-ins.

    A plug-in is a Python file; every node class in it becomes a leaf, every ``Predicate`` can be used in goals, and its
    ``register(registry)``, if any, is called with the registry. Everything else is registered by the decorators of
    ``bestman_bt.registry``. Raises ConfigurationError with file and line if a plug-in raises or adds nothing.
    """
    registry = NodeRegistry()
    for name in BEHAVIOURS:
        registry.register(BEHAVIOURS.resolve(name), name)
    problems = [problem for plugin in plugins if (problem := _load(plugin, registry)) is not None]
    if problems:
        raise ConfigurationError(problems)
    for name in ALGORITHMS:  # those of entry points, and what was added without the decorator
        fault = slot_fault(name)
        if fault:
            logger.warning("the algorithm %r cannot be chosen: %s", name, fault)
    return registry


def read_tree(
    source: str | Path | Behaviour, registry: NodeRegistry, *, gaps: Placeholders | None = None, **options: Any
) -> Tree:
    """Load a tree: a shipped name, a file, XML text, a node or a py_trees behaviour.

    ``gaps``: replaces unknown nodes; without it they are errors. ``options``: those of ``engine.load_tree``. Raises
    ConfigurationError if there is no such tree, else as ``engine.load_tree`` does.
    """
    if isinstance(source, Behaviour):
        return build_tree(source, registry=registry, **options)
    options.setdefault("search_path", shipped_trees())
    found = source if isinstance(source, str) and source.lstrip().startswith("<") else find_data("tree", source)
    return load_tree(found, registry, **options) if gaps is None else open_tree(found, registry, gaps=gaps, **options)


def _load(plugin: str, registry: NodeRegistry) -> Problem | None:
    path = Path(plugin)
    if not path.is_file():
        return Problem(f"--plugin {plugin}", None, "", "no such file")
    if path.suffix != ".py":
        return Problem(f"--plugin {plugin}", None, "", "should be a Python file (.py)")
    name = plugin_module(path)
    before = Registry.additions
    try:
        with importable(path.parent):
            module = load_file(path, name)
            own = [one for one in list(vars(module).values()) if isinstance(one, type) and one.__module__ == name]
            leaves = [one for one in own if issubclass(one, Node)]
            for leaf in leaves:
                registry.register(leaf)
            _add_predicates(module)
            if hasattr(module, "register"):
                module.register(registry)
            elif not leaves and Registry.additions == before and path.resolve() not in _useful:
                native = [one.__name__ for one in own if issubclass(one, Behaviour)]
                python_only = f"; {', '.join(native)}: a tree in Python uses py_trees' behaviours" if native else ""
                return Problem(f"--plugin {plugin}", None, "", f"brings nothing; {_COULD_BRING}{python_only}")
            _useful.add(path.resolve())
    except (Exception, SystemExit) as error:  # noqa: BLE001 - a plug-in may raise anything; reported with file and line
        sys.modules.pop(name, None)
        file, line, words = described(error, path)
        return Problem(file, line or None, "", f"the plug-in raised {words}")
    return None


def _add_predicates(module: ModuleType) -> None:
    """Register the predicates that a plug-in defines; a plug-in that uses the class has loaded its module."""
    known: Any = sys.modules.get("bestman_bt.facts.predicate")
    if known is not None:
        shipped = known.shipped_predicates().values()
        for value in vars(module).values():
            if isinstance(value, known.Predicate) and value not in shipped:
                PREDICATES.add(value.name, value)
