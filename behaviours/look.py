"""Looking: where the head camera points."""

from __future__ import annotations

from typing import ClassVar

from behaviours.names import ObjectName, SurfaceName
from behaviours.skill import Declaration, Skill, SkillFailure, Steps
from behaviours.surfaces import UNKNOWN_SURFACE
from bestman_bt.engine import In
from bestman_bt.messages import Pose


class LookAt(Skill):
    """Turn the head camera to a point, to an object where it was last seen, or else to a surface of the map."""

    REQUIRES = ("head", "camera")
    point = In(Pose, "a pose in the map frame; goes before the others", required=False)
    object = In[str | None](ObjectName, "an object; used where it has been seen", required=False)
    surface = In[str | None](SurfaceName, "a surface of the map, such as table", required=False)
    FAILS: ClassVar = {
        **UNKNOWN_SURFACE,
        "no_target": "give a point or a surface, or DetectObject first",
    }
    DECLARATION = Declaration(effects=("looking_at({object})",))

    def execute(self) -> Steps:
        """Turn and settle."""
        point = self._target()
        base_from_point = self.skills.map_from_base.inverse().apply(point.position)
        yield self.skills.head.look_at(base_from_point)

    def _target(self) -> Pose:
        world = self.skills.world
        point: Pose | None = self.point
        if point is not None:
            return point
        belief = world.objects.get(self.object or "")
        if belief is not None:
            return belief.pose
        name = self.surface
        if not name:
            raise SkillFailure("no_target", "nothing to look at: no point, no surface, and the object was never seen")
        try:
            furniture, surface = world.surface(name)
        except KeyError as error:
            raise SkillFailure("unknown_surface", str(error.args[0])) from error
        return furniture.pose.to_pose() @ surface.pose
