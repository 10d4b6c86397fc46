"""``placed``: each goal's object stands at its goal; ``inside``: it is at least in the drawer or on the inner board."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from bestman_bt.configuration import Problem, RunConfig
from bestman_bt.configuration.document import FieldPath
from bestman_bt.configuration.task import GoalConfig
from bestman_bt.facts.evidence import Evidence, Verdict, joined
from bestman_bt.facts.goals.goal import Goal
from bestman_bt.facts.standing import is_over, moved_by_drawer, rest_faults, tilt_fault
from bestman_bt.messages import Pose, wrap_angle


@dataclass(frozen=True, eq=False)
class PlaceGoal:
    """``object``, to be sought on ``source``, shall stand at ``pose`` (map frame) on ``surface``.

    In a drawer the pose is that with the drawer closed; it moves with it.
    """

    name: str
    object: str
    source: str
    surface: str
    pose: Pose


class Placed(Goal[GoalConfig]):
    """``placed``: let go, upright, within the tolerance, at rest, on the right surface: each object.

    ``inside``: its middle is above the surface and below the next one above, let go and at rest; whichever way up.
    Whether the door or drawer is closed is asked by ``opening: {at_most: …}`` and the predicate ``opened``.
    """

    fields = ("goal", "goals")
    measures: ClassVar[Mapping[str, tuple[str, ...]]] = {
        "placed": ("place_error_mm", "tilt_deg", "yaw_error_deg"),
        "inside": (),
    }

    @classmethod
    def metric_names(cls, config: RunConfig, predicate: str) -> list[str]:
        """Of several goals also one by one, the object's name behind."""
        names = super().metric_names(config, predicate)
        goals = config.task.goals if len(config.task.goals) > 1 else ()
        objects = [o for goal in goals for o in ((goal.object,) if isinstance(goal.object, str) else goal.object)]
        return [*names, *(f"{name}_{thing}" for name in names for thing in objects)]

    @cached_property
    def goals(self) -> tuple[PlaceGoal, ...]:
        """Which objects shall go where; of objects to choose from, the seed has chosen."""
        return tuple(map(self._drawn, self.config.task.all_goals))

    def _drawn(self, goal: GoalConfig) -> PlaceGoal:
        pose, models = self.world.goals[goal.name], self.world_model.models
        if isinstance(goal.object, str):
            return PlaceGoal(goal.name, goal.object, goal.source, goal.surface, pose)
        present = [thing.name for thing in self.world.objects if thing.name in goal.object]
        names = present or [name for name in goal.object if name in models]
        chosen = names[int(np.random.default_rng([self.config.seed, 3]).integers(len(names)))]
        lift = (float(models[chosen].size[2]) - float(self.world.goal_heights[goal.name])) / 2
        higher = Pose(pose.position + np.array([0.0, 0.0, lift]), pose.quaternion)
        return PlaceGoal(goal.name, chosen, goal.source, goal.surface, higher)

    def problems(self) -> Iterator[Problem]:
        """Unknown names."""
        if self.asked is not None:
            yield from self._problems_of(("goal",), self.asked)
        for index, goal in enumerate(self.config.task.goals):
            yield from self._problems_of(("goals", index), goal)

    def _problems_of(self, path: FieldPath, goal: GoalConfig) -> Iterator[Problem]:
        yield from self.unknown_place((*path, "name"), goal.name)
        if isinstance(goal.object, str):
            yield from self.unknown_object((*path, "object"), goal.object)
        else:
            if not goal.object:
                yield self.config.problem((*path, "object"), "should name at least one object")
            elif set(goal.object) <= set(self.task.absent):
                yield self.config.problem((*path, "object"), "the scene leaves out all of these objects")
            for index, name in enumerate(goal.object):
                yield from self.unknown_object((*path, "object", index), name, self.task.absent)
        yield from self.unknown_surface((*path, "source"), goal.source)
        yield from self.unknown_surface((*path, "surface"), goal.surface)

    def entries(self) -> dict[str, Any]:
        """``object``, ``source``, ``target``, ``goal``; of several, ``goals`` with these, and each pose by name."""
        each: list[dict[str, Any]] = [
            {"object": goal.object, "source": goal.source, "target": goal.surface, "goal": goal.pose}
            for goal in self.goals
        ]
        if self.config.task.goal is not None:
            return each[0]
        return {"goals": each, **{goal.name: goal.pose for goal in self.goals}}

    def told(self) -> dict[str, str]:
        """Where the objects are to be sought."""
        places = {}
        for goal in self.goals:
            furniture, surface = self.world_model.map.surface(goal.source)
            places[goal.object] = f"{furniture.name}/{surface.name}"
        return places

    def subjects(self) -> list[str]:
        """The objects."""
        return [goal.object for goal in self.goals]

    def judged(self, predicate: str, evidence: Evidence) -> Verdict:
        """With several goals the metrics are ``place_error_mm_plate`` … and, of all, the largest ``place_error_mm``."""
        judge = self._placed if predicate == "placed" else self._inside
        verdicts = [judge(evidence, goal) for goal in self.goals]
        if len(verdicts) == 1:
            return verdicts[0]
        both = joined(verdicts)
        metrics = {
            f"{key}_{goal.object}": value
            for goal, verdict in zip(self.goals, verdicts, strict=True)
            for key, value in verdict.metrics.items()
        }
        for key in sorted(both.metrics):
            metrics[key] = max(verdict.metrics[key] for verdict in verdicts if key in verdict.metrics)
        return Verdict(both.holds, both.why, metrics)

    def _placed(self, evidence: Evidence, goal: PlaceGoal) -> Verdict:
        if goal.object not in evidence.before:
            return Verdict(False, f"there is no {goal.object} in the scene")
        tolerances = self.config.task.tolerances
        pose = evidence.truth.object_pose(goal.object)
        metrics = self._errors(pose, _asked(evidence, goal), self.world_model.models[goal.object].symmetry_order)
        faults = []
        if metrics["place_error_mm"] > 1e3 * tolerances.position:
            faults.append(f"{metrics['place_error_mm']:.0f} mm from the goal")
        faults += tilt_fault(evidence, pose)
        if tolerances.yaw is not None and metrics.get("yaw_error_deg", 0.0) > math.degrees(tolerances.yaw):
            faults.append(f"turned by {metrics['yaw_error_deg']:.0f}°")
        faults += rest_faults(evidence, goal.object, goal.surface)
        return Verdict.on(goal.object, faults, metrics)

    @staticmethod
    def _inside(evidence: Evidence, goal: PlaceGoal) -> Verdict:
        if goal.object not in evidence.before:
            return Verdict(False, f"there is no {goal.object} in the scene")
        faults = [] if is_over(evidence, goal.object, goal.surface) else [f"not inside {goal.surface}"]
        return Verdict.on(goal.object, faults + rest_faults(evidence, goal.object, goal.surface))

    @staticmethod
    def _errors(pose: Pose, asked: Pose, symmetry_order: int) -> dict[str, float]:
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
    """The goal's pose; in a drawer it is given for the closed one and goes with it."""
    piece = next(p for p in evidence.task.world.furniture if p.name == goal.surface.partition("/")[0])
    return piece.pose @ moved_by_drawer(evidence, goal.surface) @ piece.pose.inverse() @ goal.pose
