"""Scanning: several views of a surface, fused into one belief of its objects and of free space."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from numpy.typing import NDArray

from behaviours.perception.beliefs import believe_objects, believe_surface
from behaviours.perception.surfaces import SURFACE_NOT_SEEN, UNKNOWN_SURFACE, find_surface, surface_region
from behaviours.skill import ALGORITHM_ERRORS, Declaration, Skill, SkillCoroutine, SurfaceName
from bestman_bt.engine import In, Out
from bestman_bt.messages import Pose, VoxelGrid
from bestman_bt.messages.shapes import Count

if TYPE_CHECKING:
    from bestman_bt.control.rgbd import RGBDView
    from bestman_bt.perception.detection.base import DetectedScene
    from bestman_bt.perception.occupancy import VoxelRegion
    from bestman_bt.perception.pose_estimation.base import PoseHypothesis
    from bestman_bt.perception.segmentation.base import Region, SupportPlane


SPREAD = 0.6
"""Fraction of a surface's longer side over which the views are spread."""
TURN = 0.6
"""Radians between two views without a named surface."""
AHEAD = (1.2, 0.7)
"""Target of the camera without a named surface: metres in front of the base and above the floor."""
MAPPED_HEIGHT = 0.8
"""Metres above the lowest point of a scan that are mapped."""
MAPPED_MARGIN = 0.3
"""Metres around a scanned surface that are mapped."""
MAPPED_AROUND = 2.4
"""Side of the square in front of the base that is mapped without a named surface, metres."""


class ScanScene(Skill):
    """Turn the head over a surface, or around without one, and update the belief from all views together.

    A fixed camera takes one image. The surrounding space is mapped as free, occupied or unknown, for planning.
    """

    REQUIRES = ("camera",)
    USES = ("head",)
    surface = In[str | None](SurfaceName, "a surface, such as table; else all in view", required=False)
    views = In[int](Count, "number of images", default=3)
    further = In(bool, "extend the space mapped by the last scan of this surface", default=False)
    objects = Out(list, "names of the seen objects")
    changes = Out(list, "detected changes: cup moved, can_2 added")
    FAILS: ClassVar = {**UNKNOWN_SURFACE, **SURFACE_NOT_SEEN}
    DECLARATION = Declaration(effects=("scanned({surface})",))

    def execute(self) -> SkillCoroutine[None]:
        """Look, detect and map, view by view; then fuse the views of each object."""
        skills = self.skills
        count: int = self.views
        noticed = len(skills.world.changes)
        views: list[RGBDView] = []
        seen: list[str] = []
        problems: list[Exception] = []
        if not skills.has("head"):
            count = 1  # it sees the same each time
        for point in self._points(count):
            if skills.has("head"):
                yield skills.head.look_at(point)
            try:
                views.append(skills.camera.capture())
                seen += yield from self._detect(views[-1])
            except ALGORITHM_ERRORS as error:
                problems.append(error)
        if len(problems) == count:
            raise problems[0]
        before = skills.world.occupancy
        mapped: VoxelGrid = yield self.compute(
            "depth_fusion", skills.occupancy.fuse, [view.in_map for view in views], self._mapped()
        )
        skills.world.occupancy = mapped if before is None or not self.further else mapped.with_unknown_from(before)
        names = [name for name in dict.fromkeys(seen) if name in skills.world.objects]
        for name in names:
            yield from self._join(name)
        changes = skills.world.changes[noticed:]
        self.objects = names
        self.changes = [f"{change.name} {change.kind}" for change in changes]
        self.feedback_message = f"{len(names)} things, {len(changes)} changes"

    def _points(self, count: int) -> list[NDArray[np.float64]]:
        """Return the points to look at, (3,) metres in the base frame, the middle first."""
        steps = sorted(np.linspace(-0.5, 0.5, count) if count > 1 else [0.0], key=abs)
        name = self.surface
        if not name:
            turns = [step * TURN * (count - 1) for step in steps]
            return [np.array([AHEAD[0] * np.cos(turn), AHEAD[0] * np.sin(turn), AHEAD[1]]) for turn in turns]
        furniture, surface = find_surface(self.skills, name)
        base_from_surface = self.skills.map_from_base.inverse() @ furniture.pose.to_pose() @ surface.pose
        longer = int(surface.size[1] >= surface.size[0])
        along = np.eye(3)[longer] * surface.size[longer] * SPREAD
        return [base_from_surface.apply(step * along) for step in steps]

    def _detect(self, view: RGBDView) -> SkillCoroutine[Sequence[str]]:
        """Add the detections of one view to the world model; return their identities."""
        from bestman_bt.perception.segmentation.support_surfaces import surface_regions

        skills = self.skills
        name = self.surface
        if name:
            scene = yield from self._detected(view, surface_region(skills, name, view))
            return believe_surface(skills, name, view, scene)
        planes: Sequence[SupportPlane] = yield self.compute(
            "segmentation", skills.surfaces.find, view.in_base, skills.rng
        )
        names: list[str] = []
        for plane, region in zip(planes, surface_regions(planes), strict=True):
            scene = yield from self._detected(view, region)
            names += believe_objects(skills, view, scene, self._surface_of(view, plane))
        return names

    def _detected(self, view: RGBDView, region: Region) -> SkillCoroutine[DetectedScene]:
        skills = self.skills
        models = list(skills.world.models.values())
        scene: DetectedScene = yield self.compute(
            "detection", skills.detection.detect, view.in_base, region, models, skills.rng
        )
        return scene

    def _surface_of(self, view: RGBDView, plane: SupportPlane) -> str | None:
        """Return the mapped surface that a measured plane is, if it is one."""
        place = (view.map_from_base @ plane.frame_from_plane).position
        for furniture in self.skills.world.map.furniture.values():
            for surface in furniture.surfaces:
                local = (furniture.pose.to_pose() @ surface.pose).inverse().apply(place)
                if abs(local[2]) < 0.05 and (np.abs(local[:2]) < np.array(surface.size) / 2).all():
                    return f"{furniture.name}/{surface.name}"
        return None

    def _mapped(self) -> VoxelRegion:
        """Return the box to map, in the map frame."""
        from bestman_bt.perception.occupancy import VoxelRegion

        skills = self.skills
        name = self.surface
        if not name:
            centre = Pose(np.array([AHEAD[0], 0.0, AHEAD[1]]))
            return VoxelRegion(skills.map_from_base @ centre, (MAPPED_AROUND, MAPPED_AROUND, 2 * AHEAD[1]))
        furniture, surface = find_surface(skills, name)
        above = Pose(np.array([0.0, 0.0, MAPPED_HEIGHT / 2 - MAPPED_MARGIN / 2]))
        x, y = (extent + 2 * MAPPED_MARGIN for extent in surface.size)
        return VoxelRegion(furniture.pose.to_pose() @ surface.pose @ above, (x, y, MAPPED_HEIGHT + MAPPED_MARGIN))

    def _join(self, name: str) -> SkillCoroutine[None]:
        """Fuse the poses of an object from all views into one."""
        skills = self.skills
        belief, observations = skills.world.objects[name], skills.observations.get(name, [])
        if not belief.recognised or len(observations) < 2:
            return
        joined: tuple[PoseHypothesis, ...] = yield self.compute(
            "pose_estimation", skills.multi_view.estimate, observations, [belief.model]
        )
        if joined and joined[0].confidence >= belief.confidence:
            best = joined[0]
            skills.world.objects[name] = replace(
                belief,
                pose=best.pose,
                confidence=best.confidence,
                position_std=best.position_std,
                yaw_set=best.yaw_set,
            )
