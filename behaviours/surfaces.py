"""Surfaces of the map as skills use them: where to look for one, and what the arm must keep clear of."""

from __future__ import annotations

import numpy as np

from behaviours.context import SkillContext
from behaviours.skill import SkillFailure
from bestman_bt.messages import Box, PlacedShape, Pose
from bestman_bt.perception.segmentation import Region, SupportPlane
from bestman_bt.sensing.rgbd import RGBDView
from bestman_bt.world_model import MapFurniture, MapSurface, Obstacle

MARGIN = 0.08
"""Metres beyond the mapped rectangle in which a surface is sought: the map is off by up to 3 cm and 2°."""


def find_surface(skills: SkillContext, name: str) -> tuple[MapFurniture, MapSurface]:
    """The mapped surface; SkillFailure names what there is."""
    try:
        return skills.world.map.surface(name)
    except KeyError as error:
        raise SkillFailure("unknown_surface", str(error.args[0])) from error


def surface_region(skills: SkillContext, name: str) -> Region:
    """Where to look for a surface, in the base frame."""
    furniture, surface = find_surface(skills, name)
    base_from_surface = skills.map_from_base.inverse() @ furniture.pose.to_pose() @ surface.pose
    return Region(base_from_surface, (surface.size[0] + 2 * MARGIN, surface.size[1] + 2 * MARGIN))


def measured_surface(skills: SkillContext, name: str, view: RGBDView, plane: SupportPlane) -> Obstacle:
    """The furniture below a measured surface as an obstacle.

    A slab where the surface was seen, and the mapped body of the furniture, grown by the map's error, up to just
    below the slab.
    """
    furniture, surface = find_surface(skills, name)
    slab = plane.slab(thickness=0.04, grow=0.02)
    map_from_surface = furniture.pose.to_pose() @ surface.pose
    measured_height = plane.height_at(*(view.map_from_base.inverse() @ map_from_surface).position[:2])
    top = measured_height - 0.02
    body = PlacedShape(
        Box((furniture.footprint[0] + MARGIN, furniture.footprint[1] + MARGIN, top)),
        furniture.pose.to_pose() @ Pose(np.array([0.0, 0.0, top / 2])),
    )
    return Obstacle(f"{name}/surface", (PlacedShape(slab.shape, view.map_from_base @ slab.pose), body), view.stamp)
