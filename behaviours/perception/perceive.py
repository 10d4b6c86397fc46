"""Perception of the objects on a surface, and of their exact poses."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from behaviours.context import SkillContext
from behaviours.perception.beliefs import believe_objects, believe_surface, only_nearest, score_words, seen_words
from behaviours.perception.surfaces import SURFACE_NOT_SEEN, UNKNOWN_SURFACE, surface_region
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
from bestman_bt.engine import In, Out, SyncAction
from bestman_bt.messages import Pose, wrap_angle
from bestman_bt.messages.shapes import Fraction, NonNegative, Positive
from bestman_bt.world_model.world_model import ObjectBelief

if TYPE_CHECKING:
    from bestman_bt.control.rgbd import RGBDSensor, RGBDView
    from bestman_bt.perception.detection.base import DetectedScene
    from bestman_bt.perception.segmentation.base import Region


class BelievedSurface(ErrorReporting, SyncAction):
    """Output the surface on which an object is believed to stand, or a default if it has not been seen."""

    object = In[str](ObjectName, "the object")
    otherwise = In[str](SurfaceName, "the surface to search first")
    surface = Out(str, "the surface", required=True)

    def on_tick(self) -> int:
        """Read the belief."""
        belief = self.skills.world.objects.get(self.object)
        known = belief.surface if belief is not None else None
        self.surface = known or self.otherwise
        return self.succeed()


class ObjectVisible(SkillCondition):
    """Check whether an object was seen recently."""

    object = In[str](ObjectName, "the object")
    max_age = In[float](NonNegative, "seconds", default=5.0)
    FAILS: ClassVar = {"not_visible": "DetectObject, or ScanScene"}

    def check(self) -> tuple[str, str] | None:
        """Check the belief, without an image."""
        name: str = self.object
        belief = self.skills.world.objects.get(name)
        if belief is None:
            return "not_visible", f"the {name} has not been seen"
        age = self.skills.clock.now() - belief.stamp
        if age > self.max_age:
            return "not_visible", f"the {name} was last seen {age:.1f} s ago"
        return None


class ObjectAt(SkillCondition):
    """Check whether an object, as last seen, stands upright at a goal."""

    object = In[str](ObjectName, "the object")
    goal = In(Pose, "target pose, in the map frame")
    tolerance = In[float](Positive, "metres, horizontally", default=0.02)
    yaw_tolerance = In[float | None](Positive, "radians; any yaw without it", required=False)
    FAILS: ClassVar = {"not_at_goal": "DetectObject, PlanGrasp, Grasp, then PlaceOn"}

    def check(self) -> tuple[str, str] | None:
        """Check the belief, without an image."""
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
    """Return the difference of two yaws, radians, modulo rotations by 2π/``symmetry_order``; 0 for order 0."""
    if symmetry_order == 0:
        return 0.0
    return abs(wrap_angle((yaw - other) * symmetry_order)) / symmetry_order


NO_CAMERA = {"no_camera": "a robot that has the camera"}


class DetectObjects(Skill):
    """Look at a surface through a camera; add the seen objects and the height of the surface to the belief."""

    REQUIRES = ("camera",)
    USES = ("wrist_camera",)
    surface = In[str](SurfaceName, "the surface to look at, such as table")
    camera = In(str, "head, wrist, or its name", default="head")
    objects = Out(list, "names of the seen objects")
    FAILS: ClassVar = {
        **UNKNOWN_SURFACE,
        **SURFACE_NOT_SEEN,
        **NO_CAMERA,
    }
    DECLARATION = Declaration(effects=("scanned({surface})",))

    def execute(self) -> SkillCoroutine[None]:
        """Capture an image, detect objects, and update the belief."""
        view, scene = yield from _look(self)
        names = believe_surface(self.skills, self.surface, view, scene)
        self.objects = list(names)
        believed = self.skills.world.objects
        scores = [score_words(believed[name].score if name in believed else None) for name in names]
        texts = (f"{name} ({score[2:]})" if score else name for name, score in zip(names, scores, strict=True))
        self.feedback_message = ", ".join(texts) or "nothing"


class DetectObject(Skill):
    """Look at a surface through a camera and update the belief; fail if the object is not seen."""

    REQUIRES = ("camera",)
    USES = ("wrist_camera",)
    object = In[str](ObjectName, "the object to find")
    surface = In[str](SurfaceName, "the surface to search, such as table")
    min_confidence = In[float](Fraction, "of the pose", default=0.5)
    camera = In(str, "head, wrist, or its name", default="head")
    pose = Out(Pose, "where the object is, in the map frame")
    yaw_width = Out(float, "remaining yaw uncertainty, radians")
    score = Out(float, "the detector's own, 0 to 1, if it gives one")
    FAILS: ClassVar = {
        **UNKNOWN_SURFACE,
        **SURFACE_NOT_SEEN,
        **NO_CAMERA,
        "unknown_object": "add a model of it, or ScanScene for things without one",
        "not_found": "look elsewhere: ScanScene, or another surface",
    }
    DECLARATION = Declaration(effects=("visible({object})",))

    def execute(self) -> SkillCoroutine[None]:
        """Capture an image, detect the object, and update the belief."""
        skills = self.skills
        name: str = self.object
        surface: str = self.surface
        view, scene = yield from _look(self)
        believe_surface(skills, surface, view, scene)
        belief = skills.world.objects.get(name)
        if belief is None and name not in skills.world.models:
            # It may be a word that an open-vocabulary detector understands, so it is looked for all the same.
            known = ", ".join(sorted(skills.world.models)) or "none"
            raise SkillFailure(
                "unknown_object", f"unknown object {name!r}: no model, and no detection has this label; models: {known}"
            )
        if belief is None or belief.stamp < view.stamp or belief.confidence < self.min_confidence:
            raise SkillFailure("not_found", f"no {name} on the {surface}: {seen_words(scene)}")
        self.pose = belief.pose
        self.yaw_width = belief.yaw_set.width
        if belief.score is not None:
            self.score = belief.score
        how = f"with confidence {belief.confidence:.2f}" if belief.recognised else "by its measured box, no model fits"
        self.feedback_message = f"{name} {how}{score_words(belief.score)}"


def _look(leaf: DetectObject | DetectObjects) -> SkillCoroutine[tuple[RGBDView, DetectedScene]]:
    """Capture an image with the camera of the leaf; return it with the objects on its surface."""
    skills = leaf.skills
    view = camera_called(skills, leaf.camera).capture()
    region = surface_region(skills, leaf.surface, view)
    models = list(skills.world.models.values())
    detect = skills.detection.detect
    scene: DetectedScene = yield leaf.compute("detection", detect, view.in_base, region, models, skills.rng)
    return view, scene


class EstimatePose(Skill):
    """Look closer at a seen object: one more image, only its model, a more accurate pose."""

    REQUIRES = ("camera",)
    USES = ("wrist_camera",)
    object = In[str](ObjectName, "an object that was detected")
    min_confidence = In[float](Fraction, "of the pose", default=0.5)
    camera = In(str, "head, wrist, or its name", default="head")
    pose = Out(Pose, "where the object is, in the map frame")
    yaw_width = Out(float, "remaining yaw uncertainty, radians")
    FAILS: ClassVar = {
        **UNKNOWN_SURFACE,
        **SURFACE_NOT_SEEN,
        **NO_CAMERA,
        "not_found": "DetectObject first",
        "object_lost": "it has moved or is hidden: DetectObject",
    }
    DECLARATION = Declaration(pre=("visible({object})",), effects=("located({object})",))

    def execute(self) -> SkillCoroutine[None]:
        """Capture an image of the believed place and register the object's own model."""
        skills = self.skills
        name: str = self.object
        belief = skills.world.objects.get(name)
        if belief is None:
            raise SkillFailure("not_found", f"the {name} has not been seen; detect it first")
        view = camera_called(skills, self.camera).capture()
        base_from_object = view.map_from_base.inverse() @ belief.pose
        region = self._region(belief, base_from_object, view)
        detect = skills.detection.detect
        scene: DetectedScene = yield self.compute(
            "pose_estimation", detect, view.in_base, region, list(skills.world.models.values()), skills.rng
        )
        believe_objects(skills, view, only_nearest(scene, belief, base_from_object), belief.surface)
        refined = skills.world.objects.get(name)
        if refined is None or refined.stamp < view.stamp or refined.confidence < self.min_confidence:
            raise SkillFailure("object_lost", f"no {name} where it was seen: {seen_words(scene)}")
        self.pose = refined.pose
        self.yaw_width = refined.yaw_set.width
        yaw = f", yaw open by {math.degrees(refined.yaw_set.width):.0f}°" if refined.yaw_set.arcs else ""
        self.feedback_message = f"{name} to ±{1e3 * refined.position_std:.1f} mm{yaw}"

    def _region(self, belief: ObjectBelief, base_from_object: Pose, view: RGBDView) -> Region:
        """Return the region around the object; within furniture, where walls and boards are near, that
        of its surface.
        """
        world = self.skills.world
        if belief.surface is not None:
            furniture, surface = world.surface(belief.surface)
            if furniture.is_inside(surface):
                return surface_region(self.skills, belief.surface, view)
        return region_around(base_from_object, float(belief.model.size[2]))


def region_around(base_from_object: Pose, height: float) -> Region:
    """Return a square of half a metre around an upright object of ``height`` metres, in the base frame."""
    from bestman_bt.perception.segmentation.base import Region

    foot = base_from_object.position - [0.0, 0.0, height / 2]
    return Region(Pose(foot), (0.5, 0.5))


def camera_called(skills: SkillContext, name: str) -> RGBDSensor:
    """Return the camera on the ``head`` or ``wrist``, or the camera with this name. Raises SkillFailure if there is
    none.
    """
    if name == "head":
        return skills.camera
    camera = skills.wrist_camera if name == "wrist" else None
    if name in skills.kinds.get("camera", ()):
        camera = next((one for one in skills.cameras if one.name == name), None)
    if camera is None:
        there = ", ".join(skills.kinds.get("camera", ())) or "none"
        raise SkillFailure(
            "no_camera", f"the robot {skills.robot.name} has no camera {name!r} to look with; it has {there}"
        )
    return camera
