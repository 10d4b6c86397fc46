"""``opened``: a door or drawer is open or closed as far as requested."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from bestman_bt.configuration.errors import Problem, up_to_unread_field
from bestman_bt.configuration.quantity import JointPosition, parse_quantity
from bestman_bt.facts.evidence import Evidence, Verdict
from bestman_bt.facts.goals.goal import Goal, unknown


@dataclass(frozen=True)
class OpenedFields:
    """A door or drawer, ``furniture/name``, should be open by between ``at_least`` and ``at_most``, radians for a door,
    metres for a drawer.
    """

    articulation: str
    at_least: JointPosition | None = None
    at_most: JointPosition | None = None


class Opened(Goal[OpenedFields]):
    """``at_least`` ≤ opening ≤ ``at_most``."""

    parameters = OpenedFields
    fills = ("articulation", "furniture", "at_least", "at_most")
    measures: ClassVar[Mapping[str, tuple[str, ...]]] = {"opened": ("angle_deg", "opening_mm")}

    @property
    def _limits(self) -> dict[str, float]:
        limits = {"at_least": self.asked.at_least, "at_most": self.asked.at_most}
        return {name: value for name, value in limits.items() if value is not None}

    def problems(self) -> Iterator[Problem]:
        """Yield problems for an unknown door or drawer, and for limits of the wrong unit or out of range."""
        yield from self._limit_faults()
        yield from self._faults_of_the_joint()

    def _limit_faults(self) -> Iterator[Problem]:
        least, most = self.asked.at_least, self.asked.at_most
        if not {"at_least", "at_most"} & {*self.written}:
            yield self.fault("one of 'at_least' and 'at_most' should be given")
        elif least is not None and most is not None and least > most:
            yield self.fault(f"should not be less than at_least, {least:g}, got {most:g}", "at_most")

    @up_to_unread_field
    def _faults_of_the_joint(self) -> Iterator[Problem]:
        name = self.asked.articulation
        doors = {
            f"{piece.name}/{door.name}": door for piece in self.world.furniture for door in piece.model.articulations
        }
        yield from unknown(self.config, (*self.path, "articulation"), name, doors, "the scene has no door or drawer")
        if name not in doors:
            return
        door = doors[name]
        dimension, scale, unit = (
            ("angle", math.degrees(1.0), " deg") if door.kind == "revolute" else ("length", 100.0, " cm")
        )
        for field, value in self._limits.items():
            try:
                parse_quantity(self.written.get(field, value), dimension)
            except ValueError as error:
                yield self.fault(f"{name!r} has a {door.kind} joint: {error}", field)
                continue
            if not 0.0 <= value <= door.upper:
                limits = f"opens from 0 to {scale * door.upper:.4g}{unit}, got {scale * value:.4g}{unit}"
                yield self.fault(f"{name!r} {limits}", field)

    def entries(self) -> dict[str, Any]:
        """Return ``articulation``, ``furniture``, and the limits."""
        name = self.asked.articulation
        return {"articulation": name, "furniture": name.partition("/")[0], **self._limits}

    def subjects(self) -> list[str]:
        """Return the door or drawer."""
        return [self.asked.articulation]

    def judged(self, predicate: str, evidence: Evidence) -> Verdict:
        """Return the verdict with the metric ``angle_deg`` of a door or ``opening_mm`` of a drawer."""
        name = self.asked.articulation
        furniture, _, part = name.partition("/")
        piece = next(p for p in self.world.furniture if p.name == furniture)
        door = next(a for a in piece.model.articulations if a.name == part)
        scale, unit, metric = (
            (math.degrees(1.0), "°", "angle_deg") if door.kind == "revolute" else (1e3, " mm", "opening_mm")
        )
        position = evidence.truth.articulation_position(name)
        faults = []
        if self.asked.at_least is not None and position < self.asked.at_least:
            faults.append(f"at least {scale * self.asked.at_least:.0f}{unit} are required")
        if self.asked.at_most is not None and position > self.asked.at_most:
            faults.append(f"at most {scale * self.asked.at_most:.0f}{unit} are required")
        why = f"the {name} is open by {scale * position:.1f}{unit}, {', '.join(faults)}" if faults else ""
        return Verdict(not faults, why, {metric: scale * position})
