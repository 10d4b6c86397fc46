"""Detection of the handles of doors and drawers."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, ClassVar

import numpy as np

from behaviours.furniture.articulation import UNKNOWN_ARTICULATION, FurnitureArticulation, find_articulation
from behaviours.furniture.articulation_measurement import (
    SHUT,
    believe_place,
    believe_shut_fronts,
    bodies_around,
    opening_by_board,
    opening_by_rays,
    opening_seen,
    opening_since,
)
from behaviours.skill import ArticulationName, Declaration, FurnitureName, Skill, SkillCoroutine, SkillFailure
from bestman_bt.engine import In, OneOf, Out
from bestman_bt.messages import Handle, Pose
from bestman_bt.messages.shapes import Fraction
from bestman_bt.world_model.semantic_map import MapFurniture
from bestman_bt.world_model.world_model import HandleBelief

if TYPE_CHECKING:
    from bestman_bt.perception.affordance.front_handles import HandleScene
    from bestman_bt.perception.segmentation.base import SupportPlane
    from bestman_bt.perception.view import View


MAP_MARGIN = 0.10
"""Metres around mapped furniture within which its handles may be: the map has errors, handles protrude."""
SAME_HANDLE = 0.05
"""Maximum distance between the axes of a detected handle and a known one that count as the same, metres."""
JointKind = Annotated[str, OneOf(lambda: ("revolute", "prismatic"))]


class DetectHandle(Skill):
    """Detect handles with the head camera, on one piece of furniture or anywhere; fail if there are none.

    All detected handles enter the belief; the output is the one nearest to ``near``, else the most certain. With
    ``articulation``, its opening is also measured and believed. If no handle on it is seen, the skill fails, but first
    measures the opening by the plane of the board or, if no plane is found and the depth image shows points behind the
    believed place of the board, roughly by the depth image.
    """

    REQUIRES = ("camera",)
    furniture = In[str | None](FurnitureName, "furniture of the map, such as fridge", required=False)
    articulation = In[str | None](ArticulationName, "only on this door or drawer, furniture/name", required=False)
    near = In(Pose, "choose the handle nearest to this, map frame", required=False)
    joint = In[str | None](JointKind, "only handles of a revolute or a prismatic joint", required=False)
    min_confidence = In[float](Fraction, "of the handle", default=0.5)
    handle = Out(str, "name of the handle in the belief")
    pose = Out(Pose, "pose of the handle, in the map frame")
    count = Out(int, "number of detected handles")
    opening = Out(float, "how far the articulation is open, metres or radians")
    FAILS: ClassVar = {
        **UNKNOWN_ARTICULATION,
        "handle_not_found": "look from elsewhere: FindLookStand, NavigateTo, LookAt",
        "unknown_furniture": "name furniture of the map",
    }
    DECLARATION = Declaration(effects=("handle_known({furniture})",))

    def execute(self) -> SkillCoroutine[None]:
        """Capture, detect, update the belief, choose."""
        skills = self.skills
        furniture = self._furniture()
        view = skills.camera.capture()
        scene: HandleScene = yield self.compute("handle_detection", skills.affordance.detect, view.in_base, skills.rng)
        seen = [handle.seen_from(view.map_from_base) for handle in scene.handles]
        articulation: str = self.articulation or ""
        if articulation:
            # Neighbouring fronts show better than an unmeasured map whether a door is shut.
            closed = skills.world.articulations.get(articulation) == 0.0
            believe_shut_fronts(skills.world, find_articulation(skills, articulation).furniture.name, seen, closed)
            door = find_articulation(skills, articulation)
            seen = self._on_door(door, seen)
            if not seen:
                fronts = [front.seen_from(view.map_from_base) for front in scene.fronts]
                yield from self._believe_board(door, fronts, view.in_map)
        names = [self._believe(handle, view.stamp) for handle in seen]
        chosen = [name for name in dict.fromkeys(names) if self._wanted(skills.world.handles[name], furniture)]
        for name in chosen:
            if (on := skills.world.handles[name].furniture) is not None:
                believe_place(skills.world, on, skills.world.handles[name].handle)
        self.count = len(chosen)
        if not chosen:
            on = articulation or (furniture.name if furniture is not None else "")
            where = f" on the {on}" if on else ""
            why = scene.reason or f"{len(scene.handles)} handles in view, none of them as asked"
            raise SkillFailure("handle_not_found", f"no handle{where}: {why}")
        best = min(chosen, key=lambda name: self._rank(skills.world.handles[name].handle))
        self.handle = best
        self.pose = skills.world.handles[best].handle.pose
        self.feedback_message = f"{best}: {skills.world.handles[best].handle.kind}, {len(chosen)} in all"

    def _on_door(self, door: FurnitureArticulation, seen: list[Handle]) -> list[Handle]:
        """Return the handles on a door or drawer; its opening is estimated from the one of the highest confidence."""
        skills = self.skills
        openings = [(handle, opening_seen(door, handle)) for handle in seen]
        found = [(handle, opening) for handle, opening in openings if opening is not None]
        if found:
            handle, opening = max(found, key=lambda entry: entry[0].confidence)
            believed = skills.world.articulations.get(door.name, 0.0)
            # A handle that was pushed shut unseen has its place from the map, and is no further evidence.
            for known in skills.world.handles_of(door.furniture, door.articulation) if believed > 0.0 else ():
                since = opening_since(door, believed, known.handle, handle)
                opening = opening if since is None else since
            skills.world.believe_articulation(door.name, opening)
            self.opening = opening
        return [handle for handle, _ in found]

    def _believe_board(
        self, door: FurnitureArticulation, fronts: list[SupportPlane], view: View
    ) -> SkillCoroutine[None]:
        """Believe that an articulation is open if its front is farther from closed than the map's error explains."""
        world = self.skills.world
        believed = world.articulations.get(door.name, 0.0)
        openings = [opening for front in fronts if (opening := opening_by_board(door, front)) is not None]
        if openings:
            opening = openings[0]  # the largest plane goes first
        else:
            known = bodies_around(world, door)
            explaining: float | None = yield self.compute(
                "opening_by_rays", opening_by_rays, door, believed, view, known
            )
            if explaining is None:
                return
            opening = explaining
        if abs(opening - believed) > SHUT[door.articulation.kind]:
            world.believe_articulation(door.name, opening)
        self.opening = opening

    def _furniture(self) -> MapFurniture | None:
        name = self.furniture
        known = self.skills.world.map.furniture
        if name and name not in known:
            raise SkillFailure("unknown_furniture", f"no furniture {name!r} in the map; known: {', '.join(known)}")
        return known[name] if name else None

    def _believe(self, handle: Handle, stamp: float) -> str:
        """Store the handle; one that was seen before keeps its name."""
        world = self.skills.world
        on = min((f for f in world.map.furniture.values() if _belongs(handle, f)), key=_area, default=None)
        stem = f"{on.name}/handle" if on is not None else "handle"
        for name, belief in world.handles.items():
            if belief.stamp < stamp and _same(belief.handle, handle):
                world.handles[name] = HandleBelief(name, handle, stamp, belief.furniture)
                return name
        number = 1
        while f"{stem}_{number}" in world.handles:
            number += 1
        name = f"{stem}_{number}"
        world.handles[name] = HandleBelief(name, handle, stamp, on.name if on is not None else None)
        return name

    def _wanted(self, belief: HandleBelief, furniture: MapFurniture | None) -> bool:
        joint = self.joint
        return (
            belief.handle.confidence >= self.min_confidence
            and (furniture is None or belief.furniture == furniture.name)
            and (not joint or belief.handle.joint == joint)
        )

    def _rank(self, handle: Handle) -> float:
        near: Pose | None = self.near
        if near is None:
            return -handle.confidence
        return float(np.linalg.norm(handle.pose.position - near.position))


def _same(known: Handle, seen: Handle) -> bool:
    """Return whether two handles overlap: of a long one, a view may show only a part."""
    apart = seen.pose.position - known.pose.position
    along = float(apart @ known.axis)
    beside = float(np.linalg.norm(apart - along * known.axis))
    return beside < SAME_HANDLE and abs(along) < max(SAME_HANDLE, (known.length + seen.length) / 2)


def _belongs(handle: Handle, furniture: MapFurniture) -> bool:
    low_enough = float(handle.pose.position[2]) < furniture.height + MAP_MARGIN
    if low_enough and furniture.covers(handle.pose.position[:2], MAP_MARGIN):
        return True
    doors = (
        FurnitureArticulation(f"{furniture.name}/{door.name}", furniture, door) for door in furniture.articulations
    )
    return any(opening_seen(door, handle) is not None for door in doors)


def _area(furniture: MapFurniture) -> float:
    """Return the floor area of the furniture, m²; furniture on other furniture has less."""
    return furniture.footprint[0] * furniture.footprint[1]
