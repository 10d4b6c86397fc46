"""Scripted disturbances of a task: what somebody does while the robot works, each once."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from bestman_bt.configuration.document import Document
from bestman_bt.configuration.errors import Problem
from bestman_bt.configuration.quantity import PositiveLength, Time

DisturbanceKind = Literal["moved", "elsewhere", "slips", "shut"]

_NEEDED: Mapping[DisturbanceKind, str] = {
    "moved": "object",
    "elsewhere": "object",
    "slips": "object",
    "shut": "articulation",
}
_POSSIBLE: Mapping[DisturbanceKind, tuple[str, ...]] = {
    "moved": ("distance",),
    "elsewhere": ("surface",),
    "slips": (),
    "shut": ("object",),
}
_OF_ALL = ("kind", "after")


@dataclass(frozen=True)
class DisturbanceConfig:
    """What somebody does once in a run, as soon as something has happened; seeds draw when and where.

    ``kind``: ``moved``: once ``object`` was seen, and before it is in the hand, it is put ``distance`` metres away on
    its surface. ``elsewhere``: it is then put on ``surface``, without one on a surface that the seed chooses.
    ``slips``: once ``object`` was lifted, it falls out of the hand. ``shut``: once the door or drawer ``articulation``
    was opened, somebody pushes it shut; with ``object`` only before that is in the hand.
    ``after``: how many seconds later.
    """

    kind: DisturbanceKind
    object: str | None = None
    articulation: str | None = None
    surface: str | None = None
    distance: tuple[PositiveLength, PositiveLength] = (0.10, 0.30)
    after: tuple[Time, Time] = (0.0, 0.3)


def disturbance_faults(asked: Sequence[DisturbanceConfig], document: Document) -> Iterator[Problem]:
    """What types cannot tell of a task's ``disturbances``: fields that a kind needs or does not have."""
    for index, disturbance in enumerate(asked):
        path, kind = ("disturbances", index), disturbance.kind
        written: Mapping[str, Any] = document.data["disturbances"][index]
        needed = _NEEDED[kind]
        if getattr(disturbance, needed) is None:
            yield document.problem(path, f"{needed!r} is missing: what kind {kind!r} is done to")
        known = (*_OF_ALL, needed, *_POSSIBLE[kind])
        for name in written:
            unset = DisturbanceConfig.__dataclass_fields__[name].default  # the file of a run has all fields
            if name not in known and getattr(disturbance, name) != unset:
                yield document.problem((*path, name), f"kind {kind!r} has no {name!r}; it has {', '.join(known)}")
        for name in ("distance", "after"):
            lower, upper = getattr(disturbance, name)
            if lower > upper:
                message = f"the smaller limit comes first, got [{lower:g}, {upper:g}]"
                yield document.problem((*path, name), message)
