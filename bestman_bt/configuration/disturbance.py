"""Scripted disturbances of a task: interventions during the robot's work, each once."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Annotated, Literal

from bestman_bt.configuration.checked import numbered
from bestman_bt.configuration.document import Document, FieldPath
from bestman_bt.configuration.errors import Problem, as_far_as_read
from bestman_bt.configuration.quantity import PositiveLength, SmallerFirst, Time

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
    """One intervention in a run, triggered by an event; the seed draws time and place.

    ``kind``: ``moved``: after ``object`` was seen and before it is in the hand, it is put ``distance`` metres away on
    its surface. ``elsewhere``: it is put on ``surface``, by default one that the seed chooses. ``slips``: after
    ``object`` was lifted, it falls out of the hand. ``shut``: after the door or drawer ``articulation`` was opened, it
    is pushed shut; with ``object`` only before that is in the hand. ``after``: the delay, seconds.
    """

    kind: DisturbanceKind
    object: str | None = None
    articulation: str | None = None
    surface: str | None = None
    distance: Annotated[tuple[PositiveLength, PositiveLength], SmallerFirst] = (0.10, 0.30)
    after: Annotated[tuple[Time, Time], SmallerFirst] = (0.0, 0.3)


def disturbance_faults(asked: Sequence[DisturbanceConfig], document: Document) -> Iterator[Problem]:
    """Yield the faults of a task's ``disturbances`` that types cannot express: missing or superfluous fields of a
    kind.
    """
    for index, disturbance in numbered(asked):
        yield from _faults_of_one(disturbance, document, ("disturbances", index))


@as_far_as_read
def _faults_of_one(disturbance: DisturbanceConfig, document: Document, path: FieldPath) -> Iterator[Problem]:
    kind, written = disturbance.kind, document.data["disturbances"][path[-1]]
    needed = _NEEDED[kind]
    if written.get(needed) is None:
        yield document.problem(path, f"{needed!r} is missing: what kind {kind!r} is done to")
    known = (*_OF_ALL, needed, *_POSSIBLE[kind])
    for name, unset in ((one.name, one.default) for one in fields(disturbance)):  # the file of a run has all fields
        if name not in known and getattr(disturbance, name) != unset:
            yield document.problem((*path, name), f"kind {kind!r} has no {name!r}; it has {', '.join(known)}")
