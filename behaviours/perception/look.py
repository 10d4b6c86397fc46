"""Pointing the head camera and the wrist camera."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from behaviours.arm_motion import ARM_PLANNING_FAILS, move_free
from behaviours.perception.perceive import NO_CAMERA, camera_called
from behaviours.perception.surfaces import UNKNOWN_SURFACE, find_surface
from behaviours.skill import ArmNode, Declaration, ObjectName, Skill, SkillCoroutine, SkillFailure, SurfaceName
from bestman_bt.engine import In
from bestman_bt.messages import Pose

DISTANCES = (0.48, 0.42, 0.55, 0.36)
"""Distances of the camera from its target, metres, the best first: it sees a drawer of 70 cm completely."""
TILTS = tuple(math.radians(degrees) for degrees in (0.0, 12.0, -12.0, 24.0, -24.0, 36.0))
"""Tilts from straight down about the longer side of the surface; positive: away from the front."""
ENOUGH = 3
"""Number of postures offered to the planner."""


class LookInto(ArmNode, Skill):
    """Hold the wrist camera above a surface so that it looks down at an object, if it was seen, else at the whole
    surface.

    For a drawer it looks at the part that has come out of the furniture.
    """

    REQUIRES = ("arm", "wrist_camera")
    USES = ("camera",)
    surface = In[str](SurfaceName, "the surface, such as drawer_chest/drawer_3")
    object = In[str | None](ObjectName, "the target, if it has been seen", required=False)
    point = In(Pose, "a pose in the map frame; has priority", required=False)
    FAILS: ClassVar = {
        **UNKNOWN_SURFACE,
        **NO_CAMERA,
        **ARM_PLANNING_FAILS,
        "no_view": "stand elsewhere: FindStandPose, NavigateTo; from afar: LookAt",
    }
    DECLARATION = Declaration(pre=("not holding(any)",), effects=("looking_at({surface})",))

    def execute(self) -> SkillCoroutine[None]:
        """Find arm postures, and move to the first that has a path."""
        camera = camera_called(self.skills, "wrist")
        surface: str = self.surface
        camera_from_tool = camera.base_from_camera().inverse() @ self.skills.base_from_tool()
        postures = yield self.compute("view_planning", self._postures, camera_from_tool)
        if not postures:
            raise SkillFailure("no_view", f"the hand reaches no place from which its camera looks into {surface}")
        yield from move_free(self, postures)

    def _postures(self, camera_from_tool: Pose) -> list[NDArray[np.float64]]:
        skills = self.skills
        world = skills.arm_world(skills.planning_scene())
        reference = skills.arm_positions()
        found: list[NDArray[np.float64]] = []
        for base_from_camera in self._views():
            result = skills.kinematics.solve(
                base_from_camera @ camera_from_tool, reference, skills.rng, 1, world.is_free, 8
            )
            found += result.solutions
            if len(found) >= ENOUGH:
                break
        return found

    def _views(self) -> Iterator[Pose]:
        """Yield poses of the camera in the base frame, the best first."""
        skills = self.skills
        furniture, surface = find_surface(skills, self.surface)
        frame = skills.map_from_base.inverse() @ furniture.pose.to_pose()
        along = 0.0 if surface.size[0] > surface.size[1] else math.pi / 2
        target = self._target(frame)
        for distance in DISTANCES:
            for tilt in TILTS:
                for turn in (0.0, math.pi):
                    # x of the camera, the wide side of its picture, along the longer side of the surface.
                    turned = Pose.from_xyz_rpy((0.0, 0.0, 0.0), (0.0, 0.0, frame.yaw + along + turn))
                    leaning = tilt if turn else -tilt
                    view = turned @ Pose.from_xyz_rpy((0.0, 0.0, 0.0), (math.pi + leaning, 0.0, 0.0))
                    yield Pose(target - distance * view.rotation[:, 2], view.quaternion)

    def _target(self, base_from_furniture: Pose) -> NDArray[np.float64]:
        """Return the middle of the view target, (3,) metres in the base frame."""
        skills = self.skills
        base_from_map = skills.map_from_base.inverse()
        point: Pose | None = self.point
        belief = skills.world.objects.get(self.object or "")
        if point is not None:
            return (base_from_map @ point).position
        if belief is not None:
            return (base_from_map @ belief.pose).position
        furniture, surface = find_surface(skills, self.surface)
        x, y, z = (float(value) for value in surface.pose.position)
        if surface.drawer is not None:
            half = surface.size[0] / 2
            x = (x - half + min(x + half, -furniture.footprint[0] / 2)) / 2
        return (base_from_furniture @ Pose(np.array([x, y, z]))).position


class LookAt(Skill):
    """Turn the head camera to a point, to the last seen place of an object, or to a surface of the map."""

    REQUIRES = ("head", "camera")
    point = In(Pose, "a pose in the map frame; has priority", required=False)
    object = In[str | None](ObjectName, "an object; used if it has been seen", required=False)
    surface = In[str | None](SurfaceName, "a surface of the map, such as table", required=False)
    FAILS: ClassVar = {
        **UNKNOWN_SURFACE,
        "no_target": "give a point or a surface, or DetectObject first",
    }
    DECLARATION = Declaration(effects=("looking_at({object})",))

    def on_load(self) -> None:
        """Raise ValueError if no target is given."""
        if not any(self.attributes.get(port) for port in ("point", "object", "surface")):
            raise ValueError("no target is set: give a point, an object or a surface")

    def execute(self) -> SkillCoroutine[None]:
        """Turn the head to the target and wait until it is at rest."""
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
