"""Mapped surfaces for skills: search regions and collision bodies."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from behaviours.context import SkillContext
from behaviours.skill import SkillFailure
from bestman_bt.messages import Box, PlacedShape, Pose, Pose2D
from bestman_bt.perception.errors import NoSurfaceError
from bestman_bt.world_model.openness import articulation_shapes
from bestman_bt.world_model.semantic_map import MapFurniture, MapSurface
from bestman_bt.world_model.world_model import Obstacle

if TYPE_CHECKING:
    from bestman_bt.control.rgbd import RGBDView
    from bestman_bt.perception.segmentation.base import Region, SupportPlane


MARGIN = 0.08
"""Metres beyond the mapped rectangle to search for a surface: the map has errors up to 3 cm and 2°."""

BOARD = 0.06
"""Gap below the next higher surface, metres: the thickness of a board, and the map's error."""
RIM = 0.015
"""Margin to leave out next to the walls of an enclosed surface, metres."""
BOARD_OUTSIDE = 0.04
"""Assumed thickness of the top of furniture, metres."""
INNER_BOARD = 0.008
"""Smallest thickness of a board within furniture, metres."""
SLAB_GROWTH = 0.02
"""Margin to add to the seen part of a surface on each side, metres."""

UNKNOWN_SURFACE = {"unknown_surface": "use a surface of the map"}
SURFACE_NOT_SEEN = {"surface_not_seen": "stand at it and look at it first: FindStandPose, NavigateTo, LookAt"}


def find_surface(skills: SkillContext, name: str) -> tuple[MapFurniture, MapSurface]:
    """Return the mapped surface, a drawer's at its believed opening. Raises SkillFailure listing the known ones."""
    try:
        return skills.world.surface(name)
    except KeyError as error:
        raise SkillFailure("unknown_surface", str(error.args[0])) from error


def with_open_drawers(skills: SkillContext, furniture: MapFurniture) -> MapFurniture:
    """Return the piece with a footprint that includes the most open drawer and its handle."""
    frame = furniture.pose.to_pose().inverse()
    front = -furniture.footprint[0] / 2
    reach = front
    for door in furniture.articulations:
        if door.kind == "prismatic" and skills.world.articulations.get(f"{furniture.name}/{door.name}", 0.0) > 0.0:
            handles = [belief.handle.pose for belief in skills.world.handles_of(furniture, door)]
            boards = [placed.pose for placed in articulation_shapes(skills.world, furniture, door)]
            reach = min(
                [reach, *(float((frame @ p).position[0]) for p in handles), *(float(p.position[0]) for p in boards)]
            )
    middle = furniture.pose @ Pose2D((reach - front) / 2, 0.0, 0.0)
    return replace(furniture, pose=middle, footprint=(furniture.footprint[0] + front - reach, furniture.footprint[1]))


def surface_region(skills: SkillContext, name: str, view: RGBDView) -> Region:
    """Return the search region of a surface, in the base frame.

    A surface below another one, such as a shelf board, is enclosed by walls: if ``view`` shows it, the region is the
    measured board without its rim.
    """
    from bestman_bt.perception.segmentation.base import Region
    from bestman_bt.perception.segmentation.support_surfaces import surface_regions

    furniture, surface = find_surface(skills, name)
    base_from_surface = skills.map_from_base.inverse() @ furniture.pose.to_pose() @ surface.pose
    above = [other.pose.position[2] - surface.pose.position[2] for other in furniture.surfaces]
    room = min((float(rise) for rise in above if rise > 0.0), default=None)
    if room is None:
        return Region(base_from_surface, (surface.size[0] + 2 * MARGIN, surface.size[1] + 2 * MARGIN))
    try:
        planes = skills.surfaces.find(view.in_base, skills.rng)
    except NoSurfaceError:
        planes = ()
    regions = surface_regions(planes, height=room - BOARD, margin=-RIM)
    for plane, region in zip(planes, regions, strict=True):
        local = base_from_surface.inverse().apply(plane.frame_from_plane.position)
        if abs(local[2]) < MARGIN / 2 and (np.abs(local[:2]) < np.array(surface.size) / 2).all():
            return region
    return Region(base_from_surface, surface.size, height=room - BOARD)


def measured_surface(skills: SkillContext, name: str, view: RGBDView, plane: SupportPlane) -> Obstacle:
    """Return the furniture below a measured surface as an obstacle: a slab at the measured surface, and
    ``_support``.
    """
    furniture, surface = find_surface(skills, name)
    if furniture.is_inside(surface):
        slab = plane.slab(thickness=INNER_BOARD)
    else:
        slab = plane.slab(thickness=BOARD_OUTSIDE, grow=SLAB_GROWTH)
    map_from_surface = furniture.pose.to_pose() @ surface.pose
    height = plane.height_at(*(view.map_from_base.inverse() @ map_from_surface).position[:2])
    return _support(
        name, furniture, surface, PlacedShape(slab.shape, view.map_from_base @ slab.pose), height, view.stamp
    )


def surface_obstacle(skills: SkillContext, name: str, height: float) -> Obstacle:
    """Return the obstacle of a surface at a known height, ``height`` metres above the floor, as
    ``measured_surface``.
    """
    furniture, surface = find_surface(skills, name)
    thickness = INNER_BOARD if furniture.is_inside(surface) else BOARD_OUTSIDE
    mapped = furniture.pose.to_pose() @ surface.pose
    middle = Pose(np.array([*mapped.position[:2], height - thickness / 2]), mapped.quaternion)
    slab = PlacedShape(Box((*surface.size, thickness)), middle)
    return _support(name, furniture, surface, slab, height, skills.clock.now())


def _support(
    name: str, furniture: MapFurniture, surface: MapSurface, slab: PlacedShape, height: float, stamp: float
) -> Obstacle:
    """Return the slab, and below it the mapped body of the furniture, grown by the map's error.

    Of furniture that opens it is the slab alone, within it a thin one: the map knows the boards below and around it,
    and a drawer goes through where a solid body would be.
    """
    if furniture.is_inside(surface) or furniture.articulations:
        return Obstacle(f"{name}/surface", (slab,), stamp)
    top = height - BOARD_OUTSIDE / 2
    body = PlacedShape(
        Box((furniture.footprint[0] + MARGIN, furniture.footprint[1] + MARGIN, top)),
        furniture.pose.to_pose() @ Pose(np.array([0.0, 0.0, top / 2])),
    )
    return Obstacle(f"{name}/surface", (slab, body), stamp)
