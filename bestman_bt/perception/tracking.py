"""Tracking: assigns observations to believed objects, and detects moved, removed and added ones."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment
from typing_extensions import override

from bestman_bt.messages import ObjectModel, Pose, wrap_angle
from bestman_bt.perception.pose_estimation.model_surface import sample_shape
from bestman_bt.perception.pose_estimation.point_to_plane import model_yaw_observability
from bestman_bt.perception.view import View
from bestman_bt.world_model.world_model import ObjectBelief, ObjectChange

SPACING = 0.008
"""Metres between the samples of an object's surface."""


class Presence(Enum):
    """Whether an object is at its place. ``GONE``: the camera sees through it. ``HIDDEN``: the place is not visible.
    ``POSSIBLE``: neither.
    """

    POSSIBLE = "possible"
    HIDDEN = "hidden"
    GONE = "gone"


def presence(
    model: ObjectModel, frame_from_object: Pose, view: View, margin: float = 0.02, share: float = 0.5
) -> Presence:
    """Compare the expected depth of the object with the measured one.

    ``margin``: tolerance of depths, metres. ``share``: minimum visible fraction of the surface towards the camera and,
    for the object to be gone, minimum fraction of that part through which the camera sees.
    """
    points, normals = _surface(model, frame_from_object)
    facing = ((view.viewpoint - points) * normals).sum(axis=1) > 0.0
    pixels, depth = view.project(points[facing])
    measured = view.measured_depth(pixels)
    seen = np.isfinite(measured) & (measured > depth - margin)
    if len(depth) == 0 or seen.mean() < share:
        return Presence.HIDDEN
    through = measured[seen] > depth[seen] + margin
    return Presence.GONE if through.mean() > share else Presence.POSSIBLE


def _surface(model: ObjectModel, frame_from_object: Pose) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    samples = [(placed.pose, *sample_shape(placed.shape, SPACING)) for placed in model.visual or model.collision]
    points = np.concatenate([(frame_from_object @ pose).apply(points) for pose, points, _ in samples])
    normals = np.concatenate([normals @ (frame_from_object @ pose).rotation.T for pose, _, normals in samples])
    return points, normals


@dataclass(frozen=True, eq=False)
class Tracked:
    """The result of a tracker update. ``objects``: all beliefs after the view, by identity. ``changes``: detected
    changes.

    ``identities``: the identity of each sighting, in the given order.
    """

    objects: Mapping[str, ObjectBelief]
    changes: tuple[ObjectChange, ...]
    identities: tuple[str, ...]


class Tracker(ABC):
    """Keeps identities over views."""

    @abstractmethod
    def update(
        self,
        beliefs: Mapping[str, ObjectBelief],
        sightings: Sequence[ObjectBelief],
        view: View,
        drift: float = 0.0,
        taken: Sequence[str] = (),
    ) -> Tracked:
        """Assign the ``sightings`` of one view to ``beliefs``; both and ``view`` in the map frame.

        The name of a sighting is that of its model. ``drift``: standard deviation of the map's error between views,
        metres. ``taken``: identities that cannot be assigned, for example that of the held object.
        """


THING = "thing"
"""The name of objects without a model; their identities are ``thing_1``, ``thing_2``, …"""


@dataclass(frozen=True)
class GlobalNearestNeighbour(Tracker):
    """Assigns all sightings of a view to the known objects at once, at the minimum total distance.

    Munkres' assignment (Blackman, "Multiple-Target Tracking with Radar Applications", 1986); objects of different
    models are never exchanged, and an object that is hidden in the view is kept.

    ``moved_distance``: distance from which an object counts as moved; at least ``deviations`` standard deviations of
    the distance; ``moved_turn``: the same for rotations of objects with known yaw. ``thing_distance``: maximum distance
    at which an object without a model is recognised again. ``replaced_distance``: another object found this close to an
    object's place has taken its place.
    """

    moved_distance: Annotated[float, "m"] = 0.03
    moved_turn: Annotated[float, "rad"] = math.radians(25.0)
    deviations: float = 3.0
    thing_distance: Annotated[float, "m"] = 0.08
    replaced_distance: Annotated[float, "m"] = 0.04

    @override
    def update(
        self,
        beliefs: Mapping[str, ObjectBelief],
        sightings: Sequence[ObjectBelief],
        view: View,
        drift: float = 0.0,
        taken: Sequence[str] = (),
    ) -> Tracked:
        stamp = view.image.stamp
        objects = {name: belief for name, belief in beliefs.items() if name not in taken}
        matches = self._matches(objects, sightings, drift)
        unseen = [name for name in objects if name not in matches.values()]
        changes: list[ObjectChange] = []
        identities = []
        for index, sighting in enumerate(sightings):
            name = matches.get(index)
            if name is None:
                name = _new_name(sighting, {*objects, *taken})
                objects[name] = replace(sighting, name=name, since=sighting.stamp)
                changes.append(ObjectChange("added", name, stamp, after=sighting.pose))
            else:
                before = objects[name]
                moved = self._moved(before, sighting, drift)
                objects[name] = _seen_again(before, sighting, moved)
                if moved:
                    changes.append(ObjectChange("moved", name, stamp, before.pose, sighting.pose))
            identities.append(name)
        for name in unseen:
            kind = self._contradiction(objects[name], sightings, view)
            if kind is not None:
                changes.append(ObjectChange(kind, name, stamp, before=objects.pop(name).pose))
        return Tracked(objects, tuple(changes), tuple(identities))

    def _matches(
        self, objects: Mapping[str, ObjectBelief], sightings: Sequence[ObjectBelief], drift: float
    ) -> dict[int, str]:
        """Return the index of a sighting → identity. Known objects are recognised at any distance, others only nearby.

        The matching keeps as many objects as possible in place: of two cans in line, one that was carried past the
        other has moved, and not both.
        """
        names = list(objects)
        impossible, stays = 1e6, -1e3
        costs = np.full((len(sightings), len(names)), impossible)
        for i, sighting in enumerate(sightings):
            for j, name in enumerate(names):
                belief = objects[name]
                if belief.recognised != sighting.recognised:
                    continue
                distance = float(np.linalg.norm(belief.pose.position - sighting.pose.position))
                same = belief.model.name == sighting.model.name if belief.recognised else self._alike(belief, sighting)
                if same and (belief.recognised or distance < self.thing_distance):
                    costs[i, j] = distance + (stays if distance <= self._gate(belief, sighting, drift) else 0.0)
        rows, columns = linear_sum_assignment(costs)
        return {int(i): names[j] for i, j in zip(rows, columns, strict=True) if costs[i, j] < impossible}

    def _alike(self, belief: ObjectBelief, sighting: ObjectBelief) -> bool:
        """Return whether two may be the same object: the boxes of one differ between views, its label does not."""
        if belief.model.name != sighting.model.name:
            return False
        sizes = [np.sort(thing.model.size) for thing in (belief, sighting)]
        return bool(np.abs(sizes[0] - sizes[1]).max() < self.thing_distance)

    def _gate(self, before: ObjectBelief, sighting: ObjectBelief, drift: float) -> float:
        """Return the distance, metres, up to which an object counts as unmoved."""
        deviation = math.sqrt(before.position_std**2 + sighting.position_std**2 + 2 * drift**2)
        return max(self.moved_distance, self.deviations * deviation)

    def _moved(self, before: ObjectBelief, sighting: ObjectBelief, drift: float) -> bool:
        there = sighting.pose
        if before.recognised and before.model.symmetry_order:
            turned = all(
                abs(wrap_angle(middle - other)) - half - other_half > self.moved_turn
                for middle, half in _with_symmetry(before)
                for other, other_half in sighting.yaw_set.arcs or ((sighting.pose.yaw, 0.0),)
            )
            if turned:
                return True
            there = at_yaw(sighting, before.pose.yaw)
        distance = float(np.linalg.norm(before.pose.position - there.position))
        return distance > self._gate(before, sighting, drift)

    def _contradiction(
        self, belief: ObjectBelief, sightings: Sequence[ObjectBelief], view: View
    ) -> Literal["removed", "replaced"] | None:
        for other in sightings:
            x, y, z = belief.pose.position - other.pose.position
            # On another board of a shelf it takes no place away.
            same_height = abs(z) < (belief.model.size[2] + other.model.size[2]) / 2
            if same_height and math.hypot(x, y) < self.replaced_distance:
                return "replaced"
        return "removed" if presence(belief.model, belief.pose, view) is Presence.GONE else None


def _seen_again(before: ObjectBelief, sighting: ObjectBelief, moved: bool) -> ObjectBelief:
    """Return the new sighting; a yaw that was known better before is kept while the object has not moved."""
    since = sighting.stamp if moved else before.since
    known_better = not moved and before.yaw_set.arcs and before.yaw_set.width < sighting.yaw_set.width
    if not known_better:
        return replace(sighting, name=before.name, since=since)
    pose = at_yaw(sighting, before.pose.yaw)
    return replace(sighting, name=before.name, pose=pose, yaw_set=before.yaw_set, since=since)


def at_yaw(sighting: ObjectBelief, yaw: float) -> Pose:
    """Return the pose of the observed object for the yaw ``yaw``, radians. For models without symmetry, the part that
    looks the same at both yaws stays in place: the body of a mug, not its origin, which is between body and handle.
    """
    seen = Pose.from_xyz_rpy((0.0, 0.0, 0.0), (0.0, 0.0, sighting.pose.yaw))
    turn = Pose.from_xyz_rpy((0.0, 0.0, 0.0), (0.0, 0.0, yaw - sighting.pose.yaw))
    position = sighting.pose.position
    if sighting.model.symmetry_order == 1:
        shift = model_yaw_observability(sighting.model).shift(np.array([yaw - sighting.pose.yaw]))[0]
        position = position + seen.apply(np.array([*shift, 0.0]))
    return Pose(position, (turn @ Pose(np.zeros(3), sighting.pose.quaternion)).quaternion)


def _with_symmetry(belief: ObjectBelief) -> list[tuple[float, float]]:
    turns = [2 * math.pi * i / belief.model.symmetry_order for i in range(belief.model.symmetry_order)]
    arcs = belief.yaw_set.arcs or ((belief.pose.yaw, 0.0),)
    return [(wrap_angle(middle + turn), half) for middle, half in arcs for turn in turns]


def _new_name(sighting: ObjectBelief, known: set[str]) -> str:
    if sighting.name != THING and sighting.name not in known:
        return sighting.name
    number = 1 if sighting.name == THING else 2
    while f"{sighting.name}_{number}" in known:
        number += 1
    return f"{sighting.name}_{number}"
