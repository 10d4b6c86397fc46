"""Bounds of ports beyond their type: the bounds of ``annotated_types``, and lists of names."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Iterator
from dataclasses import dataclass, field
from typing import Annotated, Any, get_args, get_origin

from annotated_types import Ge, GroupedMetadata, Gt, Le, Lt
from py_trees.ports import PortInformation

from bestman_bt.engine.spelling import closest


@dataclass(frozen=True)
class OneOf:
    """A bound: one of the strings that ``names`` returns when a value is checked; the list may grow at run time."""

    names: Callable[[], Collection[str]]

    def refusal(self, value: Any) -> str:
        """Return why ``value`` is not accepted; empty if it is."""
        return _unknown(value, self.names())


@dataclass(frozen=True)
class Named:
    """The name of something of a ``kind``, such as ``surface``; the world model checks that it exists."""

    kind: str


@dataclass(frozen=True)
class NotZero:
    """A bound: any number except 0."""


@dataclass(frozen=True)
class BoundedPort(PortInformation):
    """A port that declares its bounds, such as ``BoundedPort(Annotated[float, Gt(0)])``; a literal out of bounds is a
    load error.

    Numbers must be finite, and a literal must be a plain number: ``50cm`` is not read as 50.
    """

    bounds: tuple[Any, ...] = field(default=(), init=False)

    def __post_init__(self) -> None:
        if get_origin(self.data_type) is Annotated:
            data_type, *bounds = get_args(self.data_type)
            object.__setattr__(self, "data_type", data_type)
            object.__setattr__(self, "bounds", tuple(_flat(bounds)))
        super().__post_init__()
        # Names are looked up when they are used: what has them may not be loaded yet.
        checked = [bound for bound in self.bounds if not isinstance(bound, OneOf)]
        if self.has_default and (message := refusal(self.default_value, checked)):
            raise ValueError(f"default: {message}")


def refusal(value: Any, bounds: Iterable[Any]) -> str:
    """Return why ``value`` is not accepted; empty if it is."""
    wrong = isinstance(value, float) and not math.isfinite(value)
    for bound in bounds:
        if isinstance(bound, OneOf):
            return bound.refusal(value)
        if not isinstance(bound, Named):
            wrong = wrong or not _condition(bound)[0](value)
    number = "a whole number" if isinstance(value, int) else "a finite number"
    return f"{value!r} is not accepted, but {number} {describe_range(bounds)}".rstrip() if wrong else ""


def describe_range(bounds: Iterable[Any]) -> str:
    """Return the bounds of a number as text, such as ``above 0``; empty for names and without bounds."""
    limits = [bound for bound in bounds if not isinstance(bound, (OneOf, Named))]
    match limits:
        case [Ge(ge=low), Le(le=high)]:
            return f"from {low:.6g} to {high:.6g}"
    return " and ".join(_condition(bound)[1] for bound in limits)


def _flat(bounds: Iterable[Any]) -> Iterator[Any]:
    for bound in bounds:
        if isinstance(bound, GroupedMetadata):
            yield from _flat(bound)
        else:
            yield bound


def _condition(bound: Any) -> tuple[Callable[[Any], bool], str]:
    """Return a check of one bound, and the text of the bound."""
    match bound:
        case Gt(gt=limit):
            return lambda value: bool(value > limit), f"above {limit:.6g}"
        case Ge(ge=limit):
            return lambda value: bool(value >= limit), f"of {limit:.6g} or more"
        case Lt(lt=limit):
            return lambda value: bool(value < limit), f"below {limit:.6g}"
        case Le(le=limit):
            return lambda value: bool(value <= limit), f"of {limit:.6g} or less"
        case NotZero():
            return lambda value: bool(value != 0), "other than 0"
    raise TypeError(f"{bound!r} is not a bound of a port; use Gt, Ge, Lt, Le, Interval, NotZero, OneOf or Named")


def _unknown(name: str, names: Collection[str]) -> str:
    if name in names:
        return ""
    known = ", ".join(repr(known) for known in sorted(filter(None, names)))
    hint = closest(name, names)
    return f"there is no {name!r}" + (f"; did you mean {hint!r}?" if hint else "") + f" (known: {known})"
