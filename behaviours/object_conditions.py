"""What is believed of objects, as conditions: no picture is taken."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from py_trees.ports import PortInformation

from behaviours.names import ObjectName, SurfaceName
from behaviours.skill import Explained, SkillCondition
from bestman_bt.engine import SyncAction
from bestman_bt.engine.bounds import BoundedPort
from bestman_bt.messages import Pose, wrap_angle


class BelievedSurface(Explained, SyncAction):
    """Tell on which surface an object is believed to stand; another one where it has not been seen."""

    INPUT_PORTS: ClassVar = {
        "object": BoundedPort(ObjectName, description="the object"),
        "otherwise": BoundedPort(SurfaceName, description="the surface to search first"),
    }
    OUTPUT_PORTS: ClassVar = {"surface": PortInformation(str, description="the surface")}

    def on_tick(self) -> int:
        """Asks the beliefs."""
        belief = self.skills.world.objects.get(self.get_input("object"))
        known = belief.surface if belief is not None else None
        self.set_output("surface", known or self.get_input("otherwise"))
        return self.succeed()


class ObjectVisible(SkillCondition):
    """Whether an object was seen lately."""

    INPUT_PORTS: ClassVar = {
        "object": BoundedPort(ObjectName, description="the object"),
        "max_age": PortInformation(float, required=False, default_value=5.0, description="seconds"),
    }
    FAILS: ClassVar = {"not_visible": "DetectObject, or ScanScene"}

    def check(self) -> tuple[str, str] | None:
        """Asks the beliefs; takes no picture."""
        name: str = self.get_input("object")
        belief = self.skills.world.objects.get(name)
        if belief is None:
            return "not_visible", f"the {name} has not been seen"
        age = self.skills.clock.now() - belief.stamp
        if age > self.get_input("max_age"):
            return "not_visible", f"the {name} was last seen {age:.1f} s ago"
        return None


class ObjectAt(SkillCondition):
    """Whether an object, as last seen, stands upright at a goal."""

    INPUT_PORTS: ClassVar = {
        "object": BoundedPort(ObjectName, description="the object"),
        "goal": PortInformation(Pose, description="where it should be, in the map frame"),
        "tolerance": PortInformation(float, required=False, default_value=0.02, description="metres, horizontally"),
        "yaw_tolerance": PortInformation(float, required=False, description="radians; any yaw without it"),
    }
    FAILS: ClassVar = {"not_at_goal": "DetectObject, PlanGrasp, Grasp, then PlaceOn"}

    def check(self) -> tuple[str, str] | None:
        """Asks the beliefs; takes no picture."""
        name: str = self.get_input("object")
        goal: Pose = self.get_input("goal")
        belief = self.skills.world.objects.get(name)
        if belief is None:
            return "not_at_goal", f"the {name} has not been seen"
        distance = float(np.linalg.norm(belief.pose.position[:2] - goal.position[:2]))
        if distance > self.get_input("tolerance"):
            return "not_at_goal", f"the {name} stands {1e3 * distance:.0f} mm from the goal"
        if belief.pose.tilt > np.radians(10):
            return "not_at_goal", f"the {name} has fallen over"
        tolerance: float | None = self.get_input("yaw_tolerance")
        turned = yaw_difference(belief.pose.yaw, goal.yaw, belief.model.symmetry_order)
        if tolerance is not None and turned > tolerance:
            return "not_at_goal", f"the {name} is turned by {np.degrees(turned):.0f}°"
        return None


def yaw_difference(yaw: float, other: float, symmetry_order: int) -> float:
    """Radians between two yaws of an object; turns by ``symmetry_order`` look the same, 0: any turn does."""
    if symmetry_order == 0:
        return 0.0
    return abs(wrap_angle((yaw - other) * symmetry_order)) / symmetry_order
