"""``tool_at``: the tool of the robot's arm is at its target."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

import numpy as np

from bestman_bt.configuration.errors import Problem
from bestman_bt.configuration.quantity import Length, SmallerFirst
from bestman_bt.facts.evidence import Evidence, Verdict
from bestman_bt.facts.goals.goal import Goal
from bestman_bt.messages import Pose
from bestman_bt.robot_model.model import ArmModel


@dataclass(frozen=True)
class ToolAtFields:
    """The tool should point down above the world's goal ``goal``, rotated like it, ``height`` metres above its middle.

    From a range of heights the seed chooses one.
    """

    goal: str
    height: Annotated[tuple[Length, Length], SmallerFirst]


class ToolAt(Goal[ToolAtFields]):
    """Within the tolerances of position and of total rotation, ``tilt``."""

    parameters = ToolAtFields
    fills = ("goal",)
    measures: ClassVar[Mapping[str, tuple[str, ...]]] = {"tool_at": ("tool_error_mm", "tool_error_deg")}

    @property
    def pose(self) -> Pose:
        """The target of the tool, map_from_tool: pointing down, at the chosen height."""
        goal = self.world.goals[self.asked.goal]
        height = float(np.random.default_rng([self.config.seed, 4]).uniform(*self.asked.height))
        return Pose.from_xyz_rpy(goal.position + np.array([0.0, 0.0, height]), (math.pi, 0.0, goal.yaw))

    def problems(self) -> Iterator[Problem]:
        """Yield a problem for a missing arm or an unknown goal."""
        yield from self.missing_part(ArmModel, "an arm")
        yield from self.unknown_place("goal")

    def entries(self) -> dict[str, Any]:
        """Return the blackboard entry ``goal``."""
        return {"goal": self.pose}

    def judged(self, predicate: str, evidence: Evidence) -> Verdict:
        """Return the verdict with position and rotation errors of the tool as metrics."""
        tolerances = self.config.task.tolerances
        off = self.pose.inverse() @ evidence.truth.frame_pose(evidence.tool_frame)
        distance = float(np.linalg.norm(off.position))
        angle = 2.0 * math.acos(min(1.0, abs(float(off.quaternion[3]))))
        faults = []
        if distance > tolerances.position:
            faults.append(f"{1e3 * distance:.0f} mm from the goal")
        if angle > tolerances.tilt:
            faults.append(f"turned away by {math.degrees(angle):.0f}°")
        metrics = {"tool_error_mm": 1e3 * distance, "tool_error_deg": math.degrees(angle)}
        return Verdict.on("tool", faults, metrics)
