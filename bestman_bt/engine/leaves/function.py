"""Leaves made from functions: ports come from the signature and its type hints.

    @action
    def add(a: int, b: int = 1, *, total: Output[int]) -> bool:
        total.set(a + b)
        return True

    @condition
    def is_near(distance: float, limit: float = 0.5) -> bool:
        return distance < limit

Parameters are input ports (optional if they have a default); parameters hinted ``Output[T]`` are output ports. A
parameter hinted ``Context`` receives the tree's context. True and False mean SUCCESS and FAILURE.
"""

from __future__ import annotations

import inspect
import typing
from collections.abc import Callable
from typing import Any, Generic, TypeVar, overload

from py_trees.ports import PortInformation

from bestman_bt.engine.core.node import Node
from bestman_bt.engine.errors import EngineError
from bestman_bt.engine.leaves.base import Condition, Leaf, SyncAction
from bestman_bt.engine.status import FAILURE, RUNNING, SUCCESS

T = TypeVar("T")


class Output(Generic[T]):
    """An output port inside a function leaf."""

    def __init__(self, node: Node, port: str) -> None:
        self._node = node
        self._port = port

    def set(self, value: T) -> None:
        """Write ``value`` to the port."""
        self._node.set_output(self._port, value)


class Context:
    """The type hint of a parameter that receives the tree's context."""


class FunctionLeafError(EngineError):
    """Raised if a function cannot become a leaf, because its signature does not describe ports."""


@overload
def action(function: Callable[..., Any]) -> type[SyncAction]: ...
@overload
def action(*, name: str) -> Callable[[Callable[..., Any]], type[SyncAction]]: ...
def action(function: Callable[..., Any] | None = None, *, name: str | None = None) -> Any:
    """Make an action class from a function, for registration or for use in Python trees like any node class.

    Raises FunctionLeafError if the signature does not describe ports.
    """
    if function is None:
        return lambda found: _leaf(found, SyncAction, name)
    return _leaf(function, SyncAction, name)


@overload
def condition(function: Callable[..., Any]) -> type[Condition]: ...
@overload
def condition(*, name: str) -> Callable[[Callable[..., Any]], type[Condition]]: ...
def condition(function: Callable[..., Any] | None = None, *, name: str | None = None) -> Any:
    """Make a condition class from a function, as ``action`` does."""
    if function is None:
        return lambda found: _leaf(found, Condition, name)
    return _leaf(function, Condition, name)


def _leaf(function: Callable[..., Any], base: type[Leaf], name: str | None) -> type[Leaf]:
    inputs: dict[str, PortInformation] = {}
    outputs: dict[str, PortInformation] = {}
    contexts: list[str] = []
    hints = typing.get_type_hints(function)
    for parameter in inspect.signature(function).parameters.values():
        if parameter.kind in (parameter.VAR_POSITIONAL, parameter.VAR_KEYWORD, parameter.POSITIONAL_ONLY):
            raise FunctionLeafError(f"{function.__name__}: the parameter '{parameter.name}' cannot become a port")
        hint = hints.get(parameter.name, Any)
        if hint is Context:
            contexts.append(parameter.name)
        elif hint is Output or typing.get_origin(hint) is Output:
            item = typing.get_args(hint)
            outputs[parameter.name] = PortInformation(item[0] if item else Any, False)
        else:
            given = parameter.default is not parameter.empty
            inputs[parameter.name] = PortInformation(hint, not given, "", parameter.default if given else None)

    def on_tick(self: Node) -> int:
        arguments: dict[str, Any] = {port: self.get_input(port) for port in inputs}
        arguments.update({port: Output(self, port) for port in outputs})
        arguments.update(dict.fromkeys(contexts, self.context if contexts else None))
        result = function(**arguments)
        if result is True:
            return SUCCESS
        if result is False:
            return FAILURE
        if isinstance(result, int) and result != RUNNING:
            return result
        raise self.error(f"its function returned {result!r}; a bool or a status other than RUNNING is accepted")

    members = {
        "__doc__": function.__doc__,
        "__module__": function.__module__,
        "INPUT_PORTS": inputs,
        "OUTPUT_PORTS": outputs,
        "on_tick": on_tick,
        "function": staticmethod(function),
    }
    return type(name or class_name(function.__name__), (base,), members)


def class_name(name: str) -> str:
    """Return the class name of the node made from a function: ``open_door`` → ``OpenDoor``."""
    return "".join(part[:1].upper() + part[1:] for part in name.split("_"))
