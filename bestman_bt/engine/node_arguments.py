"""What a node that is made in Python is called with: a name and children, in the forms of py_trees and of trees."""

from __future__ import annotations

import sys
from types import FrameType
from typing import TYPE_CHECKING, Any

from py_trees.behaviour import Behaviour

if TYPE_CHECKING:
    from bestman_bt.engine.node import Node


def line_that_makes(node: Behaviour) -> tuple[str, int]:
    """File and line of the call that makes a node, outside of its own ``__init__`` and of py_trees' idioms."""
    frame = sys._getframe(1)
    while frame.f_back is not None and (_makes(frame, node) or frame.f_globals.get("__package__") == "py_trees"):
        frame = frame.f_back
    return frame.f_code.co_filename, frame.f_lineno


def _makes(frame: FrameType, node: Behaviour) -> bool:
    if frame.f_code.co_name not in ("_set_up", "__init__"):
        return False
    return frame.f_code.co_argcount > 0 and frame.f_locals.get(frame.f_code.co_varnames[0]) is node


def split_arguments(
    cls: type[Node], args: tuple[Any, ...], name: str | None, attributes: dict[str, Any]
) -> tuple[str | None, list[Any]]:
    """Sort the positional arguments of a node made in Python into its name and its children."""
    children: list[Any] = []
    for argument in args:
        if isinstance(argument, str) and name is None:
            name = argument
        elif isinstance(argument, (list, tuple)):
            children.extend(argument)
        else:
            children.append(argument)
    children.extend(attributes.pop("children", ()))
    child = attributes.pop("child", None)
    if child is not None:
        children.append(child)
    return name, [_child(cls, found) for found in children]


def _child(cls: type[Node], found: Any) -> Behaviour:
    """A node, or the SubTree that stands for a whole tree."""
    if isinstance(found, Behaviour):
        return found
    if not hasattr(found, "as_subtree"):
        raise TypeError(f"{cls.__name__} takes a name and children but got {found!r}")
    subtree: Behaviour = found.as_subtree()
    return subtree
