"""``lifted``: an object is in the hand, above its initial place, and stays there."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from typing_extensions import override

from bestman_bt.configuration.errors import Problem
from bestman_bt.configuration.quantity import PositiveLength
from bestman_bt.facts.evidence import Evidence, Verdict
from bestman_bt.facts.goals.goal import Goal
from bestman_bt.facts.standing import is_moving
from bestman_bt.robot_model.model import ArmModel


@dataclass(frozen=True)
class LiftedFields:
    """``object``, on ``source``, should be in the hand, ``height`` metres above its initial place."""

    object: str
    source: str
    height: PositiveLength = 0.05


class Lifted(Goal[LiftedFields]):
    """Touched only by the robot, high enough, and at rest."""

    parameters = LiftedFields
    fills = ("object", "source")
    measures: ClassVar[Mapping[str, tuple[str, ...]]] = {"lifted": ("lifted_mm",)}

    def problems(self) -> Iterator[Problem]:
        """Yield a problem for a missing arm or unknown names."""
        yield from self.missing_part(ArmModel, "an arm")
        yield from self.unknown_object("object")
        yield from self.unknown_surface("source")

    def entries(self) -> dict[str, Any]:
        """Return the blackboard entries ``object`` and ``source``."""
        return {"object": self.asked.object, "source": self.asked.source}

    @override
    def subjects(self) -> list[str]:
        return [self.asked.object]

    def judged(self, predicate: str, evidence: Evidence) -> Verdict:
        """Return the verdict with the height above the initial place as metric."""
        name, truth = self.asked.object, evidence.truth
        if name not in evidence.before:
            return Verdict(False, f"there is no {name} in the scene")
        stood = next(thing.pose for thing in self.world.objects if thing.name == name)
        height = float(truth.object_pose(name).position[2] - stood.position[2])
        faults = []
        if height < self.asked.height:
            faults.append(
                f"{1e3 * height:.0f} mm above its former place, {1e3 * self.asked.height:.0f} mm are required"
            )
        if not truth.touches_robot(name):
            faults.append("not in the hand")
        faults += [f"touching the {other}" for other in truth.supports(name)]
        faults += ["still moving"] if is_moving(evidence, name) else []
        return Verdict.on(name, faults, {"lifted_mm": 1e3 * height})
