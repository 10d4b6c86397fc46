"""Beliefs of objects that nobody has looked at: whoever tells knows where they stand."""

from __future__ import annotations

from typing import ClassVar

from behaviours.names import ObjectName, SurfaceName
from behaviours.skill import Declaration, InstantSkill, SkillFailure
from behaviours.surfaces import UNKNOWN_SURFACE, told_surface
from bestman_bt.engine import In
from bestman_bt.messages import Pose
from bestman_bt.messages.bounds import NonNegative
from bestman_bt.world_model import ObjectBelief


class BelieveObject(InstantSkill):
    """Believe that an object stands at a pose, such as in a fixture or where another robot has seen it.

    Where a surface is named, it is believed to be as high as the object's lowest point.
    """

    object = In[str](ObjectName, "an object that the robot has a model of")
    pose = In(Pose, "x;y;z;roll;pitch;yaw in the map frame, of the model's origin")
    surface = In[str | None](SurfaceName, "the surface that it stands on", required=False)
    position_std = In[float](NonNegative, "metres", default=0.002)
    FAILS: ClassVar = {
        **UNKNOWN_SURFACE,
        "unknown_object": "add a model of it",
    }
    DECLARATION = Declaration(effects=("located({object})",))

    def act(self) -> None:
        """Takes no picture."""
        world, name = self.skills.world, self.object
        model = world.models.get(name)
        if model is None:
            raise SkillFailure("unknown_object", f"no model of {name!r}; there are {', '.join(world.models)}")
        pose, surface = self.pose, self.surface
        if surface:
            lowest = float(pose.position[2] + (pose.rotation[2] * model.bounds()).min(axis=0).sum())
            world.obstacles[f"{surface}/surface"] = told_surface(self.skills, surface, lowest)
        world.objects[name] = ObjectBelief(
            name=name,
            model=model,
            pose=pose,
            confidence=1.0,
            position_std=self.position_std,
            stamp=self.skills.clock.now(),
            surface=surface or None,
        )
