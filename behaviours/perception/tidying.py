"""Tidying: observed objects outside their region, and free places for them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from numpy.typing import NDArray

from behaviours.context import SkillContext
from behaviours.perception.beliefs import believe_surface
from behaviours.perception.surfaces import SURFACE_NOT_SEEN, UNKNOWN_SURFACE, find_surface, surface_region
from behaviours.skill import (
    Declaration,
    ErrorReporting,
    ObjectName,
    Skill,
    SkillCondition,
    SkillCoroutine,
    SkillFailure,
    SurfaceName,
)
from bestman_bt.engine import In, InOut, Out, SyncAction
from bestman_bt.messages import ObjectModel, Pose
from bestman_bt.messages.shapes import NonNegative

if TYPE_CHECKING:
    from bestman_bt.perception.detection.base import DetectedScene


SAME_PLACE = 0.08
"""Distance below which two positions count as the same, metres."""
BEFORE_BASE = 0.6
"""Best distance of a place in front of the base, metres."""
MAX_TILT = np.radians(10.0)
ON_SURFACE = 0.03
"""Height error, metres, within which an object counts as standing on a mapped surface."""


class RememberSeen(ErrorReporting, SyncAction):
    """Add the named objects with a believed place to the list of seen objects."""

    objects = In(list, "names of the objects that belong there")
    seen = InOut(list, "the list; created if missing", required=False)

    def on_tick(self) -> int:
        """Read the belief."""
        wanted: Sequence[str] = self.objects
        before: Sequence[str] = self.seen or ()
        beliefs = self.skills.world.objects.values()
        now = [belief.name for belief in beliefs if belief.name in wanted or belief.model.name in wanted]
        seen = list(dict.fromkeys([*before, *now]))
        self.seen = seen
        return self.succeed(", ".join(seen) or "nothing")


class _SeenInRegion(ErrorReporting):
    seen = In(list, "names of the objects seen so far")
    surface = In[str](SurfaceName, "the target surface, such as counter/top")
    region_x = In(list, "from, to: metres in the frame of the surface")
    region_y = In(list, "from, to: metres in the frame of the surface")
    margin = In[float](NonNegative, "metres inside the region", default=0.035)


class FindUntidy(_SeenInRegion, SyncAction):
    """List the seen objects that are not believed to stand upright within a region of a surface."""

    untidy = Out(list, "their names", required=True)
    FAILS: ClassVar = UNKNOWN_SURFACE

    def on_tick(self) -> int:
        """Read the belief."""
        untidy = _untidy(self)
        self.untidy = untidy
        return self.succeed(", ".join(untidy) or "nothing")


class IsTidy(_SeenInRegion, SkillCondition):
    """Check whether all seen objects are believed to stand upright within a region; false if none was seen."""

    FAILS: ClassVar = {
        **UNKNOWN_SURFACE,
        "nothing_seen": "ScanScene",
        "untidy": "FindUntidy, then pick and place each",
    }

    def check(self) -> tuple[str, str] | None:
        """Check the belief, without an image."""
        if not self.seen:
            return "nothing_seen", "none of the objects to tidy was seen"
        untidy = _untidy(self)
        if untidy:
            where = f"within the region on the {self.surface}"
            return "untidy", f"the {', the '.join(untidy)} {'do' if len(untidy) > 1 else 'does'} not stand {where}"
        return None


class FindFreePlace(Skill):
    """Look at a surface and choose a free place on it for an object, anywhere or within a region.

    It is the place nearest to the robot; each further call for the same object gives another one.
    """

    REQUIRES = ("camera",)
    object = In[str](ObjectName, "the object to place")
    surface = In[str](SurfaceName, "the surface, such as counter/top")
    region_x = In(list, "from, to: metres in its frame; all of it by default", required=False)
    region_y = In(list, "from, to: metres in its frame; all of it by default", required=False)
    margin = In[float](NonNegative, "metres inside the region", default=0.05)
    clearance = In[float](NonNegative, "metres around the object", default=0.04)
    goal = Out(Pose, "the place, in the map frame, z of the surface", required=True)
    FAILS: ClassVar = {
        **UNKNOWN_SURFACE,
        **SURFACE_NOT_SEEN,
        "unknown_object": "DetectObject first, or add a model",
        "surface_full": "another surface or region",
    }
    DECLARATION = Declaration(effects=("free({goal})",))

    def on_load(self) -> None:
        """Reset the given places."""
        self._object = ""
        self._given: list[NDArray[np.float64]] = []

    def execute(self) -> SkillCoroutine[None]:
        """Capture, measure the surface, and search for free space."""
        from bestman_bt.perception.segmentation.surface_coverage import surface_coverage

        skills = self.skills
        name: str = self.object
        surface: str = self.surface
        model = _model(skills, name)
        if name != self._object:
            self._object, self._given = name, []
        view = skills.camera.capture()
        region = surface_region(skills, surface, view)
        models = list(skills.world.models.values())
        scene: DetectedScene = yield self.compute(
            "detection", skills.detection.detect, view.in_base, region, models, skills.rng
        )
        believe_surface(skills, surface, view, scene)
        radius = float(np.linalg.norm(model.size[:2])) / 2 + self.clearance
        coverage = surface_coverage(view.in_base, region, scene.scene)
        discs = view.map_from_base.apply(coverage.free_discs(radius, np.array([BEFORE_BASE, 0.0])))
        furniture, mapped = find_surface(skills, surface)
        map_from_surface = furniture.pose.to_pose() @ mapped.pose
        inside = discs[_within(self, map_from_surface.inverse().apply(discs))]
        given = np.reshape(self._given, (-1, 3))[:, :2]
        fresh = [place for place in inside if (np.linalg.norm(given - place[:2], axis=1) > SAME_PLACE).all()]
        if not fresh:
            across = f"{200 * radius:.0f} cm disc for the {name}"
            where = f"on the {surface}" if self.region_x is None else f"in the region of the {surface}"
            raise SkillFailure("surface_full", f"no free {across} is left {where}")
        self._given.append(fresh[0])
        self.goal = Pose(fresh[0], map_from_surface.quaternion)
        self.feedback_message = f"place for the {name} at {fresh[0][0]:.2f}, {fresh[0][1]:.2f}"


def _model(skills: SkillContext, name: str) -> ObjectModel:
    held = {one.name: one.model for one in skills.world.hands.values()}
    belief = skills.world.objects.get(name)
    if name in held:
        return held[name]
    if belief is not None:
        return belief.model
    if name in skills.world.models:
        return skills.world.models[name]
    raise SkillFailure("unknown_object", f"no model of {name!r} and no detection with this label")


def _untidy(node: _SeenInRegion) -> list[str]:
    skills = node.skills
    furniture, surface = find_surface(skills, node.surface)
    surface_from_map = (furniture.pose.to_pose() @ surface.pose).inverse()

    def tidy(name: str) -> bool:
        belief = skills.world.objects.get(name)
        if belief is None or belief.pose.tilt > MAX_TILT:
            return False
        place = (surface_from_map @ belief.pose).position
        on_it = abs(place[2] + float(belief.model.bounds()[0, 2])) < ON_SURFACE
        return on_it and bool(_within(node, place[None])[0])

    return [name for name in node.seen if not tidy(name)]


def _within(node: _SeenInRegion | FindFreePlace, places: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return which (N,) of the places (N, 3) in the frame of the surface lie inside the region by the margin."""
    if node.region_x is None or node.region_y is None:
        return np.ones(len(places), dtype=bool)
    lower, upper = np.transpose((node.region_x, node.region_y))
    margin = node.margin
    within: NDArray[np.bool_] = ((places[:, :2] >= lower + margin) & (places[:, :2] <= upper - margin)).all(axis=1)
    return within
