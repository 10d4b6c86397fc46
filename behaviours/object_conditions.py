"""What is believed of objects, as conditions: no picture is taken."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from behaviours.names import ObjectName, SurfaceName
from behaviours.skill import Explained, SkillCondition
from bestman_bt.engine import In, Out, SyncAction
from bestman_bt.messages import Pose, wrap_angle


class BelievedSurface(Explained, SyncAction):
    """Tell on which surface an object is believed to stand; another one where it has not been seen."""

    object = In[str](ObjectName, "the object")
    otherwise = In[str](SurfaceName, "the surface to search first")
    surface = Out(str, "the surface", required=True)

    def on_tick(self) -> int:
        """Asks the beliefs."""
        belief = self.skills.world.objects.get(self.object)
        known = belief.surface if belief is not None else None
        self.surface = known or self.otherwise
        return self.succeed()


class ObjectVisible(SkillCondition):
    """Whether an object was seen lately."""

    object = In[str](ObjectName, "the object")
    max_age = In(float, "seconds", default=5.0)
    FAILS: ClassVar = {"not_visible": "DetectObject, or ScanScene"}

    def check(self) -> tuple[str, str] | None:
        """Asks the beliefs; takes no picture."""
        name: str = self.object
        belief = self.skills.world.objects.get(name)
        if belief is None:
            return "not_visible", f"the {name} has not been seen"
        age = self.skills.clock.now() - belief.stamp
        if age > self.max_age:
            return "not_visible", f"the {name} was last seen {age:.1f} s ago"
        return None


class ObjectAt(SkillCondition):
    """Whether an object, as last seen, stands upright at a goal."""

    object = In[str](ObjectName, "the object")
    goal = In(Pose, "where it should be, in the map frame")
    tolerance = In(float, "metres, horizontally", default=0.02)
    yaw_tolerance = In(float, "radians; any yaw without it", required=False)
    FAILS: ClassVar = {"not_at_goal": "DetectObject, PlanGrasp, Grasp, then PlaceOn"}

    def check(self) -> tuple[str, str] | None:
        """Asks the beliefs; takes no picture."""
        name: str = self.object
        goal: Pose = self.goal
        belief = self.skills.world.objects.get(name)
        if belief is None:
            return "not_at_goal", f"the {name} has not been seen"
        distance = float(np.linalg.norm(belief.pose.position[:2] - goal.position[:2]))
        if distance > self.tolerance:
            return "not_at_goal", f"the {name} stands {1e3 * distance:.0f} mm from the goal"
        if belief.pose.tilt > np.radians(10):
            return "not_at_goal", f"the {name} has fallen over"
        tolerance: float | None = self.yaw_tolerance
        turned = yaw_difference(belief.pose.yaw, goal.yaw, belief.model.symmetry_order)
        if tolerance is not None and turned > tolerance:
            return "not_at_goal", f"the {name} is turned by {np.degrees(turned):.0f}°"
        return None


def yaw_difference(yaw: float, other: float, symmetry_order: int) -> float:
    """Radians between two yaws of an object; turns by ``symmetry_order`` look the same, 0: any turn does."""
    if symmetry_order == 0:
        return 0.0
    return abs(wrap_angle((yaw - other) * symmetry_order)) / symmetry_order
