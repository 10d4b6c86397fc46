"""Plug-ins: Python files that add leaves, algorithms, drivers and planners without being packaged."""

from __future__ import annotations

import importlib.util
import sys
import traceback
from collections.abc import Iterable
from pathlib import Path

from bestman_bt.configuration import ConfigurationError, Problem
from bestman_bt.engine import Node, NodeRegistry
from bestman_bt.registry import BEHAVIOURS


def node_registry(plugins: Iterable[str] = ()) -> NodeRegistry:
    """All nodes that trees may name: the engine's, the skill library's and those of plug-ins.

    A plug-in is a Python file; every node class that it defines becomes a leaf, and its ``register(registry)``, if it
    has one, is called with the registry. Raises ConfigurationError with file and line where one raises.
    """
    registry = NodeRegistry()
    for name in BEHAVIOURS:
        registry.register(BEHAVIOURS.resolve(name), name)
    problems = [problem for plugin in plugins if (problem := _load(plugin, registry)) is not None]
    if problems:
        raise ConfigurationError(problems)
    return registry


def _load(plugin: str, registry: NodeRegistry) -> Problem | None:
    path = Path(plugin)
    if not path.is_file():
        return Problem(f"--plugin {plugin}", None, "", "no such file")
    name = f"bestman_bt_plugin_{path.stem}"
    spec = importlib.util.spec_from_file_location(name, path)
    if spec is None or spec.loader is None:
        return Problem(f"--plugin {plugin}", None, "", "should be a Python file (.py)")
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    try:
        spec.loader.exec_module(module)
        for value in list(vars(module).values()):
            if isinstance(value, type) and issubclass(value, Node) and value.__module__ == name:
                registry.register(value)
        if hasattr(module, "register"):
            module.register(registry)
    except (Exception, SystemExit) as error:  # noqa: BLE001 - a plug-in may raise anything; told with file and line
        sys.modules.pop(name, None)
        return Problem(str(path), _line_in(error, path), "", f"the plug-in raised {type(error).__name__}: {error}")
    return None


def _line_in(error: BaseException, path: Path) -> int | None:
    """The last line of the plug-in that the error has passed."""
    plugin = path.resolve()
    if isinstance(error, SyntaxError) and error.filename and Path(error.filename).resolve() == plugin:
        return error.lineno
    lines = [f.lineno for f in traceback.extract_tb(error.__traceback__) if Path(f.filename).resolve() == plugin]
    return lines[-1] if lines else None
