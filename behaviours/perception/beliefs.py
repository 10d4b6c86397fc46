"""From views to beliefs: identities, unknown objects, measured surfaces."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from behaviours.context import SkillContext
from behaviours.perception.surfaces import UNKNOWN_SURFACE, measured_surface, surface_obstacle
from behaviours.skill import Declaration, InstantSkill, ObjectName, SkillFailure, SurfaceName
from bestman_bt.engine import In
from bestman_bt.messages import Box, ObjectModel, PlacedShape, PointCloud, Pose
from bestman_bt.messages.shapes import NonNegative
from bestman_bt.world_model.world_model import ObjectBelief

if TYPE_CHECKING:
    from bestman_bt.control.rgbd import RGBDView
    from bestman_bt.perception.detection.base import DetectedScene, Detection
    from bestman_bt.perception.pose_estimation.multi_view import ViewObservation
    from bestman_bt.perception.segmentation.base import Cluster


class BelieveObject(InstantSkill):
    """Believe that an object stands at a pose, for example in a fixture or as reported by another robot.

    If a surface is named, its height is set to the object's lowest point.
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
        """Set the belief without taking an image."""
        world, name = self.skills.world, self.object
        model = world.models.get(name)
        if model is None:
            raise SkillFailure("unknown_object", f"no model of {name!r}; known: {', '.join(world.models)}")
        pose, surface = self.pose, self.surface
        if surface:
            lowest = float(pose.position[2] + (pose.rotation[2] * model.bounds()).min(axis=0).sum())
            world.obstacles[f"{surface}/surface"] = surface_obstacle(self.skills, surface, lowest)
        world.objects[name] = ObjectBelief(
            name=name,
            model=model,
            pose=pose,
            confidence=1.0,
            position_std=self.position_std,
            stamp=self.skills.clock.now(),
            surface=surface or None,
        )


REMEMBERED_VIEWS = 4
"""Number of stored views of an object, to be fused with the next one."""
MAP_ERROR = 0.03
"""Largest displacement of furniture from its mapped place, metres."""
THING_STD = 0.003
"""Standard deviation of the middle of a measured box, metres."""
THING_DENSITY = 400.0
"""kg/m³, density of an object without a model."""


def believe_surface(skills: SkillContext, surface: str, view: RGBDView, scene: DetectedScene) -> tuple[str, ...]:
    """Add a measured surface and the objects on it to the belief. Returns their identities, as ``believe_objects``
    does."""
    skills.world.obstacles[f"{surface}/surface"] = measured_surface(skills, surface, view, scene.plane)
    return believe_objects(skills, view, scene, surface)


def believe_objects(
    skills: SkillContext, view: RGBDView, scene: DetectedScene, surface: str | None = None
) -> tuple[str, ...]:
    """Match the observations with the belief; returns the identities: of the detections, then of the unknown
    objects.
    """
    from bestman_bt.perception.pose_estimation.multi_view import ViewObservation

    world = skills.world
    things = [cluster for cluster in scene.unknown if not _part_of_furniture(skills, view, cluster, surface)]
    clusters = [*(found.cluster for found in scene.detections), *things]
    sightings = [_sighting(view, found, surface) for found in scene.detections]
    models = {model.name for model in world.models.values()}
    sightings += [believed_thing(view, cluster, surface, models) for cluster in things]
    tracked = skills.tracking.update(
        world.objects,
        sightings,
        view.in_map,
        drift=world.base.position_std,
        taken=[held.name for held in world.hands.values()],
    )
    world.objects = dict(tracked.objects)
    world.changes += tracked.changes
    for change in tracked.changes:
        skills.observations.pop(change.name, None)
    for name, cluster in zip(tracked.identities, clusters, strict=True):
        remember_view(skills, name, ViewObservation(cluster.seen_from(view.map_from_base), view.in_map))
    return tracked.identities


def remember_view(skills: SkillContext, name: str, observation: ViewObservation) -> None:
    """Store an observation of an object, in the map frame, to be fused with other views."""
    skills.observations[name] = [*skills.observations.get(name, []), observation][-REMEMBERED_VIEWS:]


def only_nearest(scene: DetectedScene, belief: ObjectBelief, base_from_object: Pose) -> DetectedScene:
    """Return the scene reduced to the observation of the believed object: of its model, nearest to its place."""
    if belief.recognised:
        same = [found for found in scene.detections if found.name == belief.model.name]
        same.sort(key=lambda found: float(np.linalg.norm(found.pose.position - base_from_object.position)))
        return replace(scene, detections=tuple(same[:1]), unknown=())
    things = sorted(
        scene.unknown,
        key=lambda cluster: float(np.linalg.norm(cluster.bounding_box.pose.position - base_from_object.position)),
    )
    return replace(scene, detections=(), unknown=tuple(things[:1]))


def seen_words(scene: DetectedScene) -> str:
    """Return the observations as text for an error message."""
    from bestman_bt.perception.detection.base import LabelledCluster

    seen = [f"{found.name} ({found.confidence:.2f}{score_words(found.score)})" for found in scene.detections]
    named = [thing for thing in scene.unknown if isinstance(thing, LabelledCluster)]
    seen += [f"{thing.label} (no pose{score_words(thing.score)})" for thing in named]
    nameless = len(scene.unknown) - len(named)
    if nameless:
        seen.append(f"{nameless} unknown thing{'s' if nameless > 1 else ''}")
    return "seen " + ", ".join(seen) if seen else "it is empty"


def score_words(score: float | None) -> str:
    """Return the detector's score as text, ``, score 0.80``; empty without one."""
    return "" if score is None else f", score {score:.2f}"


def _part_of_furniture(skills: SkillContext, view: RGBDView, cluster: Cluster, surface: str | None) -> bool:
    """Return whether the map explains a cluster: it lies within furniture other than that which it was searched on."""
    known = skills.world.map
    searched = surface.partition("/")[0] if surface is not None else None
    place = (view.map_from_base @ cluster.bounding_box.pose).position
    for name, piece in known.furniture.items():
        if name != searched and piece.covers(place[:2], MAP_ERROR):
            under = known.standing_under(name)
            floor = under.height if under is not None else 0.0
            if floor - MAP_ERROR < place[2] < piece.height + MAP_ERROR:
                return True
    return False


def _sighting(view: RGBDView, found: Detection, surface: str | None) -> ObjectBelief:
    hypothesis = found.hypothesis
    return ObjectBelief(
        name=found.name,
        model=hypothesis.model,
        pose=view.map_from_base @ hypothesis.pose,
        confidence=hypothesis.confidence,
        position_std=hypothesis.position_std,
        stamp=view.stamp,
        surface=surface,
        yaw_set=hypothesis.yaw_set.turned(view.map_from_base.yaw),
        score=found.score,
    )


def believed_thing(view: RGBDView, cluster: Cluster, surface: str | None, models: Collection[str]) -> ObjectBelief:
    """Return the belief of an object without a model, named by the detector's label if any; its model is its bounding
    box.

    ``models``: names of the known models. An object with such a label whose model was not fitted has confidence 0.
    """
    from bestman_bt.perception.detection.base import LabelledCluster
    from bestman_bt.perception.tracking import THING

    name, score = (cluster.label, cluster.score) if isinstance(cluster, LabelledCluster) else (THING, None)
    placed = cluster.bounding_box
    assert isinstance(placed.shape, Box)
    red, green, blue = (float(value) for value in cluster.colors.mean(axis=0) / 255.0)
    mass = THING_DENSITY * float(np.prod(placed.shape.size))
    model = ObjectModel(name, (red, green, blue), mass, 0.5, (PlacedShape(placed.shape, Pose()),), symmetry_order=2)
    return ObjectBelief(
        name=name,
        model=model,
        pose=view.map_from_base @ placed.pose,
        confidence=0.0 if name in models else 1.0,
        position_std=THING_STD,
        stamp=view.stamp,
        surface=surface,
        recognised=False,
        cloud=PointCloud(view.map_from_base.apply(cluster.points), cluster.colors),
        viewpoint=view.in_map.viewpoint,
        score=score,
    )
