"""Checks whether an object is released and at rest, shared by all facts about objects."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from bestman_bt.facts.evidence import Evidence
from bestman_bt.messages import Pose

if TYPE_CHECKING:
    from bestman_bt.scene.scene import PlacedFurniture

AT_REST = 0.001
"""Metres that an object may move during the rest time."""


def is_moving(evidence: Evidence, name: str) -> bool:
    """Return whether an object has moved during the rest time."""
    way = evidence.truth.object_pose(name).position - evidence.before[name]
    return float(np.linalg.norm(way)) > AT_REST


def tilt_fault(evidence: Evidence, pose: Pose) -> list[str]:
    """Return the tilt as a list with one fault, or an empty list if upright."""
    tolerated = evidence.task.config.task.tolerances.tilt
    return [f"tilted by {math.degrees(pose.tilt):.0f}°"] if pose.tilt > tolerated else []


def rest_faults(evidence: Evidence, name: str, surface: str) -> list[str]:
    """Return why an object does not rest on the furniture of ``surface``."""
    truth = evidence.truth
    faults = ["still moving"] if is_moving(evidence, name) else []
    if truth.touches_robot(name):
        faults.append("not let go")
    support = surface.partition("/")[0]
    if support not in truth.supports(name):
        faults.append(f"not standing on the {support}")
    return faults


def is_over(evidence: Evidence, name: str, surface: str) -> bool:
    """Return whether the middle of an object is above a surface, within its outline, and below the next one above."""
    _, map_from_surface, size, room = surface_pose(evidence, surface)
    local = map_from_surface.inverse().apply(evidence.truth.object_pose(name).position[None])[0]
    return bool(np.all(np.abs(local[:2]) <= np.array(size) / 2)) and 0.0 < float(local[2]) < room


def surface_pose(evidence: Evidence, name: str) -> tuple[PlacedFurniture, Pose, tuple[float, float], float]:
    """Return the piece, the true pose of its surface (drawers at their opening), its size, and its clear height.

    The clear height is that up to the next surface, metres; infinite without one.
    """
    wanted, _, part = name.partition("/")
    piece = next(p for p in evidence.task.world.furniture if p.name == wanted)
    surface = next(s for s in piece.model.all_surfaces if part in ("", s.name))
    z = float(surface.pose.position[2])
    above = [float(s.pose.position[2]) - z for s in piece.model.all_surfaces]
    room = min((rise for rise in above if rise > 1e-6), default=math.inf)
    pose = piece.pose @ drawer_displacement(evidence, name) @ surface.pose
    return piece, pose, surface.size, room


def drawer_displacement(evidence: Evidence, name: str) -> Pose:
    """Return the displacement of a surface's drawer, in the furniture frame; identity for other surfaces."""
    wanted, _, part = name.partition("/")
    piece = next(p for p in evidence.task.world.furniture if p.name == wanted)
    door = piece.model.drawer_of(part)
    if door is None:
        return Pose()
    opened = evidence.truth.articulation_position(f"{wanted}/{door.name}")
    return Pose(opened * np.array(door.axis))
