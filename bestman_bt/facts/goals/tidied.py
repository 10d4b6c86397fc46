"""``tidied``: all listed objects are within a region."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

import numpy as np
from typing_extensions import override

from bestman_bt.configuration.checked import numbered
from bestman_bt.configuration.errors import Problem, up_to_unread_field
from bestman_bt.configuration.quantity import Length, SmallerFirst
from bestman_bt.facts.evidence import Evidence, Verdict, joined
from bestman_bt.facts.goals.goal import Goal
from bestman_bt.facts.standing import rest_faults, surface_pose, tilt_fault

Range = Annotated[tuple[Length, Length], SmallerFirst]


@dataclass(frozen=True)
class TidiedFields:
    """All present ``objects`` should be within a rectangle of ``surface``: ``x``, ``y`` in its frame.

    ``source``: the surface on which to search for them.
    """

    objects: tuple[str, ...]
    source: str
    surface: str
    x: Range
    y: Range


class Tidied(Goal[TidiedFields]):
    """The middle of each present object is within the region; upright, released, at rest."""

    parameters = TidiedFields
    fills = ("objects", "source", "target", "region_x", "region_y")
    measures: ClassVar[Mapping[str, tuple[str, ...]]] = {"tidied": ("outside_mm", "tidied_share")}

    def problems(self) -> Iterator[Problem]:
        """Yield problems for missing objects, empty ranges and unknown names."""
        yield from self.unknown_surface("source")
        yield from self.unknown_surface("surface")
        for axis in ("x", "y"):
            yield from self._empty(axis)
        if not self.asked.objects:
            yield self.fault("should name at least one object", "objects")
        for index, _ in numbered(self.asked.objects):
            yield from self.unknown_object("objects", index)

    @up_to_unread_field
    def _empty(self, axis: str) -> Iterator[Problem]:
        lower, upper = getattr(self.asked, axis)
        if lower == upper:
            yield self.fault(f"leaves no room: the limits should differ, got [{lower:g}, {upper:g}]", axis)

    def entries(self) -> dict[str, Any]:
        """Return the blackboard entries ``objects``, ``source``, ``target``, ``region_x`` and ``region_y``."""
        asked = self.asked
        region = {"region_x": list(asked.x), "region_y": list(asked.y)}
        return {"objects": list(asked.objects), "source": asked.source, "target": asked.surface, **region}

    @override
    def subjects(self) -> list[str]:
        return list(self.asked.objects)

    def judged(self, predicate: str, evidence: Evidence) -> Verdict:
        """Return the verdict with the metrics ``outside_mm``, the largest distance of an object outside the region (0
        if inside), and ``tidied_share``, the fraction of objects inside."""
        tidy = self.asked
        present = [name for name in tidy.objects if name in evidence.before]
        if not present:
            return Verdict(False, f"none of {', '.join(tidy.objects)} is in the scene")
        _, map_from_surface, _, room = surface_pose(evidence, tidy.surface)
        lower, upper = np.array([tidy.x[0], tidy.y[0]]), np.array([tidy.x[1], tidy.y[1]])
        verdicts, outside = [], []
        for name in present:
            pose = evidence.truth.object_pose(name)
            local = map_from_surface.inverse().apply(pose.position[None])[0]
            off = float(np.linalg.norm(np.maximum(np.maximum(lower - local[:2], local[:2] - upper), 0.0)))
            outside.append(1e3 * off)
            faults = [f"{1e3 * off:.0f} mm outside the region"] if off > 0.0 else []
            if not 0.0 < local[2] < room:
                faults.append(f"not above {tidy.surface}")
            faults += tilt_fault(evidence, pose)
            faults += rest_faults(evidence, name, tidy.surface)
            verdicts.append(Verdict.on(name, faults))
        joint = joined(verdicts)
        share = sum(verdict.holds for verdict in verdicts) / len(verdicts)
        return Verdict(joint.holds, joint.why, {"outside_mm": max(outside), "tidied_share": share})
