"""Perceiving: which objects stand on a surface, and exactly where."""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar

import numpy as np
from py_trees.ports import PortInformation

from behaviours.context import SkillContext
from behaviours.skill import Declaration, Explained, Skill, SkillCondition, SkillFailure, Steps
from behaviours.surfaces import measured_surface, surface_region
from bestman_bt.engine import SyncAction
from bestman_bt.messages import PlacedShape, Pose
from bestman_bt.perception.detection import DetectedScene, Detection
from bestman_bt.perception.segmentation import Region
from bestman_bt.sensing.rgbd import RGBDView
from bestman_bt.world_model import ObjectBelief, Obstacle


class DetectObject(Skill):
    """Look at a surface through the head camera; believe in what is seen there; fail if the object is not."""

    INPUT_PORTS: ClassVar = {
        "object": PortInformation(str, description="the object to find"),
        "surface": PortInformation(str, description="the surface to search, such as table"),
        "min_confidence": PortInformation(float, required=False, default_value=0.5, description="0 to 1"),
    }
    OUTPUT_PORTS: ClassVar = {
        "pose": PortInformation(Pose, required=False, description="where the object is, in the map frame")
    }
    DECLARATION = Declaration(effects=("visible({object})",))

    def execute(self) -> Steps:
        """Capture, detect, believe."""
        skills = self.skills
        name: str = self.get_input("object")
        surface: str = self.get_input("surface")
        if name not in skills.world.models:
            known = ", ".join(sorted(skills.world.models)) or "none"
            raise SkillFailure("unknown_object", f"no model of {name!r}; known objects: {known}")
        view = skills.camera.capture()
        region = surface_region(skills, surface)
        models = list(skills.world.models.values())
        detect = skills.algorithms.detection.detect
        scene: DetectedScene = yield self.compute("detection", detect, view.in_base, region, models, skills.rng)
        believe_surface(skills, surface, view, scene)
        found = scene.find(name)
        if found is None or found.confidence < self.get_input("min_confidence"):
            skills.world.objects.pop(name, None)
            raise SkillFailure("object_not_found", f"no {name} on the {surface}: {_seen(scene)}")
        self.set_output("pose", skills.world.objects[name].pose)
        self.feedback_message = f"{name} with confidence {found.confidence:.2f}"


class EstimatePose(Skill):
    """Look closer at an object that was seen: one more image, one model, a better pose."""

    INPUT_PORTS: ClassVar = {
        "object": PortInformation(str, description="an object that was detected"),
        "min_confidence": PortInformation(float, required=False, default_value=0.5, description="0 to 1"),
    }
    OUTPUT_PORTS: ClassVar = {
        "pose": PortInformation(Pose, required=False, description="where the object is, in the map frame")
    }
    DECLARATION = Declaration(pre=("visible({object})",), effects=("located({object})",))

    def execute(self) -> Steps:
        """Capture around the believed place and register the object's own model."""
        skills = self.skills
        name: str = self.get_input("object")
        belief = skills.world.objects.get(name)
        if belief is None:
            raise SkillFailure("object_not_found", f"the {name} has not been seen; detect it first")
        view = skills.camera.capture()
        base_from_object = view.map_from_base.inverse() @ belief.pose
        foot = base_from_object.position - [0.0, 0.0, belief.model.size[2] / 2]
        region = Region(Pose(foot), (0.5, 0.5))
        detect = skills.algorithms.detection.detect
        scene: DetectedScene = yield self.compute(
            "pose_estimation", detect, view.in_base, region, list(skills.world.models.values()), skills.rng
        )
        found = scene.find(name)
        if found is None or found.confidence < self.get_input("min_confidence"):
            raise SkillFailure("object_lost", f"no {name} where it was seen: {_seen(scene)}")
        refined = _belief(view, found, belief.surface)
        skills.world.objects[name] = refined
        self.set_output("pose", refined.pose)
        self.feedback_message = f"{name} to ±{1e3 * refined.position_std:.1f} mm"


class BelievedSurface(Explained, SyncAction):
    """Tell on which surface an object is believed to stand; another one where it has not been seen."""

    INPUT_PORTS: ClassVar = {
        "object": PortInformation(str, description="the object"),
        "otherwise": PortInformation(str, description="the surface to search first"),
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
        "object": PortInformation(str, description="the object"),
        "max_age": PortInformation(float, required=False, default_value=5.0, description="seconds"),
    }

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
        "object": PortInformation(str, description="the object"),
        "goal": PortInformation(Pose, description="where it should be, in the map frame"),
        "tolerance": PortInformation(float, required=False, default_value=0.02, description="metres, horizontally"),
    }

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
        return None


def _belief(view: RGBDView, found: Detection, surface: str | None) -> ObjectBelief:
    hypothesis = found.hypothesis
    return ObjectBelief(
        name=found.name,
        model=hypothesis.model,
        pose=view.map_from_base @ hypothesis.pose,
        confidence=hypothesis.confidence,
        position_std=hypothesis.position_std,
        stamp=view.stamp,
        surface=surface,
    )


def believe_surface(skills: SkillContext, surface: str, view: RGBDView, scene: DetectedScene) -> None:
    """Replace all that was believed of a surface by what was seen there."""
    world = skills.world
    for name in [name for name, belief in world.objects.items() if belief.surface == surface]:
        del world.objects[name]
    for name in [name for name in world.obstacles if name.startswith(f"{surface}/")]:
        del world.obstacles[name]
    world.obstacles[f"{surface}/surface"] = measured_surface(skills, surface, view, scene.plane)
    named = {world.held.name} if world.held is not None else set()
    for found in scene.detections:
        if found.name not in named:
            world.objects[found.name] = _belief(view, found, surface)
            named.add(found.name)
        else:
            world.obstacles[f"{surface}/{found.name}"] = _obstacle(
                surface, found.name, view, found.cluster.bounding_box
            )
    for number, cluster in enumerate(scene.unknown):
        world.obstacles[f"{surface}/unknown{number}"] = _obstacle(
            surface, f"unknown{number}", view, cluster.bounding_box
        )


def _obstacle(surface: str, name: str, view: RGBDView, box: PlacedShape) -> Obstacle:
    placed = replace(box, pose=view.map_from_base @ box.pose)
    return Obstacle(f"{surface}/{name}", (placed,), view.stamp)


def _seen(scene: DetectedScene) -> str:
    seen = [f"{found.name} ({found.confidence:.2f})" for found in scene.detections]
    if scene.unknown:
        seen.append(f"{len(scene.unknown)} unknown thing{'s' if len(scene.unknown) > 1 else ''}")
    return "seen " + ", ".join(seen) if seen else "it is empty"
