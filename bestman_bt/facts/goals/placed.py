"""``placed``: each goal's object is at its goal; ``inside``: at least in the drawer or on the inner board."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from typing_extensions import override

from bestman_bt.configuration.checked import numbered
from bestman_bt.configuration.errors import Problem, up_to_unread_field
from bestman_bt.configuration.quantity import PositiveLength
from bestman_bt.facts.evidence import Evidence, Verdict
from bestman_bt.facts.goals.goal import Goal, surface_names
from bestman_bt.facts.standing import drawer_displacement, is_over, rest_faults, tilt_fault
from bestman_bt.messages import Pose, wrap_angle


@dataclass(frozen=True)
class PlacedFields:
    """``object``, on ``source``, should be at the scene's goal ``at`` on ``surface``.

    Surfaces are named as in the map: ``counter``, ``counter/top`` or, of a drawer, ``drawer_chest/drawer_1``.
    ``object``: from a list of names, the seed chooses a present one. ``within``: metres; None: the task's tolerance.
    """

    object: str | tuple[str, ...]
    at: str
    source: str
    surface: str
    within: PositiveLength | None = None


@dataclass(frozen=True, eq=False)
class PlaceGoal:
    """``object``, on ``source``, should be at ``pose`` (map frame) on ``surface``.

    In a drawer the pose is for the closed drawer, and moves with it.
    """

    name: str
    object: str
    source: str
    surface: str
    pose: Pose


class Placed(Goal[PlacedFields]):
    """``placed``: released, upright, within the tolerance, at rest, on the right surface.

    ``inside``: its middle is above the surface and below the next one, released and at rest, in any orientation. To
    require a closed door or drawer, add ``opened: {articulation: …, at_most: …}``.
    """

    parameters = PlacedFields
    measures: ClassVar[Mapping[str, tuple[str, ...]]] = {
        "placed": ("place_error_mm", "tilt_deg", "yaw_error_deg"),
        "inside": (),
    }
    fills = ("object", "source", "target", "goal", "goals")
    several = True

    @cached_property
    def goal(self) -> PlaceGoal:
        """The object and its goal, with the choice of the seed."""
        asked, models = self.asked, self.world_model.models
        pose = self.world.goals[asked.at]
        if isinstance(asked.object, str):
            return PlaceGoal(asked.at, asked.object, asked.source, asked.surface, pose)
        present = [thing.name for thing in self.world.objects if thing.name in asked.object]
        names = present or [name for name in asked.object if name in models]
        chosen = names[int(np.random.default_rng([self.config.seed, 3]).integers(len(names)))]
        lift = (float(models[chosen].size[2]) - float(self.world.goal_heights[asked.at])) / 2
        higher = Pose(pose.position + np.array([0.0, 0.0, lift]), pose.quaternion)
        return PlaceGoal(asked.at, chosen, asked.source, asked.surface, higher)

    def problems(self) -> Iterator[Problem]:
        """Yield unknown names, and a surface other than that of the scene's goal."""
        yield from self.unknown_place("at")
        yield from self._object_faults()
        yield from self.unknown_surface("source")
        yield from self.unknown_surface("surface")
        yield from self._elsewhere()

    @up_to_unread_field
    def _object_faults(self) -> Iterator[Problem]:
        if isinstance(self.asked.object, str):
            yield from self.unknown_object("object")
            return
        if not self.asked.object:
            yield self.fault("should name at least one object", "object")
        elif set(self.asked.object) <= set(self.task.absent):
            yield self.fault("the scene leaves out all of these objects", "object")
        for index, _ in numbered(self.asked.object):
            yield from self.unknown_object("object", index, absent=self.task.absent)

    @up_to_unread_field
    def _elsewhere(self) -> Iterator[Problem]:
        at, surface, known = self.asked.at, self.asked.surface, self.world_model.map
        there = self.world.goal_surfaces.get(at)
        if (
            there is not None
            and surface in surface_names(self.world_model)
            and there in surface_names(self.world_model)
        ):
            pieces = [(piece.name, found.name) for piece, found in map(known.surface, (surface, there))]
            if pieces[0] != pieces[1]:
                yield self.fault(f"the scene's goal {at!r} is on {there!r}, not on {surface!r}", "surface")

    def entries(self) -> dict[str, Any]:
        """Return the blackboard entries ``object``, ``source``, ``target`` and ``goal``."""
        goal = self.goal
        return {"object": goal.object, "source": goal.source, "target": goal.surface, "goal": goal.pose}

    @classmethod
    def entries_of(cls, goals: Sequence[Placed]) -> dict[str, Any]:
        """Return the entries; for several goals, ``goals`` with all of them, and each pose by name."""
        if len(goals) == 1:
            return goals[0].entries()
        return {"goals": [goal.entries() for goal in goals], **{one.goal.name: one.goal.pose for one in goals}}

    def labels(self) -> list[str]:
        """Return the object, or all objects that the seed may choose."""
        return [self.asked.object] if isinstance(self.asked.object, str) else list(self.asked.object)

    def given_places(self) -> dict[str, str]:
        """Return the source surface of the object."""
        furniture, surface = self.world_model.map.surface(self.goal.source)
        return {self.goal.object: f"{furniture.name}/{surface.name}"}

    @override
    def subjects(self) -> list[str]:
        return [self.goal.object]

    def judged(self, predicate: str, evidence: Evidence) -> Verdict:
        """Return the verdict with the metrics of ``placed``: position error, tilt and rotation."""
        if self.goal.object not in evidence.before:
            return Verdict(False, f"there is no {self.goal.object} in the scene")
        return self._placed(evidence, self.goal) if predicate == "placed" else self._inside(evidence, self.goal)

    def _placed(self, evidence: Evidence, goal: PlaceGoal) -> Verdict:
        tolerances = self.config.task.tolerances
        pose = evidence.truth.object_pose(goal.object)
        metrics = self.errors(pose, _asked(evidence, goal), self.world_model.models[goal.object].symmetry_order)
        faults = []
        within = tolerances.position if self.asked.within is None else self.asked.within
        if metrics["place_error_mm"] > 1e3 * within:
            faults.append(f"{metrics['place_error_mm']:.0f} mm from the goal")
        faults += tilt_fault(evidence, pose)
        if tolerances.yaw is not None and metrics.get("yaw_error_deg", 0.0) > math.degrees(tolerances.yaw):
            faults.append(f"turned by {metrics['yaw_error_deg']:.0f}°")
        faults += rest_faults(evidence, goal.object, goal.surface)
        return Verdict.on(goal.object, faults, metrics)

    @staticmethod
    def _inside(evidence: Evidence, goal: PlaceGoal) -> Verdict:
        faults = [] if is_over(evidence, goal.object, goal.surface) else [f"not inside {goal.surface}"]
        return Verdict.on(goal.object, faults + rest_faults(evidence, goal.object, goal.surface))

    @staticmethod
    def errors(pose: Pose, asked: Pose, symmetry_order: int) -> dict[str, float]:
        """Return metric → error of a pose relative to the requested one; a symmetric object may be rotated."""
        metrics = {
            "place_error_mm": 1e3 * float(np.linalg.norm(pose.position[:2] - asked.position[:2])),
            "tilt_deg": math.degrees(pose.tilt),
        }
        if symmetry_order:
            turn = 2.0 * math.pi / symmetry_order
            off = abs(wrap_angle((pose.yaw - asked.yaw) * symmetry_order)) / (2.0 * math.pi) * turn
            metrics["yaw_error_deg"] = math.degrees(off)
        return metrics


def _asked(evidence: Evidence, goal: PlaceGoal) -> Pose:
    """Return the goal's pose; in a drawer it is given for the closed one and goes with it."""
    piece = next(p for p in evidence.task.world.furniture if p.name == goal.surface.partition("/")[0])
    return piece.pose @ drawer_displacement(evidence, goal.surface) @ piece.pose.inverse() @ goal.pose
