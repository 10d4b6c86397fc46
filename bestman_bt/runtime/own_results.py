"""Checks of the values that a user's algorithm returns, against the types of the interface."""

from __future__ import annotations

import dataclasses
import inspect
from collections.abc import Callable, Mapping, Sequence
from functools import wraps
from types import NoneType, UnionType, new_class
from typing import Any, Union, get_args, get_origin, get_type_hints

import numpy as np

from bestman_bt.engine.own_files import defined_at
from bestman_bt.errors import WrongResultError
from bestman_bt.messages import Path2D
from bestman_bt.navigation.global_planning.costmap import Costmap
from bestman_bt.navigation.local_planning.base import FollowerCommand

_SEQUENCES = (tuple, list, Sequence)


def with_checked_results(algorithm: type[Any], base: type[Any]) -> type[Any]:
    """Return a subclass whose interface methods and properties of ``base`` raise WrongResultError for invalid results.

    Checked are types, NaN, paths that leave the costmap and commands that are not finite.
    """
    checked: dict[str, Any] = {
        "__module__": algorithm.__module__,
        "__qualname__": algorithm.__qualname__,
        "__slots__": (),
    }
    for name in dir(base):
        own = inspect.getattr_static(algorithm, name, None)
        if name.startswith("_") or own is inspect.getattr_static(base, name):
            continue
        if isinstance(own, property) and own.fget is not None:
            checked[name] = property(_checked(own.fget, f"{algorithm.__name__}.{name}", _returned(base, name)))
        elif inspect.isfunction(own):
            checked[name] = _checked(own, f"{algorithm.__name__}.{name}", _returned(base, name))
    return new_class(algorithm.__name__, (algorithm,), exec_body=lambda namespace: namespace.update(checked))


def _returned(base: type[Any], name: str) -> Any:
    declared = getattr(base, name)
    return get_type_hints(declared.fget if isinstance(declared, property) else declared).get("return", Any)


def _checked(method: Callable[..., Any], who: str, hint: Any) -> Callable[..., Any]:
    @wraps(method)
    def call(itself: Any, *arguments: Any, **options: Any) -> Any:
        result = method(itself, *arguments, **options)
        fault = _fault(result, hint, (*arguments, *options.values()))
        if fault:
            raise WrongResultError(f"{who} {fault} (at {defined_at(method)})")
        return result

    return call


def _fault(result: Any, hint: Any, arguments: Sequence[Any]) -> str:
    if not _is_a(result, hint):
        return f"should return {_named(hint)}, got {_got(result)}"
    if _has_nan(result):
        return f"returned a {type(result).__name__} that contains NaN"
    if isinstance(result, FollowerCommand) and not np.all(np.isfinite(dataclasses.astuple(result.twist))):
        return f"returned the velocity {result.twist}; it should be finite"
    if isinstance(result, Path2D):
        return _path_fault(result, next((one for one in arguments if isinstance(one, Costmap)), None))
    return ""


def _path_fault(path: Path2D, costmap: Costmap | None) -> str:
    if not len(path.points):
        return "returned a Path2D without points; it should have at least one"
    outside = np.zeros(0) if costmap is None else path.points[~costmap.contains(path.points)]
    if not len(outside):
        return ""
    x, y = outside[0]
    return f"returned a Path2D that leaves the map at ({x:.2f}, {y:.2f}) m"


def _is_a(value: Any, hint: Any) -> bool:
    """Return whether a value matches a type annotation; what ``isinstance`` cannot check counts as a match."""
    origin, arguments = get_origin(hint), get_args(hint)
    if origin in (Union, UnionType):
        return any(_is_a(value, one) for one in arguments)
    if hint is None or hint is NoneType:
        return value is None
    if hint is float:
        return isinstance(value, (int, float, np.number))
    if not isinstance(origin or hint, type):
        return True
    if hint is bool:
        return isinstance(value, (bool, np.bool_))
    if not isinstance(value, origin or hint):
        return False
    if origin in _SEQUENCES and arguments:
        kinds = arguments if origin is tuple and arguments[-1] is not Ellipsis else arguments[:1] * len(value)
        return len(kinds) == len(value) and all(map(_is_a, value, kinds))
    return True


def _has_nan(value: Any) -> bool:
    if isinstance(value, np.ndarray):
        return value.dtype.kind == "f" and bool(np.isnan(value).any())
    if isinstance(value, float):
        return value != value
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return any(_has_nan(getattr(value, field.name, None)) for field in dataclasses.fields(value))
    if isinstance(value, Mapping):
        value = tuple(value.values())
    return isinstance(value, (tuple, list)) and any(map(_has_nan, value))


def _named(hint: Any) -> str:
    origin, arguments = get_origin(hint), get_args(hint)
    if origin in (Union, UnionType):
        return " or ".join(map(_named, arguments))
    kind = "None" if hint is NoneType else getattr(origin or hint, "__name__", str(hint))
    return f"{kind} of {_named(arguments[0])}" if origin in _SEQUENCES else kind


def _got(value: Any) -> str:
    if isinstance(value, (tuple, list)) and value:
        return f"{type(value).__name__} of {type(value[0]).__name__}"
    return type(value).__name__
